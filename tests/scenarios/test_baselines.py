"""The accepted recordings of the shipped scenarios."""

from pathlib import Path

from replay.batch.baseline import Baseline
from replay.batch.select import load_all

ROOT = Path(__file__).parents[2]
BASELINES = ROOT / "tests" / "baselines"


def test_they_are_those_of_the_shipped_scenarios_and_small():
    assert Baseline(BASELINES).names() == sorted(scenario.name for scenario in load_all([ROOT / "scenarios"]))
    assert sum(file.stat().st_size for file in BASELINES.rglob("*") if file.is_file()) < 5_000_000
