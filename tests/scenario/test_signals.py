"""Signal chains of a scenario: what is refused, and that `measured` goes through recordings, tables and differences."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import replay
from replay import simulation
from replay.errors import ScenarioError
from replay.logs.mcap_reader import McapLog
from replay.recording.export import tables
from replay.scenario.load import load_cases, load_sources

TEXT = """version: 1
name: approach
rate: 60 Hz
duration: 1.5 s
links:
  wall: {{pose: {{xyz: [1, 0, 0]}}, shapes: {{slab: {{type: cuboid, size: [2 cm, 1, 1]}}}}}}
  cart:
    joint: {{type: prismatic, axis: [1, 0, 0], lower: 0, upper: 2, velocity: 1, acceleration: 4}}
    shapes: {{box: {{type: cube, size: 10 cm}}}}
motion: {{moves: [{{to: {{cart: 0.6}}}}]}}
sensors:
  distance:
    bare: {{link: cart, pose: &front {{xyz: [6 cm, 0, 0], rpy: [0, 90 deg, 0]}}, aperture: 20 deg, range: 0.8}}
    tip: {{link: cart, pose: *front, aperture: 20 deg, range: 0.8{tip}}}
  capacitive:
    pad: {{link: cart, plates: {{a: {{pose: *front, size: [5 cm, 5 cm]}}}}, coupling: 1 pF{pad}}}
{more}"""
SIGNAL = ", signal: {rate: 20 Hz, noise: {std: 1 mm, seed: 3}, dropout: 5 %, delay: 0.1 s, low_pass: 10 Hz}"


def scenario(tip: str = SIGNAL, pad: str = "", more: str = "") -> replay.Scenario:
    return load_sources("approach.yaml", {"approach.yaml": TEXT.format(tip=tip, pad=pad, more=more).encode()})


def joined(made: replay.Scenario, kind: str, column: str) -> np.ndarray:
    return np.concatenate([getattr(block.readings[kind], column) for block in replay.simulate(made)])


@pytest.mark.parametrize("frames", [1, 7])
def test_blocks_do_not_matter(monkeypatch: pytest.MonkeyPatch, frames: int) -> None:
    whole = joined(scenario(), "distance", "measured")
    monkeypatch.setattr(simulation, "BLOCK_FRAMES", frames)
    assert joined(scenario(), "distance", "measured").tobytes() == whole.tobytes()
    made = simulation.Simulation(replay.scenario.scene.build(scenario()))
    alone = made.block(12 * frames)  # asked for without those before it
    assert alone.distance.measured.tobytes() == whole[alone.first : alone.first + len(alone.time)].tobytes()


def test_a_signal_changes_no_reading_and_costs_others_nothing(tmp_path: Path) -> None:
    with_it, without = (scenario(tip) for tip in (SIGNAL, ""))
    for column in ("distance", "status", "point"):
        assert joined(with_it, "distance", column).tobytes() == joined(without, "distance", column).tobytes()
    assert next(replay.simulate(without)).distance.measured is None
    assert next(replay.simulate(with_it)).capacitive.measured is None
    a, b = (replay.record(made, tmp_path / name, rrd=False).mcap for made, name in ((with_it, "a"), (without, "b")))
    with McapLog(a) as log_a, McapLog(b) as log_b:
        same = replay.comparison.log_changes.equal_topics(log_a, log_b)
    assert {"/distance/bare", "/capacitive/pad", "/collision", "/joint_states"} <= same
    assert "/distance/tip" not in same


def test_what_is_measured_is_read_back_told_in_tables_and_compared(tmp_path: Path) -> None:
    pad = ", signal: {noise: {std: 2 mV, seed: SEED}}"
    first, second = (
        replay.record(scenario(pad=pad.replace("SEED", seed)), tmp_path / seed).mcap for seed in ("1", "2")
    )
    recording = replay.read(first)
    assert recording.layout.signals == {"distance": ("tip",), "capacitive": ("pad",)}
    told = joined(scenario(pad=pad.replace("SEED", "1")), "distance", "measured")
    assert recording.distance.measured.tobytes() == told.tobytes()
    assert np.isnan(told[:, 0]).all(), "bare has no signal"
    assert (~np.isnan(told[6:, 1])).sum() > 60
    found = tables(recording)
    assert "measured [m]" in found["/distance/tip"]
    assert "measured [m]" not in found["/distance/bare"]
    assert found["/capacitive/pad"]["measured [V]"].std() > 0.0
    only = replay.read(first, topics=["/distance/bare"])
    assert only.distance.measured is None
    difference = replay.diff(first, second)
    assert {item.signal.full_name for item in difference.signals} == {"/capacitive/pad/measured"}
    again = load_sources(recording.provenance.root, recording.files)
    assert replay.record(again, tmp_path / "again", rrd=False).mcap.read_bytes() == first.read_bytes()


def test_a_sensor_that_got_a_signal_is_told_and_one_that_lost_it_decides(tmp_path: Path) -> None:
    paths = [replay.record(scenario(tip), tmp_path / str(k), rrd=False).mcap for k, tip in enumerate(("", SIGNAL))]
    gained, lost = replay.diff(*paths), replay.diff(*reversed(paths))
    assert [absence.name for absence in lost.missing] == ["measured"]
    assert not gained.signals
    assert not gained.missing


def test_expectations_on_what_is_measured(tmp_path: Path) -> None:
    made = scenario(more="expect: [{distance: tip, measured: {min: 30 cm, max: 79 cm}}]\n")
    check = replay.scenario.scene.build(made).expectation_check()
    for block in replay.simulate(made):
        check.update(block.time, block.collision, block.readings)
    told = joined(made, "distance", "measured")[:, 1]
    outcomes = check.finish()
    assert [outcome.passed for outcome in outcomes] == [bool(np.nanmin(told) >= 0.3), bool(np.nanmax(told) <= 0.79)]
    assert f"{np.nanmin(told):.6g} m" in outcomes[0].detail


@pytest.mark.parametrize(
    ("tip", "more", "wanted"),
    [
        (
            ", signal: {rate: 45 Hz}",
            "",
            "signal.rate = '45 Hz' must divide the scenario's rate, 60 Hz; the nearest is '60 Hz'",
        ),
        (", signal: {rate: 35 Hz}", "", "the nearest is '30 Hz'"),
        (", signal: {delay: 20 ms}", "", "whole number of samples, which are 1/60 s apart; the nearest is '1/60 s'"),
        (", signal: {rate: 20 Hz, delay: 0.12 s}", "", "1/20 s apart; the nearest is '1/10 s'"),
        (", signal: {noise: {std: 1 mV}}", "", "is a voltage where a length belongs"),
        (
            ", signal: {dropout: 5 mm}",
            "",
            "is a length where a share belongs; write a number [-] or text such as '5 %'",
        ),
        (", signal: {range: [1, 50 cm]}", "", "must be above the lower end, 1"),
        (", signal: {quantisation: {bits: 8}}", "", "needs a range beside it"),
        (", signal: {quantisation: {}}", "", "needs either step or bits"),
        ("", "expect: [{distance: tip, measured: {max: 1}}]\n", "is measured by no signal chain"),
    ],
)
def test_what_cannot_be_is_refused_with_what_works(tip: str, more: str, wanted: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        scenario(tip, more=more)
    assert wanted in str(caught.value)
    assert "approach.yaml:" in str(caught.value)


def test_a_filter_needs_something_to_take_while_nothing_is_detected() -> None:
    text = TEXT.format(tip=", signal: {low_pass: 3 Hz}", pad="", more="").replace("range: 0.8", "range: .inf")
    with pytest.raises(ScenarioError, match="needs a finite range of the sensor"):
        load_sources("approach.yaml", {"approach.yaml": text.encode()})


def test_grids_count(tmp_path: Path) -> None:
    path = tmp_path / "approach.yaml"
    grid = 'sweep: {grid: {"sensors.distance.tip.signal.noise.seed": {from: 5, count: 1000}}}\n'
    path.write_text(TEXT.format(tip=SIGNAL, pad="", more=grid))
    cases = load_cases(path)
    assert len(cases) == 1000
    assert cases[0].name == "approach[seed=5]"
    assert cases[999].sensors.distance["tip"].signal.noise.seed == 1004
    path.write_text(path.read_text().replace("count: 1000", "count: 10001"))
    with pytest.raises(ScenarioError, match="makes 10001 cases; at most 10000 are run"):
        load_cases(path)
