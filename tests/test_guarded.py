"""Guards in whole scenarios: speculation changes nothing, and recordings, sweeps, differences and logs know them."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

import replay
from replay import guarded, simulation
from replay.batch.case import CaseOrder, CaseStatus, describe, run_case
from replay.batch.run import Execution, run_all
from replay.cli.exit_codes import ExitCode
from replay.cli.main import run
from replay.comparison.effects import effects
from replay.recording.export import tables
from replay.scenario.load import load_cases, load_sources
from replay.scenario.methods import METHOD_REVISIONS
from replay.scenario.scene import build

TEXT = """version: 1
name: cart
rate: 60 Hz
duration: {duration}
links:
  wall: {{pose: {{xyz: [1, 0, 0]}}, shapes: {{slab: {{type: cuboid, size: [2 cm, 1, 1]}}}}}}
  cart:
    joint: {{type: prismatic, axis: [1, 0, 0], lower: 0, upper: 2, velocity: 0.3, acceleration: 1}}
    shapes: {{box: {{type: cube, size: 10 cm}}}}
  flag:
    pose: {{xyz: [0, 2, 0]}}
    joint: {{type: revolute, mimic: {{joint: cart, multiplier: 2}}}}
    shapes: {{cloth: {{type: cube, size: 10 cm}}}}
  other:
    pose: {{xyz: [0, 4, 0]}}
    joint: {{type: prismatic, axis: [0, 0, 1], velocity: 0.5, acceleration: 1}}
    shapes: {{box: {{type: cube, size: 10 cm}}}}
{motion}
sensors:
  distance:
    tip:
      link: cart
      pose: &front {{xyz: [6 cm, 0, 0], rpy: [0, 90 deg, 0]}}
      aperture: 20 deg
      range: 0.7
      ignore: [flag, other]{signal}
  capacitive:
    pad: {{link: cart, plates: {{a: {{pose: *front, size: [5 cm, 5 cm]}}}}, coupling: 1 pF, ignore: [flag, other]}}
guards:
{guards}
{more}"""
MOVES = "motion: {moves: [{to: {cart: 0.9}}, {to: {other: 1}}]}"
STOP = "  stop: {when: {distance: tip, below: 20 cm}, reaction: 55 ms, stop: [cart]}\n"
SLOW = (
    "  slow: {when: {pair: [cart, wall], clearance: {below: 40 cm}}, slow: {to: 0.5, joints: [cart]},"
    " deceleration: {cart: 0.2}}\n"
)
SEVERAL = (
    STOP
    + SLOW
    + "  near: {when: {all: [{capacitive: pad, output: {below: 2.3 V}}, {distance: tip, below: 0.5}]}, for: 50 ms,"
    " slow: {to: 0.8, joints: [cart, other]}, release: {after: 0.1 s}}\n"
)


def sources(
    guards: str = STOP, *, duration: str = "5 s", motion: str = MOVES, signal: str = "", more: str = ""
) -> dict:
    text = TEXT.format(guards=guards, duration=duration, motion=motion, signal=signal, more=more)
    return {"cart.yaml": text.encode()}


def scenario(guards: str = STOP, **written: str) -> replay.Scenario:
    return load_sources("cart.yaml", sources(guards, **written))


def columns(made: replay.Scenario) -> dict[str, np.ndarray]:
    """Return all columns."""
    blocks = list(replay.simulate(made))
    parts = {"positions": [block.joint_positions for block in blocks], "poses": [block.link_poses for block in blocks]}
    parts["velocities"] = [block.joint_velocities for block in blocks]
    for name in ("guards", "distance", "capacitive", "collision"):
        for field in getattr(blocks[0], name).present():
            parts[f"{name}.{field.name}"] = [getattr(getattr(block, name), field.name) for block in blocks]
    return {name: np.concatenate(values) for name, values in parts.items()}


def same(a: dict[str, np.ndarray], b: dict[str, np.ndarray]) -> bool:
    return a.keys() == b.keys() and all(a[name].tobytes() == b[name].tobytes() for name in a)


NOISE = "\n      signal: {rate: 20 Hz, delay: 0.1 s, noise: {std: 2 mm, seed: 1}, dropout: 10 %}"


@pytest.mark.parametrize("signal", ["", NOISE])
def test_neither_blocks_nor_speculation_matter(monkeypatch: pytest.MonkeyPatch, signal: str) -> None:
    made = scenario(SEVERAL, signal=signal)
    whole = columns(made)
    assert whole["guards.state"].max() == 3
    for frames in (1, 7):
        with monkeypatch.context() as changed:
            changed.setattr(simulation, "BLOCK_FRAMES", frames)
            assert same(columns(made), whole), frames
    for longest in (1, 300):
        monkeypatch.setattr(guarded, "LONGEST", longest)
        monkeypatch.setattr(guarded, "SHORTEST", longest)
        assert same(columns(made), whole), longest


def test_a_block_asked_for_alone_is_the_same() -> None:
    made = simulation.Simulation(build(scenario(SEVERAL)))
    streamed = list(made.blocks())
    alone = simulation.Simulation(build(scenario(SEVERAL))).block(streamed[1].first)
    assert alone.guards.state.tobytes() == streamed[1].guards.state.tobytes()
    assert alone.joint_positions.tobytes() == streamed[1].joint_positions.tobytes()
    again = made.block(0)
    assert again.guards.script_time.tobytes() == streamed[0].guards.script_time.tobytes()


@pytest.mark.parametrize(
    ("method", "below", "duration", "shorter"),
    [
        ("tree", "2.35 V", "4 s", "2.5 s"),
        ("field", "1.25 V", "0.1 s", "0.084 s"),
        ("bem", "1.25 V", "0.1 s", "0.084 s"),
    ],
)
def test_what_comes_before_does_not_depend_on_what_comes_after(method, below, duration, shorter) -> None:
    guards = f"  near: {{when: {{capacitive: pad, output: {{below: {below}}}}}, stop: [cart]}}\n"
    near = "motion: {points: {cart: [{time: 0, position: 0.8}, {time: 1, position: 0.9}]}}"
    written = {"motion": MOVES if method == "tree" else near, "more": f"model: {{capacitive: {{method: {method}}}}}\n"}
    whole = columns(scenario(guards, duration=duration, **written))
    cut = columns(scenario(guards, duration=shorter, **written))
    frames = len(cut["positions"])
    assert whole["guards.state"].any()
    for name, values in cut.items():
        assert values.tobytes() == whole[name][:frames].tobytes(), name


def test_without_a_trigger_nothing_changes() -> None:
    bare = load_sources("cart.yaml", {"cart.yaml": sources()["cart.yaml"].replace(b"guards:\n" + STOP.encode(), b"")})
    quiet = scenario(STOP.replace("20 cm", "1 cm"))
    for a, b in zip(replay.simulate(bare), replay.simulate(quiet), strict=True):
        assert a.joint_positions.tobytes() == b.joint_positions.tobytes()
        for name in ("distance", "capacitive", "collision"):
            for field in getattr(a, name).present():
                assert (
                    getattr(getattr(a, name), field.name).tobytes() == getattr(getattr(b, name), field.name).tobytes()
                )
        assert not b.guards.state.any()
        assert (b.guards.rate == 1.0).all()
        assert b.guards.script_time.tobytes() == np.repeat(b.time[:, None] / 1e9, 3, axis=1).tobytes()


def test_joints_that_are_not_named_go_on_and_followers_follow_their_leaders_clock() -> None:
    found, bare = columns(scenario()), columns(scenario(STOP.replace("20 cm", "1 cm")))
    cart, flag, other = 0, 1, 2
    assert found["positions"][:, other].tobytes() == bare["positions"][:, other].tobytes()
    np.testing.assert_array_equal(found["positions"][:, flag], 2.0 * found["positions"][:, cart])
    np.testing.assert_array_equal(found["guards.rate"][:, flag], found["guards.rate"][:, cart])
    assert found["positions"][-1, cart] < 0.8 < bare["positions"][-1, cart]


def test_a_guarded_pair_is_exact_whatever_the_margin_says() -> None:
    wide = columns(scenario(SLOW, more="collision: {margin: 80 cm}\n"))
    narrow = columns(scenario(SLOW, more="collision: {margin: 1 mm}\n"))
    never = columns(scenario(SLOW, more="model: {collision: {clearance: never}}\n"))
    assert wide["guards.state"].tobytes() == narrow["guards.state"].tobytes() == never["guards.state"].tobytes()
    first = int(np.argmax(wide["guards.state"][:, 0] > 0))
    pair = build(scenario(SLOW)).layout.pairs.index("cart/box|wall/slab")
    assert wide["collision.clearance"][first, pair] < 0.4 <= wide["collision.clearance"][first - 1, pair]


def test_a_contact_while_braking_has_its_moment_between_frames(tmp_path: Path) -> None:
    guards = "  late: {when: {distance: tip, below: 3 cm}, stop: [cart], deceleration: {cart: 0.3}}\n"
    motion = "motion: {points: {cart: [{time: 0, position: 0}, {time: 4, position: 1.2}]}}"
    made = scenario(guards, motion=motion)
    recording = replay.read(replay.record(made, tmp_path, rrd=False).mcap)
    trigger = next(event for event in recording.events if event.kind == "trigger")
    contact = next(event for event in recording.events if event.kind == "contact")
    assert trigger.time < contact.time
    begin = trigger.time / 1e9
    gap = 0.94 - 0.3 * begin  # v u - a u^2 / 2
    moment = begin + (0.3 - np.sqrt(0.09 - 2.0 * 0.3 * gap)) / 0.3
    assert contact.earliest <= moment * 1e9 <= contact.time
    assert contact.time - contact.earliest <= 1_000
    hold = next(event for event in recording.events if event.kind == "hold")
    assert hold.earliest <= (begin + 1.0) * 1e9 <= hold.time
    assert hold.time - hold.earliest <= 1


def test_recordings_with_guards_are_read_back_run_again_exported_and_compared(tmp_path: Path) -> None:
    first = replay.record(scenario(SEVERAL), tmp_path / "a")
    assert first.rrd is not None
    assert first.rrd.exists()
    recording = replay.read(first.mcap)
    found = columns(scenario(SEVERAL))
    for field in recording.guards.fields():
        assert getattr(recording.guards, field.name).tobytes() == found[f"guards.{field.name}"].tobytes()
    assert recording.layout.guards == ("near", "slow", "stop")
    again = load_sources(recording.provenance.root, recording.files)
    assert replay.record(again, tmp_path / "again", rrd=False).mcap.read_bytes() == first.mcap.read_bytes()
    table = tables(recording)["/guards"]
    assert set(table["slow state"]) == {"armed", "braking", "holding"}
    assert "cart rate" in table
    assert "cart script time [s]" in table
    later = replay.record(
        scenario(SEVERAL.replace("reaction: 55 ms", "reaction: 95 ms")), tmp_path / "b", rrd=False
    ).mcap
    names = {item.signal.full_name for item in replay.diff(first.mcap, later).signals}
    assert {"/guards/state/stop", "/guards/rate/cart", "/joint_states/position/cart"} <= names
    assert "/joint_states/position/other" not in names
    assert not replay.diff(first.mcap, first.mcap).signals
    alone = replay.read(first.mcap, topics=["/guards"])
    assert alone.guards.state.tobytes() == recording.guards.state.tobytes()


def test_reports_and_explanations_know_guards(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    files = []
    for name, reaction in (("a", "55 ms"), ("b", "155 ms")):
        made = scenario(STOP.replace("55 ms", reaction), signal="\n      signal: {rate: 30 Hz, bias: 1 mm}")
        files.append(str(replay.record(made, tmp_path / name, rrd=False).mcap))
    reports = ["--html", tmp_path / "d.html", "--junit", tmp_path / "d.xml", "--rrd", tmp_path / "both"]
    assert run(["diff", *files, *map(str, reports)]) is ExitCode.DIFFERENT
    assert "worst: distance -3 cm at" in capsys.readouterr().out, "0.3 m/s for 0.1 s longer"
    (guard,) = [effect for effect in effects(replay.diff(*files)) if effect.subject == "stop"]
    assert guard.text == "guard: state becomes braking 100 ms later"
    trigger = 2.6  # as `test_results_tell_what_guards_did_and_resumed_ones_too` has it
    assert guard.at == pytest.approx(trigger + 0.155, abs=1 / 60)
    assert guard.signals[0].startswith("/guards/")
    late = float(replay.read(files[0]).time[-1]) / 1e9  # long after it stopped, where the script is somewhere else
    assert run(["explain", files[0], "/distance/tip", "--at", str(late)]) is ExitCode.FINE
    text = capsys.readouterr().out
    told = replay.read(files[0]).distance
    shown = f"{100.0 * told.distance[-1, 0]:.6g} cm"
    assert f"  distance {shown}" in text
    assert f"distance.exact@{METHOD_REVISIONS['distance.exact']}: {shown}" in text
    assert f"  measured {100.0 * told.measured[-1, 0]:.6g} cm" in text


def test_a_recorded_motion_is_slowed_down_too(tmp_path: Path) -> None:
    times = np.arange(0.0, 4.0, 0.05)
    rows = [f"{t:.2f},{0.25 * t:.6f}" for t in times]
    (tmp_path / "log.csv").write_text("time,cart\n" + "\n".join(rows) + "\n")
    motion = "motion: {recorded: {file: log.csv, joints: {cart: {name: cart}}}}"
    path = tmp_path / "cart.yaml"
    path.write_bytes(sources(motion=motion)["cart.yaml"])
    found = columns(replay.load(path))
    state = found["guards.state"][:, 0]
    trigger = int(np.argmax(state > 0))
    way = found["positions"][-1, 0] - found["positions"][trigger, 0]
    assert way == pytest.approx(0.25 * 0.055 + 0.25**2 / 2.0, rel=1e-9)


def test_results_tell_what_guards_did_and_resumed_ones_too(tmp_path: Path) -> None:
    more = """expect:
  - {guard: stop, stops: always, stopping_distance: {max: 7 cm}, clearance_at_stop: {min: 14 cm}}
  - {guard: stop, stops: never}
  - {guard: stop, stops: {before: 3 s}, stopping_distance: {max: 61.4 mm}}
collision: {margin: 30 cm}
"""
    order = CaseOrder(scenario(more=more), tmp_path, rrd=False)
    result = run_case(order, lambda done, total: None)
    assert result.status is CaseStatus.BROKEN
    assert [outcome.passed for outcome in result.outcomes] == [True, True, True, False, True, False]
    assert result.outcomes[1].detail == "largest stopping distance 0.0615 m of cart"
    numbers = {item.name: item for item in result.measures if item.name.startswith("expect")}
    way, never = numbers["expect[0].stopping_distance.max"], numbers["expect[1].stops"]
    assert (way.unit, way.subject, way.limit) == ("m", "cart", 0.07)
    assert way.margin == pytest.approx(0.07 - 0.0615, rel=1e-9)
    assert (never.value, never.limit, never.margin) == (1.0, 0.0, -1.0)
    assert numbers["expect[2].stops.before"].value == pytest.approx(2.955, abs=1e-9)
    (stop,) = result.guards
    (joint,) = stop["joints"]
    assert stop["trigger"] == pytest.approx(2.6, abs=1e-9)
    assert joint["stopping_distance"] == pytest.approx(0.3 * 0.055 + 0.09 / 2.0, rel=1e-12)
    assert joint["reaction_distance"] == pytest.approx(0.3 * 0.055, rel=1e-12)
    assert stop["stopping_time"] == pytest.approx(0.055 + 0.3, rel=1e-12)
    clearance = 0.94 - columns(scenario())["positions"][-1, 0]
    assert stop["clearance_at_stop"] == pytest.approx(clearance, abs=1e-12)
    assert numbers["expect[0].clearance_at_stop.min"].margin == pytest.approx(clearance - 0.14, abs=1e-12)
    assert stop["clearance"] <= clearance
    assert stop["clearance"] == pytest.approx(clearance, abs=5e-3)
    assert stop["contact"] is None
    assert any(line.startswith("  guard stop: triggered at") for line in describe(result))
    written = json.loads(json.dumps(result.as_json()))
    assert type(result).from_json(written, result.recordings).guards == result.guards


def test_a_contact_after_the_trigger_is_told_with_the_speed(tmp_path: Path) -> None:
    guards = "  late: {when: {distance: tip, below: 3 cm}, stop: [cart], deceleration: {cart: 0.3}}\n"
    motion = "motion: {points: {cart: [{time: 0, position: 0}, {time: 4, position: 1.2}]}}"
    more = "expect: [{guard: late, stops: always, clearance_at_stop: {min: 1 mm}}]\n"
    result = run_case(CaseOrder(scenario(guards, motion=motion, more=more), tmp_path, rrd=False), lambda a, b: None)
    assert [outcome.passed for outcome in result.outcomes] == [True, False]
    (stop,) = result.guards
    assert stop["clearance_at_stop"] == 0.0
    gap = 0.94 - 0.3 * stop["trigger"]
    assert stop["contact_speed"]["cart"] == pytest.approx(np.sqrt(0.09 - 0.6 * gap), rel=1e-4)
    assert "contact at" in result.outcomes[1].detail


def test_sweeps_over_guards(tmp_path: Path) -> None:
    path = tmp_path / "cart.yaml"
    path.write_bytes(
        sources(more="sweep: {grid: {guards.stop.reaction: [0 ms, 100 ms]}}\n", duration="4 s")["cart.yaml"]
    )
    fast, slow = load_cases(path)
    assert slow.name == "cart[reaction=100ms]"
    ends = [columns(made)["positions"][-1, 0] for made in (fast, slow)]
    assert ends[1] - ends[0] == pytest.approx(0.03, rel=1e-9)


def test_recordings_with_guards_are_the_same_bytes_whatever_the_number_of_workers(tmp_path: Path) -> None:
    grid = "sweep: {grid: {guards.stop.reaction: [0 ms, 100 ms], sensors.distance.tip.signal.noise.seed: [1, 2]}}\n"
    path = tmp_path / "cart.yaml"
    path.write_bytes(sources(SEVERAL, signal=NOISE, duration="4 s", more=grid)["cart.yaml"])
    cases = load_cases(path)
    recordings = []
    for workers in (1, 2):
        folder = tmp_path / str(workers)
        assert run_all(cases, folder, rrd=False, execution=Execution(workers=workers)).passed
        recordings.append([(folder / made.name / f"{made.name}.mcap").read_bytes() for made in cases])
    assert recordings[0] == recordings[1]
    assert len(set(recordings[0])) == 4


def test_the_protective_separation_follows_the_speed() -> None:
    def first(when: str, place: float) -> tuple[float, float]:
        asked = f"separation: {{method: iso13855, K: 0.4 m/s, C: 0.1 m, {when}}}"
        guards = f"  far: {{when: {{{asked}}}, for: 50 ms, reaction: 0.1 s, stop: [cart]}}\n"
        found = columns(scenario(guards))
        frame = int(np.argmax(found["guards.state"][:, 0] > 0))
        return place - found["positions"][frame - 3, 0], place - found["positions"][frame - 4, 0]

    wanted = 0.4 * (0.05 + 1.0 / 60.0 + 0.1 + 0.3 / 1.0) + 0.1
    for when, place in (("distance: tip", 0.93), ("pair: [cart, wall]", 0.94)):
        near, far = first(when, place)
        assert near < wanted <= far


STILL = """version: 1
name: still
rate: 60 Hz
duration: 0.1 s
links:
  wall: {{pose: {{xyz: [1, 0, 0]}}, shapes: {{slab: {{type: cuboid, size: [2 cm, 1, 1]}}}}}}
  cart:
    joint: {{type: prismatic, axis: [1, 0, 0], velocity: 0.3, acceleration: 1}}
sensors:
  distance:
    tip:
      link: cart
      pose: {{xyz: [6 cm, 0, 0], rpy: [0, 90 deg, 0]}}
      aperture: 20 deg
      range: 2
      signal: {{noise: {{std: 2 mm, seed: 0}}}}
guards:
  stop: {{when: {{distance: tip, below: {below}}}, stop: [cart]}}
sweep: {{grid: {{sensors.distance.tip.signal.noise.seed: {{from: 1, count: {count}}}}}}}
"""


@pytest.mark.parametrize(
    ("deviations", "count"), [(1.5, 200), pytest.param(3.0, 10_000, marks=pytest.mark.soak)], ids=["200", "10000"]
)
def test_sweeps_over_seeds_stop_without_need_as_often_as_chance_says(
    tmp_path: Path, deviations: float, count: int
) -> None:
    path = tmp_path / "still.yaml"
    path.write_text(STILL.format(below=0.93 - deviations * 2e-3, count=count))
    frames = 7
    stopped = sum(any(block.guards.state.any() for block in replay.simulate(made)) for made in load_cases(path))
    chance = 1.0 - (1.0 - stats.norm.cdf(-deviations)) ** frames
    low, high = stats.binom.ppf([1e-4, 1.0 - 1e-4], count, chance)
    assert low <= stopped <= high
