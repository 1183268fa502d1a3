"""Nights of a scenario that names a log of the machine: verdict, numbers, history."""

import json

import pyarrow.parquet as pq
import pytest

from replay.cli.exit_codes import ExitCode
from replay.cli.main import run
from tests.comparison.measured import machine


@pytest.fixture(scope="module")
def nights(tmp_path_factory):
    """A folder of one scenario, its baseline, and what each of three nights said: fine, off, and without a clock."""
    folder = tmp_path_factory.mktemp("nights")
    scenarios = folder / "scenarios"
    scenarios.mkdir()
    machine.csv_log(scenarios / "run.csv")
    text = f"{machine.SCENARIO}measured:\n  file: run.csv{machine.OF_CSV}"
    (scenarios / "swing.yaml").write_text(text)
    (scenarios / "rules.yaml").write_text(machine.RULES)
    told = {}

    def night(name, *options):
        arguments = [str(scenarios), "--baseline", str(folder / "baseline"), "-o", str(folder / name), "--rrd", "none"]
        told[name] = run(["regress", *arguments, "--history", str(folder / "history.jsonl"), *options])

    night("fine", "--missing-baseline", "create")
    machine.csv_log(scenarios / "run.csv", scale=1.05)
    night("off")
    (scenarios / "run.csv").write_text(
        "t_ms;d1_mm;angle [deg];near\n" + "".join(f"{t};900;0;true\n" for t in range(900))
    )
    night("still")
    return folder, told


def verdict(folder, night):
    return json.loads((folder / night / "run.json").read_text())["verdicts"]["swing"]


def test_a_machine_that_says_the_same_is_fine(nights):
    folder, told = nights
    assert told["fine"] is ExitCode.FINE
    assert verdict(folder, "fine")["verdict"] == "created"


def test_further_from_reality_is_different_although_the_baseline_is_the_same(nights):
    folder, told = nights
    assert told["off"] is ExitCode.DIFFERENT
    assert verdict(folder, "off")["message"].startswith("beside the machine: measured ")
    assert verdict(folder, "off")["finding"]["effects"][0]["subject"] == "/distance/tip/distance"
    assert "best fit: measured = 1.05" in (folder / "off" / "junit.xml").read_text()


def test_a_log_that_cannot_be_placed_is_a_failure(nights):
    folder, told = nights
    assert told["still"] is ExitCode.FAILED
    assert "offset cannot be estimated" in verdict(folder, "still")["message"]


def test_the_distance_from_reality_is_among_the_numbers_of_the_night(nights, capsys):
    folder, _ = nights
    rows = {row["name"]: row["value"] for row in pq.read_table(folder / "off" / "metrics.parquet").to_pylist()}
    assert rows["measured.offset"] == pytest.approx(machine.OFFSET, abs=2e-3)
    assert rows["measured.distance.tip.distance.rms"] > 0.04
    history = str(folder / "history.jsonl")
    assert run(["trend", "--history", history, "--metric", "measured.distance.*.rms"]) is ExitCode.FINE
    assert "measured.distance.tip.distance.rms" in capsys.readouterr().out
