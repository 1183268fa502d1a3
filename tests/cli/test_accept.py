"""How the results of a run are accepted."""

import json
import re

import pytest

from replay.cli.exit_codes import ExitCode
from replay.cli.main import run
from tests.batch import scenes
from tests.cli.nights import night, prepare, verdicts_of


def test_a_damaged_baseline_is_replaced_by_accepting(tmp_path, capsys):
    prepare(tmp_path, plain=3, bad=0, differing=0)
    for name in ("plain_0", "plain_1"):
        damaged = tmp_path / "base" / name / f"{name}.mcap"
        damaged.write_bytes(damaged.read_bytes()[:-100])
    out = tmp_path / "out"
    assert night(tmp_path, out, "--select", "plain_[02]") is ExitCode.INVALID
    assert verdicts_of(out) == {"plain_0": "unreadable baseline", "plain_1": "skipped", "plain_2": "same"}
    capsys.readouterr()
    assert run(["accept", str(out), "--baseline", str(tmp_path / "base"), "--yes", "--reason", "mended"]) == 0
    assert "plain_0: replaces a baseline that cannot be read: damaged: its end" in capsys.readouterr().out
    assert night(tmp_path, out, "--select", "plain_[02]") is ExitCode.FINE


def test_accepting_shows_refuses_and_logs(tmp_path, capsys):
    scenes.write(tmp_path / "in", "a")
    scenes.write(tmp_path / "in", "b")
    out, base = tmp_path / "out", tmp_path / "base"
    accept = ["accept", str(out), "--baseline", str(base)]
    assert run(["run", str(tmp_path / "in"), "-o", str(out), "--no-rrd"]) is ExitCode.FINE
    assert run([*accept, "--yes", "--reason", "first"]) is ExitCode.FINE
    assert "no --reason" not in capsys.readouterr().err
    assert run([*accept, "--yes"]) is ExitCode.FINE
    assert "0 to be accepted, 2 unchanged" in capsys.readouterr().out
    scenes.write(tmp_path / "in", "a", distance=1.3)
    assert run(["run", str(tmp_path / "in"), "-o", str(out), "--no-rrd", "--overwrite"]) is ExitCode.FINE
    assert run(accept) is ExitCode.INVALID
    assert "nobody to ask" in capsys.readouterr().err
    assert run([*accept, "--yes", "--reason", "the wall was moved"]) is ExitCode.FINE
    assert re.search("^a: .*signals changed", capsys.readouterr().out, re.MULTILINE)
    log = [json.loads(line) for line in (base / "accepted.jsonl").read_text().splitlines()]
    assert [(line["reason"], list(line["scenarios"])) for line in log] == [
        ("first", ["a", "b"]),
        ("the wall was moved", ["a"]),
    ]
    assert night(tmp_path, tmp_path / "night", "--rrd", "none") is ExitCode.FINE
    scenes.write(tmp_path / "in", "b", contact="always")
    assert night(tmp_path, tmp_path / "night", "--rrd", "none") is ExitCode.FAILED
    assert verdicts_of(tmp_path / "night")["b"] == "broken"
    assert run(["accept", str(tmp_path / "night"), "--baseline", str(base), "--yes"]) is ExitCode.INVALID
    assert "did not pass: b (broken)" in capsys.readouterr().err
    summary = json.loads((out / "run.json").read_text())
    (out / "run.json").write_text(json.dumps({**summary, "interrupted": True}))
    assert run([*accept, "--yes"]) is ExitCode.INVALID
    assert "interrupted" in capsys.readouterr().err
    assert run(["accept", str(tmp_path), "--baseline", str(base)]) is ExitCode.INVALID


@pytest.mark.parametrize("changed", ["model", "text", "nothing"])
def test_a_run_of_another_model_or_text_is_accepted_anew_although_it_reads_the_same(tmp_path, capsys, changed):
    path = scenes.write(tmp_path / "in", "a")
    out, base = tmp_path / "out", tmp_path / "base"
    accept = ["accept", str(out), "--baseline", str(base), "--yes", "--reason", "x"]
    command = ["run", str(tmp_path / "in"), "-o", str(out), "--no-rrd"]
    assert run(command) is ExitCode.FINE
    assert run(accept) is ExitCode.FINE
    model = tmp_path / "model.yaml"
    model.write_text("capacitive: {method: tree, rtol: 1e-3}\n")  # nothing there is sensed by it
    if changed == "text":
        path.write_text(path.read_text() + "# as before\n")
    more = ["--model", str(model)] if changed == "model" else []
    assert run([*command, "--overwrite", *more]) is ExitCode.FINE
    capsys.readouterr()
    assert run(accept) is ExitCode.FINE
    counts = "0 to be accepted, 1 unchanged" if changed == "nothing" else "1 to be accepted, 0 unchanged"
    assert counts in capsys.readouterr().out
