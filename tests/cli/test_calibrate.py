"""`replay calibrate` as a user meets it: from a scenario and a curve to a sensor file that a scenario includes."""

import json
from pathlib import Path

import numpy as np
import pytest

import replay
from replay.cli.exit_codes import ExitCode
from replay.cli.main import run
from replay.scenario.calibration import SensorPath

EPS, STRAY, COUPLING = 4e-12, 3e-12, 10e-12

HEAD = "version: 1\nname: bench\nrate: 10 Hz\nduration: 1 s\n"
SCENE = """
links:
  head: {}
  target:
    pose: {xyz: [0, 0, 5 cm]}
    joint: {name: lift, type: prismatic, lower: 0 cm, upper: 30 cm, initial: 10 cm}
  tray:
    parent: target
    joint: {name: tilt, type: revolute, axis: [1, 0, 0], initial: 20 deg}
    shapes: {plate: {type: plane, size: [20 cm, 10 cm]}}
  lamp: {parent: tray, shapes: {bulb: {type: cube, size: 5 cm, pose: {xyz: [0, 0, 20 cm]}}}}
motion:
  points: {lift: [{time: 0, position: 10 cm}, {time: 1, position: 0 cm}]}
"""
SENSOR = """
sensors:
  capacitive:
    guard:
      link: head
      plates:
        left: {pose: {xyz: [-3 cm, 0, 0]}, size: [5 cm, 10 cm]}
        right: {pose: {xyz: [3 cm, 0, 0], rpy: [0, 10 deg, 0]}, size: [5 cm, 10 cm]}
      coupling: 10 pF
      side: both
      ignore: [lamp*]
"""
LIFTS = np.array([0.0, 1.0, 2.0, 4.0, 7.0, 12.0, 20.0])
"""[cm]"""

TILTS = np.array([-50.0, -20.0, 0.0, 30.0, 60.0])
"""[deg]"""


@pytest.fixture(scope="module")
def scenario(tmp_path_factory):
    path = tmp_path_factory.mktemp("bench") / "bench.yaml"
    path.write_text(HEAD + SCENE + SENSOR)
    return path


@pytest.fixture(scope="module")
def capacitance(scenario):
    """What a sensor of this model with the constants above reads [F], by joint."""
    loaded = replay.load(scenario)
    return {
        "lift": EPS * SensorPath(loaded).integral(LIFTS / 100) + STRAY,
        "tilt": EPS * SensorPath(loaded, joint="tilt").integral(np.deg2rad(TILTS)) + STRAY,
    }


def write(path, header, x, y):
    path.write_text(header + "\n" + "".join(f"{a!r},{b!r}\n" for a, b in zip(x.tolist(), y.tolist(), strict=True)))
    return path


@pytest.fixture
def delta_curve(tmp_path, capacitance):
    c = capacitance["lift"]
    return write(tmp_path / "delta.csv", "distance_cm,delta_output_mV", LIFTS, 2500 * c / (COUPLING + c))


def calibrate(scenario, curve, *options):
    output = curve.parent / "sensor.yaml"
    code = run(["calibrate", str(scenario), "--curve", str(curve), "-o", str(output), "--format", "json", *options])
    return code, output


def constants(capsys):
    return {entry["name"]: entry for entry in json.loads(capsys.readouterr().out)["estimates"]}


def test_a_delta_output_gives_back_the_constants_and_a_sensor_that_reads_so(
    scenario, delta_curve, capacitance, tmp_path, capsys
):
    code, output = calibrate(scenario, delta_curve, "--offset")
    assert code is ExitCode.FINE
    found = constants(capsys)
    assert found["permittivity"]["value"] == pytest.approx(EPS, rel=1e-8)
    assert found["stray_capacitance"]["value"] == pytest.approx(STRAY, rel=1e-8)
    assert found["coupling"]["interval"] is None
    assert output.with_suffix(".png").read_bytes().startswith(b"\x89PNG")

    calibrated = tmp_path / "calibrated.yaml"
    calibrated.write_text(HEAD + "include: [sensor.yaml]\n" + SCENE)
    assert run(["validate", str(calibrated)]) is ExitCode.FINE
    loaded = replay.load(calibrated)
    own, included = (replay.load(path).sensors.capacitive["guard"] for path in (scenario, calibrated))
    changed = {"permittivity", "stray_capacitance"}
    assert included.model_dump(exclude=changed) == own.model_dump(exclude=changed)
    (block,) = replay.simulate(loaded)
    at_start, at_end = (float(capacitance["lift"][index]) for index in (0, 3))
    assert block.capacitive.capacitance[-1, 0] == pytest.approx(at_start, rel=1e-8)
    assert block.capacitive.capacitance[6, 0] == pytest.approx(at_end, rel=1e-8)  # 4 cm
    np.testing.assert_allclose(
        block.capacitive.capacitance[:, 0], block.capacitive.per_object[:, 0].sum(axis=-1) + STRAY, rtol=1e-8
    )


def test_a_capacitance_over_an_angle(scenario, capacitance, tmp_path, capsys):
    curve = write(tmp_path / "c.csv", "tilt [deg],sensed [pF]", TILTS, capacitance["tilt"] / 1e-12)
    code, _ = calibrate(scenario, curve, "--joint", "tilt", "--offset")
    assert code is ExitCode.FINE
    found = constants(capsys)
    assert found["permittivity"]["value"] == pytest.approx(EPS, rel=1e-8)
    assert found["stray_capacitance"]["value"] == pytest.approx(STRAY, rel=1e-8)


def test_an_absolute_capacitance_finds_the_coupling(scenario, delta_curve, capacitance, capsys):
    seen = f"{capacitance['lift'][4] / 1e-12!r} pF".replace("np.float64(", "").replace(")", "")
    code, _ = calibrate(scenario, delta_curve, "--offset", "--coupling", "fit", "--capacitance-at", "7 cm", seen)
    assert code is ExitCode.FINE
    found = constants(capsys)
    assert found["coupling"]["value"] == pytest.approx(COUPLING, rel=1e-8)
    assert found["permittivity"]["value"] == pytest.approx(EPS, rel=1e-8)


def test_the_report_says_what_was_fitted_and_each_residual(scenario, delta_curve, capsys):
    output = delta_curve.parent / "s.yaml"
    arguments = ["calibrate", str(scenario), "--curve", str(delta_curve), "--coupling", "12 pF", "-o", str(output)]
    assert run(arguments) is ExitCode.FINE
    text = capsys.readouterr().out
    assert "fitted quantity: delta_output (delta_output_mV of delta.csv, 7 points)" in text
    assert "95% confidence intervals" in text
    assert "residuals: rms" in text
    assert len([line for line in text.splitlines() if line.strip().startswith(("0 ", "20 "))]) == 2
    assert "number of this fit, not of a material" in text
    assert "Fitted quantity: delta_output" in output.read_text()


def test_files_are_not_overwritten_unless_asked(scenario, delta_curve, capsys):
    _, output = calibrate(scenario, delta_curve)
    before = output.read_bytes()
    assert calibrate(scenario, delta_curve, "--offset")[0] is ExitCode.INVALID
    assert output.read_bytes() == before
    assert "pass --overwrite" in capsys.readouterr().err
    assert calibrate(scenario, delta_curve, "--offset", "--overwrite")[0] is ExitCode.FINE


REFUSED = {
    "both from a delta output": (["--coupling", "fit"], None, "shows permittivity / coupling only, never both"),
    "stated and fitted": (
        ["--coupling", "1 pF", "--capacitance-at", "1 cm", "2 pF"],
        None,
        "both fix the coupling; keep one",
    ),
    "coupling from a capacitance": (["--coupling", "fit"], "d_cm,c_pF\n1,5\n2,4\n", "does not show the coupling"),
    "offset with a constant curve": (
        ["--offset", "--joint", "tilt"],
        "a_deg,c_pF\n0,5\n1e-9,5\n2e-9,5\n",
        "cannot tell",
    ),
    "fewer points than parameters": (["--offset"], "d_cm,c_pF\n1,5\n", "1 point(s) cannot determine 2 parameters"),
    "unknown sensor": (["--sensor", "none"], None, "--sensor = none: is not there; the scenario has guard"),
    "unknown joint": (["--joint", "none"], None, "--joint = none: is not there; the scenario has lift, tilt"),
    "an angle for a length": ([], "d_deg,c_pF\n1,5\n2,4\n", "'d_deg' is an angle where a length belongs"),
    "no unit": ([], "d,c_pF\n1,5\n2,4\n", "'d' does not end in a unit that is known; call it d_m or d_cm"),
    "unknown unit": ([], "d_cm,c_nC\n1,5\n2,4\n", "'c_nC' does not say what was measured"),
    "a voltage that may be the output": ([], "d_cm,output_V\n1,.5\n2,.4\n", "the supply minus the output voltage"),
    "a voltage as capacitance": (["--quantity", "capacitance"], None, "is a voltage where a capacitance belongs"),
    "outside the joint": ([], "d_cm,c_pF\n1,5\n31,4\n", "curve.csv:3: 0.31 m is outside joint 'lift': 0 .. 0.3 m"),
    "bad coupling": (["--coupling", "10 cm"], None, "--coupling = 10 cm: is a length where a capacitance belongs"),
    "bad absolute": (["--capacitance-at", "7", "2 pF"], None, "--capacitance-at = 7: is a text without a unit"),
    "above the supply": ([], "d_cm,delta_V\n1,2.6\n2,1\n", "2.6 V is not below the supply of 2.5 V"),
    "unsorted": ([], "d_cm,c_pF\n2,4\n1,5\n", "curve.csv:3: d_cm = 1 comes after 2"),
    "filter": (["--where", "d_cm"], "d_cm,c_pF\n1,5\n", "is not COLUMN=VALUE"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_be_done_is_one_clear_line_and_exit_code_2(name, scenario, delta_curve, capsys):
    options, content, message = REFUSED[name]
    curve = delta_curve
    if content is not None:
        curve = delta_curve.with_name("curve.csv")
        curve.write_text(content)
    code, output = calibrate(scenario, curve, *options)
    error = capsys.readouterr().err
    assert code is ExitCode.INVALID
    assert message in error
    assert len([line for line in error.splitlines() if "error" in line.lower()]) == 1
    assert not output.exists()


def test_a_point_in_contact_is_refused(tmp_path, capsys):
    path = tmp_path / "bench.yaml"
    path.write_text(HEAD + (SCENE + SENSOR).replace("xyz: [0, 0, 5 cm]", "xyz: [0, 0, 0]").replace("20 deg", "0 deg"))
    curve = tmp_path / "curve.csv"
    curve.write_text("d_cm,c_pF\n0,5\n1,4\n")
    assert calibrate(path, curve)[0] is ExitCode.INVALID
    assert "curve.csv:2: the sensor is in contact there" in capsys.readouterr().err


def test_a_scenario_without_a_sensor_or_with_two(tmp_path, delta_curve, capsys):
    path = tmp_path / "bench.yaml"
    path.write_text(HEAD + SCENE)
    assert calibrate(path, delta_curve)[0] is ExitCode.INVALID
    assert "the scenario has no sensor that could be used" in capsys.readouterr().err
    second = "    other: {link: head, plates: {only: {size: [1 cm, 1 cm]}}, coupling: 1 pF}\n"
    path.write_text(HEAD + SCENE + SENSOR + second)
    assert calibrate(path, delta_curve)[0] is ExitCode.INVALID
    assert "say which: guard, other" in capsys.readouterr().err


def test_the_shipped_example(tmp_path, capsys):
    folder = Path(__file__).parents[2] / "scenarios" / "experiments"
    arguments = [
        "calibrate",
        str(folder / "parallel_20cm.yaml"),
        "--curve",
        str(folder / "data" / "parallel_plate_curves.csv"),
        *("--x", "distance_cm", "--y", "self_capacitance_pF", "--sensor", "plate_4x20", "--offset"),
        *("--where", "sensor_x_cm=4", "--where", "grounded_back_plate_cm=", "--where", "target_side_cm=20"),
    ]
    assert run([*arguments, "-o", str(tmp_path / "sensor.yaml")]) is ExitCode.FINE
    assert "capacitance (self_capacitance_pF of parallel_plate_curves.csv, 7 points)" in capsys.readouterr().out
