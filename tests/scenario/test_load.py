"""Loading scenarios: what is read, and every line said of what is wrong."""

import pickle
import subprocess
import sys
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from replay.errors import ScenarioError
from replay.scenario.load import load, load_model, load_sources
from replay.scenario.methods import METHOD_REVISIONS, Model
from replay.scenario.yaml_text import parse
from replay.sensing.kinds import KINDS

DATA = Path(__file__).parent / "data"
FULL = DATA / "full.yaml"

HEAD = "version: 1\nname: a\nrate: 60 Hz\nduration: 1 s\n"
TWO_LINKS = f"""{HEAD}links:
  a:
    shapes: {{box: {{type: cube, size: 1}}}}
  b:
    joint: {{name: j, type: revolute, lower: -1, upper: 1, velocity: 1, acceleration: 1}}
    shapes: {{ball: {{type: sphere, radius: 1}}}}
"""
BEFORE = {"header": HEAD, "two links": TWO_LINKS}
BAD = parse((DATA / "bad_scenarios.yaml").read_bytes(), "bad_scenarios.yaml", []).data()


def load_text(text):
    return load_sources("f.yaml", {"f.yaml": text.encode()})


def problems(text):
    with pytest.raises(ScenarioError) as caught:
        load_text(text)
    return [str(problem) for problem in caught.value.problems]


@pytest.mark.parametrize("case", BAD.values(), ids=BAD)
def test_every_problem_is_listed_once_with_its_place(case):
    assert problems(BEFORE.get(case.get("after"), "") + case["text"]) == case["problems"].splitlines()


def test_everything_the_language_has_is_read():
    scenario = load(FULL)
    assert (scenario.name, scenario.tags, scenario.frames) == ("full", ("machine", "test"), 301)
    arc = scenario.links["arc"]
    assert arc.joint.axis == (1.0, 0.0, 0.0)
    assert arc.joint.upper == pytest.approx(np.deg2rad(120.0), rel=1e-15)
    assert arc.joint.velocity == pytest.approx(np.deg2rad(25.0), rel=1e-15)
    assert scenario.links["stand"].joint.type == "fixed"
    assert scenario.links["patient"].shapes["body"].scale == 0.01
    assert scenario.motion.points["arc_rotation"][1].position.value == pytest.approx(np.pi / 6, rel=1e-15)
    assert scenario.motion.moves[0].to["lift"].value == 0.1
    assert scenario.motion.free["doctor"][1].rpy == (0.0, 0.0, np.pi / 2)
    assert scenario.sensors.distance["corner"].range == 1.5
    assert scenario.sensors.capacitive["guard"].coupling == 10e-12
    assert scenario.sensors.capacitive["guard"].plates["front"].size == (0.05, 0.2)
    assert scenario.collision.disable[0].reason == "they are bolted together"
    assert len(scenario.expect) == 5
    assert scenario.model.collision.clearance == "always"


def test_a_loaded_scenario_loads_again_from_its_own_sources():
    scenario = load(FULL)
    again = load_sources(scenario.main_source, scenario.sources)
    assert again == scenario
    assert again.sha256 == scenario.sha256
    assert set(scenario.sha256) == {
        "full.yaml",
        "parts/sensors.yaml",
        "meshes/wedge.stl",
        "package://pyskindose/phantom_data/adult_male_reduced_1000t.stl",
    }


def test_a_scenario_travels_to_another_process():
    scenario = load(FULL)
    again = pickle.loads(pickle.dumps(scenario))
    assert again == scenario
    assert again.sources == scenario.sources
    assert again.provenance.place(("rate",)) == scenario.provenance.place(("rate",))


def test_loading_imports_nothing_heavy():
    code = (
        f"import sys; from replay.scenario.load import load; load({str(FULL)!r});"
        "print([m for m in ('numba', 'trimesh', 'scipy', 'rerun', 'pyskindose') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


@pytest.mark.parametrize(
    ("rate", "duration", "frames"),
    [
        ("60 Hz", "5 s", 301),
        ("60", "0", 1),
        ("30000/1001 Hz", "1001/30 s", 1001),  # floats lose the last frame
        ("10", "0.3", 4),  # 0.3 * 10 is 2.9999999999999996 in doubles
        ("0.1 kHz", "30 ms", 4),
        ("3", "0.99", 3),
    ],
)
def test_frames_are_counted_exactly(rate, duration, frames):
    text = f"version: 1\nname: a\nrate: {rate}\nduration: {duration}\nlinks: {{a: {{}}}}\n"
    assert load_text(text).frames == frames


def test_a_rate_is_the_fraction_that_is_written():
    text = "version: 1\nname: a\nrate: 59.94\nduration: 1 s\nlinks: {a: {}}\n"
    assert load_text(text).rate == Fraction(5994, 100)


def test_references_are_checked_while_other_parts_are_wrong():
    lines = problems(TWO_LINKS + "sensors: {distance: {d: {link: c, aperture: 1}}}\nname2: x\n")
    assert lines == [
        "f.yaml:11:32: sensors.distance.d.link = 'c' is no link; links are a, b",
        "f.yaml:12:1: name2: unknown key; did you mean 'name'?",
    ]


@pytest.mark.parametrize(
    ("name", "reason"),
    [("nothing.yaml", "does not exist"), (".", "is a folder; name a file"), ("n\0ul", "cannot be read")],
)
def test_a_file_that_cannot_be_read_is_one_line(tmp_path, name, reason):
    with pytest.raises(ScenarioError, match=reason):
        load(tmp_path / name)


def test_a_similar_file_is_proposed(tmp_path):
    (tmp_path / "carm.yaml").touch()
    with pytest.raises(ScenarioError, match=r"did you mean 'carm.yaml'"):
        load(tmp_path / "carm.yml")


def test_models_come_by_name_or_from_a_file(tmp_path):
    thesis = load_model("thesis2015")
    assert thesis.identity() == {
        "collision.bounds": "obb_vertices@1",
        "collision.narrowphase": "gjk@1",
        "collision.pieces": "convex@1",
        "collision.between": "sampled@1",
        "collision.clearance": "never",
        "distance": "thesis@2",
        "capacitive": "midpoint@3",
        "capacitive.splits": "4",
    }
    assert load_text(HEAD + "links: {a: {}}\nmodel: thesis2015\n").model == thesis
    file = tmp_path / "model.yaml"
    file.write_text("distance: {method: rays, count: 61}\ncapacitive: {rtol: 1e-4}\n")
    identity = load_model(file).identity()
    assert identity["distance.count"] == "61" and identity["distance.engine"] == "own"
    assert identity["capacitive.rtol"] == "0.0001"
    file.write_text("distance: {method: ray}\nnoise: 1\n")
    with pytest.raises(ScenarioError) as caught:
        load_model(file)
    assert [str(problem).removeprefix(f"{file}:") for problem in caught.value.problems] == [
        "1:20: distance.method = 'ray' must be 'exact', 'rays' or 'thesis'",
        "2:1: noise: unknown key; known are collision, distance, capacitive",
    ]
    file.write_text("model:\n  distance: {method: rays}\n")
    with pytest.raises(ScenarioError, match=":1:1: model: a file of a model begins one level below this key"):
        load_model(file)
    file.write_text("version: 1\nlinks: {a: {}}\n")
    with pytest.raises(ScenarioError, match="a model is a mapping of collision, distance, capacitive, not a scenario"):
        load_model(file)
    file.write_text("- 1\n")
    with pytest.raises(ScenarioError, match=r"a model is a mapping .* not a list of 1"):
        load_model(file)
    with pytest.raises(ScenarioError, match=r"does not exist.*built-in models are: thesis2015"):
        load_model(tmp_path / "thesis")


def test_every_choice_of_method_has_a_revision():
    methods = Model.model_fields
    assert set(methods) == {"collision", *KINDS}
    expected = set()
    for option in ("bounds", "narrowphase", "pieces", "between"):
        field = methods["collision"].annotation.model_fields[option]
        expected |= {f"collision.{option}.{choice}" for choice in field.annotation.__args__}
    for group in KINDS:
        field = methods[group].annotation.model_fields["method"]
        expected |= {f"{group}.{choice}" for choice in field.annotation.__args__}
    assert set(METHOD_REVISIONS) == expected


def test_a_margin_of_nothing_is_refused_where_it_is_written(tmp_path):
    path = tmp_path / "none.yaml"
    path.write_text("version: 1\nname: a\nrate: 10\nduration: 1\nlinks: {a: {}}\ncollision: {margin: 0 cm}\n")
    with pytest.raises(ScenarioError, match=r"none.yaml:6:21: collision.margin = '0 cm' must be > 0 m"):
        load(path)
