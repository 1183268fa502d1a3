"""`replay compare`: exit codes, a scenario that is run, a recording that is not, a log beside both."""

import json

import pytest

from replay.cli.exit_codes import ExitCode
from replay.cli.main import run
from tests.comparison.measured.conftest import swing  # noqa: F401


@pytest.fixture
def machine_folder(swing):  # noqa: F811
    return swing


def test_a_recording_is_compared_with_what_is_attached(machine_folder, capsys):
    recording, rules = machine_folder / "run" / "swing.mcap", machine_folder / "tolerances.yaml"
    assert run(["compare", str(recording), "--rules", str(rules)]) is ExitCode.FINE
    told = capsys.readouterr().out
    assert "same: swing: all 3 signals within the rules, measured by run.csv" in told
    assert "clock: offset -1.25" in told or "clock: offset -1.24" in told
    assert run(["compare", str(recording)]) is ExitCode.DIFFERENT


def test_a_scenario_is_run_and_the_recording_kept_on_request(machine_folder, tmp_path, capsys):
    arguments = [str(machine_folder / "swing.yaml"), "--rules", str(machine_folder / "tolerances.yaml")]
    assert run(["compare", *arguments, "-o", str(tmp_path / "kept"), "--format", "json"]) is ExitCode.FINE
    told = json.loads(capsys.readouterr().out)
    assert told[0]["verdict"] == "same"
    assert told[0]["clocks"][0]["estimate"]["confidence"] == 0.95
    assert (tmp_path / "kept" / "swing" / "swing.mcap").read_bytes() == (
        machine_folder / "run" / "swing.mcap"
    ).read_bytes()


def test_another_log_beside_a_scenario_that_names_none(machine_folder, tmp_path, capsys):
    recording, log = machine_folder / "run" / "swing.mcap", machine_folder / "run.mcap"
    mapping, rules = machine_folder / "mcap_map.yaml", machine_folder / "tolerances.yaml"
    arguments = ["--measured", str(log), "--map", str(mapping), "--rules", str(rules)]
    assert run(["compare", str(recording), *arguments]) is ExitCode.FINE
    assert "measured by run.mcap" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "rule"),
    [
        (["plain.yaml"], "names no log of the machine"),
        (["plain.yaml", "--measured", "run.csv"], "needs --map"),
        (["swing.yaml", "--map", "csv_map.yaml"], "name the log with --measured"),
        (["swing.yaml", "--measured", "gone.csv"], "does not exist"),
        (["swing.yaml", "--measured", "run.csv", "--map", "plain.yaml"], "signals is missing"),
        (["swing.yaml", "--measured", "run.mcap", "--map", "csv_map.yaml"], "has no effect with"),
        (["run/swing.mcap", "--model", "thesis2015"], "is a recording, which is not run again"),
        (["swing.yaml", "--measured", "tolerances.yaml"], "is neither a .mcap nor a .csv file"),
    ],
)
def test_what_cannot_be_compared_is_one_line(machine_folder, capsys, arguments, rule):
    paths = [a if a.startswith("--") or "." not in a else str(machine_folder / a) for a in arguments]
    assert run(["compare", *paths]) is ExitCode.INVALID
    told = capsys.readouterr().err.strip().splitlines()
    assert rule in told[0]
    assert len(told) == 1 or "--map" in arguments
