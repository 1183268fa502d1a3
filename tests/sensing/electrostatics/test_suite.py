"""Capacitive sensors of scenarios by electrostatics."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import replay
from replay.errors import ReplayError
from replay.scenario.notes import notes
from replay.sensing.capacitive.columns import CapacitiveColumns
from replay.sensing.capacitive.part import CapacitiveMethod
from replay.sensing.electrostatics import bem, unit

SCENARIO = """
version: 1
name: plate
rate: 20 Hz
duration: {duration}
links:
  sensor:
    shapes:
      sheet: {{type: plane, size: [14 cm, 12 cm], pose: {{xyz: [0, 0, -5 mm]}}}}
  target:
    earth: {earth}
    joint: {{name: distance, type: prismatic, lower: -20 cm, upper: 50 cm}}
    shapes:
      ball: {{type: sphere, radius: 3 cm, chord_error: 2 mm, pose: {{xyz: [-3 cm, 0, 3 cm]}}}}
      plate: {{type: plane, size: [2 cm, 2 cm], pose: {{xyz: [-3 cm, 0, 9 cm]}}}}
motion:
  points:
    distance: {points}
sensors:
  capacitive:
    left: {{link: sensor, plates: {{a: {{size: [0.04, 0.04], pose: {{xyz: [-0.03, 0, 0]}}}}}}, coupling: 1e-11, {own}}}
    right: {{link: sensor, plates: {{a: {{size: [4 cm, 4 cm], pose: {{xyz: [0.03, 0, 0]}}}}}}, coupling: 10 pF{other}}}
model: {{capacitive: {{method: {method}{model}}}}}
"""


METHOD = "bem"


@pytest.fixture(autouse=True, params=["bem", "field"])
def coarse_meshes(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Both methods; what is asked here is not how exact a reading is."""
    monkeypatch.setitem(globals(), "METHOD", request.param)
    monkeypatch.setattr(bem, "LEVELS", (3.0, 2.1, 1.5))
    monkeypatch.setattr(unit, "FINENESSES", (2.0, 1.4))


def write(folder: Path, **given: str) -> Path:
    values = {
        "duration": "0 s",
        "earth": "grounded",
        "points": "[{time: 0 s, position: 5 cm}]",
        "sensor": "back: [sheet]",
        "other": "",
        "model": "",
    } | given
    path = folder / "plate.yaml"
    path.write_text(SCENARIO.format(own=values.pop("sensor"), method=METHOD, **values))
    return path


def read(folder: Path, *, savings: bool = True, **given: str) -> CapacitiveColumns:
    (block,) = replay.simulate(replay.load(write(folder, **given)), savings=savings)
    found: CapacitiveColumns = block.capacitive
    assert found.increase is not None and found.error is not None and found.unresolved is not None
    return found


def test_a_reading_is_the_sensor_alone_and_what_bodies_add_which_is_the_sum_of_their_shares(tmp_path: Path) -> None:
    given = {"sensor": "stray_capacitance: 3 pF, back: [sheet]"}
    found, floating = read(tmp_path, **given), read(tmp_path, earth="floating", **given)
    assert found.increase is not None and floating.increase is not None and found.error is not None
    assert found.per_object[0].sum(axis=1) == pytest.approx(found.increase[0], rel=1e-9)
    assert found.increase[0, 0] > 2.0 * found.increase[0, 1] > 0.0
    assert (found.error < {"bem": 0.02, "field": 0.03}[METHOD] * found.increase).all()
    assert (floating.increase < found.increase).all()
    alone = found.capacitance - found.increase
    assert alone == pytest.approx(floating.capacitance - floating.increase, rel=1e-12)
    assert alone[0, 0] - alone[0, 1] == pytest.approx(3e-12, rel=1e-2)  # two plates alike, one with what is stray
    assert not (found.saturated | found.touching | found.unresolved).any()


def test_a_driven_back_is_a_guard_and_takes_the_load_off(tmp_path: Path) -> None:
    grounded = read(tmp_path)
    driven = read(tmp_path, sensor="back: [sheet], driven: true", other=", driven: true")
    assert (driven.capacitance < 0.6 * grounded.capacitance).all()
    assert (driven.increase > grounded.increase).all()
    together = read(tmp_path, sensor="back: [sheet], driven: true", other=", driven: true", model=", drive: together")
    assert (together.capacitance == driven.capacitance).all()
    assert (together.output_voltage > driven.output_voltage).all()


def test_the_voltages_are_those_of_the_network(tmp_path: Path) -> None:
    """Two sensors alike in C but for the body; without coupling between them each is a divider by itself."""
    found = read(tmp_path)
    divider = 2.5 * 10.0 / (10.0 + 1e12 * found.capacitance)
    assert found.output_voltage == pytest.approx(divider, rel=2e-2) and (found.output_voltage >= divider).all()
    assert found.delta_output == pytest.approx(2.5 - found.output_voltage)


def test_too_near_is_unresolved_and_contact_saturates_the_sensor_that_is_touched(tmp_path: Path) -> None:
    points = "[{time: 0 s, position: 4 mm}, {time: 0.05 s, position: 1 mm}, {time: 0.1 s, position: -1 cm}]"
    found = read(tmp_path, duration="0.1 s", points=points)
    assert found.unresolved is not None and found.increase is not None and found.error is not None
    assert found.unresolved.tolist() == [[False, False], [True, True], [False, True]]
    assert found.saturated.tolist() == [[False, False], [False, False], [True, False]]
    assert (found.increase[0] < found.increase[1]).all() and (found.increase[1] < 1.5 * found.increase[0]).all()
    assert np.isnan(found.error).tolist() == [[False, False], [True, True], [True, True]]
    assert np.isinf(found.capacitance[2, 0]) and found.output_voltage[2, 0] == 0.0
    assert np.isfinite(found.capacitance[2, 1]) and 0.0 < found.output_voltage[2, 1] < 2.5
    assert found.per_object[2, 0].tolist() == [0.0, np.inf, 0.0]


def test_a_plate_inside_a_body_is_saturated(tmp_path: Path) -> None:
    found = read(tmp_path, points="[{time: 0 s, position: -3 cm}]")
    assert found.saturated[0, 0] and found.touching[0, 0] and not found.saturated[0, 1]


def test_without_a_body_there_is_the_sensor_alone(tmp_path: Path) -> None:
    found = read(tmp_path, sensor="ignore: [target]", other=", ignore: [target]")
    assert found.increase is not None and (found.increase == 0.0).all() and (found.capacitance > 1e-12).all()
    assert (found.per_object == 0.0).all()


def test_poses_that_repeat_are_solved_once_and_read_the_same_without_savings(tmp_path: Path) -> None:
    first = read(tmp_path, duration="0.1 s")
    assert first.increase is not None and (first.increase == first.increase[0]).all()
    again = read(tmp_path, savings=False)
    assert again.increase is not None and (again.increase[0] == first.increase[0]).all()


def test_frames_between_those_that_are_solved_are_within_their_error(tmp_path: Path) -> None:
    points = "[{time: 0 s, position: 12 cm}, {time: 0.8 s, position: 6 cm}, {time: 1 s, position: 6 cm}]"
    found = read(tmp_path, duration="1 s", points=points)
    every = read(tmp_path, duration="1 s", points=points, savings=False)
    assert found.increase is not None and found.error is not None and every.increase is not None
    assert (np.abs(found.increase - every.increase) <= found.error + 5e-3 * every.increase).all()
    assert found.per_object.sum(axis=2) == pytest.approx(found.increase, rel=1e-2)
    assert (found.increase[16:] == found.increase[16]).all()


@pytest.mark.parametrize(
    ("sensor", "other", "rule"),
    [
        ("ignore: [target]", "", r"\.right\.ignore must leave out the same links as of 'left', unlike target"),
        ("back: [sheet], driven: true", "", r"\.right\.driven must be as of 'left'"),
        ("driven: true", ", driven: true", r"\.left\.driven = true drives nothing"),
    ],
)
def test_units_that_make_no_sense_are_refused_with_their_place(
    tmp_path: Path, sensor: str, other: str, rule: str
) -> None:
    with pytest.raises(ReplayError, match=rf"plate\.yaml:\d+:\d+: sensors\.capacitive{rule}"):
        replay.load(write(tmp_path, sensor=sensor, other=other))
    file = write(tmp_path, sensor=sensor, other=other)
    file.write_text(file.read_text().replace(f"method: {METHOD}", "method: tree"))
    scenario = replay.load(file)
    model = scenario.model.model_copy(update={"capacitive": CapacitiveMethod(method=METHOD)})
    with pytest.raises(ReplayError, match=rule):
        list(replay.simulate(scenario, model=model))


@pytest.mark.parametrize(
    ("given", "rule"),
    [
        ({"sensor": "back: [shet]"}, "is no shape of link 'sensor'; did you mean 'sheet'"),
        ({"earth": "ground"}, "is none of grounded, floating"),
        ({"earth": "-1 pF"}, "must be >= 0 F"),
    ],
)
def test_what_is_written_wrong_is_told_with_its_place(tmp_path: Path, given: dict[str, str], rule: str) -> None:
    with pytest.raises(ReplayError, match=rule):
        replay.load(write(tmp_path, **given))


def test_notes_say_what_is_one_unit_and_how_bodies_are_earthed(tmp_path: Path) -> None:
    scenario = replay.load(write(tmp_path, earth="100 pF", sensor="back: [sheet], side: both, stray_capacitance: 1 pF"))
    text = "\n".join(note.message for note in notes(scenario))
    assert "left, right on sensor are one unit with sheet behind its plates; it feels target (100 pF to earth)" in text
    assert "sensors.capacitive.left.side" in text and "sensors.capacitive.left.stray_capacitance" in text
    assert not notes(scenario, model=type(scenario.model)())


def test_a_recording_has_the_columns_and_one_of_another_method_has_not(tmp_path: Path) -> None:
    scenario = replay.load(write(tmp_path))
    columns: dict[str, Any] = {}
    for name, model in (("own", None), ("tree", type(scenario.model)())):
        recorded = replay.record(scenario, tmp_path / name, model=model, rrd=False)
        columns[name] = replay.read(recorded.mcap).capacitive
    assert columns["own"].increase.shape == (1, 2) and not columns["own"].unresolved.any()
    assert columns["tree"].increase is None and columns["tree"].unresolved is None
    difference = replay.diff(tmp_path / "tree" / "plate.mcap", tmp_path / "own" / "plate.mcap")
    assert difference.verdict.name == "DIFFERENT"


def test_a_curve_of_the_sensor_itself_is_calibrated_to_the_vacuum_and_its_stray_capacitance(tmp_path: Path) -> None:
    from replay.scenario.calibration import SensorPath
    from replay.sensing.calibration import calibrate

    points = "[{time: 0 s, position: 12 cm}, {time: 0.1 s, position: 6 cm}]"
    path = SensorPath(replay.load(write(tmp_path, duration="0.1 s", points=points)), sensor="left")
    found = path.integral([0.12, 0.09, 0.06])
    reading = read(tmp_path, sensor="stray_capacitance: 3 pF, back: [sheet]", duration="0.1 s", points=points)
    measured = reading.capacitance[:, 0]
    fit = calibrate(found, measured, quantity="capacitance", coupling=1e-11, offset=True)
    assert fit.permittivity == pytest.approx(8.8541878e-12, rel=1e-3)
    assert fit.stray_capacitance == pytest.approx(3e-12, rel=1e-2)
