"""What `make regress` says of a clean checkout."""

from pathlib import Path

import pytest

import replay
from replay.batch.baseline import Baseline
from replay.batch.select import load_all
from replay.cli.exit_codes import ExitCode
from replay.cli.main import run

pytestmark = pytest.mark.compiled  # phantoms of thousands of triangles

ROOT = Path(replay.__file__).parents[1]
BASELINES = ROOT / "tests" / "baselines"


def test_all_shipped_scenarios_are_as_accepted(tmp_path, capsys):
    options = ["--baseline", str(BASELINES), "-o", str(tmp_path)]
    assert run(["regress", str(ROOT / "scenarios"), *options]) is ExitCode.FINE, capsys.readouterr().out


def test_baselines_are_those_of_the_shipped_scenarios_and_small():
    assert Baseline(BASELINES).names() == sorted(scenario.name for scenario in load_all([ROOT / "scenarios"]))
    assert sum(file.stat().st_size for file in BASELINES.rglob("*") if file.is_file()) < 5_000_000
