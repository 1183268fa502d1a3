"""Sweeps: cases, their names, and where errors point to."""

import json
import pickle
import re

import pytest
from pydantic import ValidationError

from replay import limits
from replay.errors import ScenarioError
from replay.scenario import load as load_module
from replay.scenario.load import load, load_cases, load_sources
from replay.scenario.sweep import SweepPart, cases

TEXT = """version: 1
name: eye
rate: 10 Hz
duration: 1 s
links:
  wall: {shapes: {slab: {type: cube, size: 1}}}
  arm: {joint: {type: revolute, velocity: 1, acceleration: 1}, shapes: {rod: {type: cube, size: 0.1}}}
motion: {moves: [{to: {arm: 10 deg}}]}
sensors: {distance: {tip: {link: arm, aperture: 20 deg}, a.b: {link: arm, aperture: 20 deg}}}
sweep:
"""
GRID = '  grid: {"sensors.distance.tip.aperture": [10 deg, 30 deg], "motion.moves[0].to.arm": [0.1, 5 deg]}\n'


def write(tmp_path, sweep):
    path = tmp_path / "eye.yaml"
    path.write_text(TEXT + sweep)
    return path


def problems(tmp_path, sweep):
    with pytest.raises(ScenarioError) as caught:
        load_cases(write(tmp_path, sweep))
    return [str(problem).removeprefix(f"{tmp_path.as_posix()}/") for problem in caught.value.problems]


def test_a_grid_is_all_combinations_named_by_their_values(tmp_path):
    found = load_cases(write(tmp_path, GRID))
    assert [scenario.name for scenario in found] == [
        "eye[aperture=10deg,arm=0.1]",
        "eye[aperture=10deg,arm=5deg]",
        "eye[aperture=30deg,arm=0.1]",
        "eye[aperture=30deg,arm=5deg]",
    ]
    assert found[2].sensors.distance["tip"].aperture == 0.5235987755982989  # pi / 6, rounded once
    assert found[2].motion.moves[0].to["arm"].value == 0.1
    assert all(scenario.sweep is None for scenario in found)
    base = load(write(tmp_path, GRID))
    assert base.name == "eye"
    assert base.sweep is not None


def test_a_case_is_found_again_from_its_sources_alone_and_travels_pickled(tmp_path):
    case = load_cases(write(tmp_path, GRID))[3]
    again = load_sources(case.main_source, case.sources, case=case.name)
    assert again == case
    assert load_sources(case.main_source, case.sources, case="eye").name == "eye"
    with pytest.raises(ScenarioError, match="no case 'eye\\[x\\]'"):
        load_sources(case.main_source, case.sources, case="eye[x]")
    copy = pickle.loads(pickle.dumps(case))
    assert (copy, copy.sources, copy.main_source) == (case, case.sources, case.main_source)


def test_a_list_is_case_by_case_and_may_replace_whole_parts(tmp_path):
    long = "x" * 120
    sweep = f"""  list:
    - {{model: thesis2015}}
    - {{model.capacitive.rtol: 1e-3, duration: 2 s}}
    - {{sensors.distance.a.b.aperture: 0.25, sensors.distance.tip.aperture: 0.5}}
    - {{"links.wall.shapes.slab": {{type: sphere, radius: 1}}}}
    - {{description: {long}}}
    - {{description: a/b}}
    - {{description: a:b}}
"""
    found = load_cases(write(tmp_path, sweep))
    assert [scenario.name for scenario in found] == [
        "eye[model=thesis2015]",
        "eye[rtol=1e-3,duration=2s]",
        "eye[b.aperture=0.25,tip.aperture=0.5]",
        "eye[slab=type=sphere_radius=1]",
        "eye[5]",
        "eye[description=a_b]",
        "eye[7]",
    ]
    assert found[0].model.distance.method == "thesis"
    assert (found[1].model.capacitive.rtol, found[1].frames) == (1e-3, 21)
    assert found[2].sensors.distance["a.b"].aperture == 0.25
    assert found[3].links["wall"].shapes["slab"].type == "sphere"


@pytest.mark.parametrize(
    ("sweep", "expected"),
    [
        (
            '  grid: {"sensors.distance.tip.aperture": [10 cm]}\n',
            "eye.yaml:11:44: sensors.distance.tip.aperture = '10 cm'",
        ),
        ("  grid: {sensors.distance.tpi.aperture: [1]}\n", "there is no sensors.distance.tpi; did you mean 'tip'?"),
        (
            "  grid: {sensors.distance.tip.apperture: [1]}\n",
            "sensors.distance.tip.apperture: unknown key; did you mean",
        ),
        ("  grid: {links.c.pose: [1, 2]}\n", "eye.yaml:11:10: sweep path 'links.c.pose' names nothing"),
        ("  grid: {name: [a]}\n", "cannot be swept: name belongs to the file"),
        ("  grid: {'motion.moves[1].speed': [1]}\n", "motion.moves is a list of 1"),
        ("  grid: {rate.x: [1]}\n", "rate = '10 Hz' has no parts"),
        ("  grid: {rate: []}\n", "sweep.grid.rate must have at least one entry"),
        ("  grid: {rate: 5}\n", "sweep.grid.rate = 5 must be a list"),
        ("  {}\n", "needs either grid (all combinations) or list (case by case)"),
        ("  {grid: {rate: [1]}, list: [{rate: 2}]}\n", "needs either grid"),
        ("  {gird: {rate: [1]}}\n", "did you mean 'grid'"),
    ],
)
def test_errors_point_to_the_value_in_the_sweep(tmp_path, sweep, expected):
    found = problems(tmp_path, sweep)
    assert len(found) == 1
    assert found[0].startswith("eye.yaml:1")
    assert expected in found[0].replace("1 entry", "one entry")


def test_too_many_cases_are_refused(tmp_path):
    values = json.dumps(list(range(1, 102)))
    grid = f"  grid: {{rate: {values}, duration: {values}}}\n"
    assert "makes 10201 cases; at most 10000 are run" in problems(tmp_path, grid)[0]


def test_values_are_counted_that_cases_have_and_not_those_of_the_sweep(tmp_path, monkeypatch):
    monkeypatch.setattr(limits, "SWEEP_VALUES", 1)
    (told,) = problems(tmp_path, GRID)
    each = int(re.search(r"4 cases of (\d+) values each", told)[1])
    monkeypatch.setattr(limits, "SWEEP_VALUES", 40 * each)
    assert len(load_cases(write(tmp_path, f"  grid: {{rate: {[f'{k} Hz' for k in range(1, 41)]}}}\n"))) == 40
    assert len(problems(tmp_path, f"  grid: {{rate: {[f'{k} Hz' for k in range(1, 42)]}}}\n")) == 1


def test_the_cases_of_one_sweep_are_listed_once_however_many_are_asked_for(monkeypatch):
    listed = []
    monkeypatch.setattr(load_module, "cases", lambda *given: listed.append(given) or cases(*given))
    sources = {"eye.yaml": f"# asked for here alone\n{TEXT}{GRID}".encode()}
    for angle in (10, 30):
        name = f"eye[aperture={angle}deg,arm=5deg]"
        assert load_sources("eye.yaml", sources, case=name).name == name
    assert len(listed) == 1


def test_cases_share_their_meshes_in_memory(tmp_path):
    (tmp_path / "ball.stl").write_bytes(b"solid ball\nendsolid\n")
    path = write(tmp_path, GRID)
    path.write_text(path.read_text().replace("{type: cube, size: 0.1}", "{type: mesh, file: ball.stl, scale: 1}"))
    found = load_cases(path)
    assert len({id(scenario.sources["ball.stl"]) for scenario in found}) == 1


@pytest.mark.parametrize(
    ("counts", "told"),
    [
        ((101, 100), "makes 10100 cases; at most 10000 are run"),
        ((1000, 1000, 1000), "makes 1000000000 cases; at most"),
        ((1001, 1000, 1000), r"makes more than 10\^9 cases; at most"),
    ],
)
def test_so_many_cases_are_told_and_no_number_longer_than_that(counts, told):
    with pytest.raises(ValidationError, match=told):
        SweepPart.model_validate({"grid": {f"a.b{k}": [1] * count for k, count in enumerate(counts)}})
    SweepPart.model_validate({"grid": {"a.b": [1] * 100, "a.c": [1] * 100}})
