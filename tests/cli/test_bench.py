"""`replay bench`."""

import json

from replay.bench import distance
from replay.bench.goals import Goal
from replay.bench.report import Report
from replay.cli.exit_codes import ExitCode
from replay.cli.main import run


def test_writes_reports_and_says_what_is_missed(tmp_path, monkeypatch, capsys):
    def small(*, quick):
        assert quick
        return Report("distance", goals=[Goal("cone.speed", 2.0)])

    monkeypatch.setattr(distance, "run", small)
    assert run(["bench", "distance", "--quick", "-o", str(tmp_path)]) == ExitCode.DIFFERENT
    assert "missed" in capsys.readouterr().out
    assert json.loads((tmp_path / "bench.json").read_text())["goals"][0]["verdict"] == "missed"
    assert (tmp_path / "bench.html").exists()


def test_an_unknown_benchmark_is_a_usage_error(capsys):
    assert run(["bench", "speed"]) == ExitCode.INVALID
    assert "collision" in capsys.readouterr().err
