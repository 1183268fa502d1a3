"""A first scenario: it runs as it is written."""

import json

import pytest

from replay.cli.exit_codes import ExitCode
from replay.cli.main import run


def test_a_new_scenario_is_valid_without_a_note_runs_and_is_never_replaced(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert run(["new", "first"]) is ExitCode.FINE
    assert capsys.readouterr().out.splitlines() == ["first.yaml", "next: replay run first.yaml -o out"]
    assert run(["validate", "first.yaml", "--deep"]) is ExitCode.FINE
    assert "note" not in capsys.readouterr().err
    assert run(["run", "first.yaml", "-o", "out", "--no-rrd"]) is ExitCode.FINE
    result = json.loads((tmp_path / "out" / "first" / "result.json").read_text())
    assert result["status"] == "passed" and result["notes"] == []
    (tmp_path / "first.yaml").write_text("mine")
    assert run(["new", "first"]) is ExitCode.INVALID
    assert "exists" in capsys.readouterr().err and (tmp_path / "first.yaml").read_text() == "mine"
    assert run(["new", "second", "-o", "parts/second.yaml"]) is ExitCode.FINE
    assert run(["validate", "parts/second.yaml"]) is ExitCode.FINE


@pytest.mark.parametrize("name", ["", "a/b", "a: b", "'x'", "{x}", "..", "a b"])
def test_names_that_would_not_stand_in_yaml_or_a_file_are_refused(name, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert run(["new", name]) is ExitCode.INVALID
    assert "is no name for a scenario" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []
