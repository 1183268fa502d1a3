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


@pytest.mark.parametrize("written", [None, "", "{", "[]", "{}", '{"scenarios": {"a": {"status": "of no kind"}}}'])
def test_what_is_no_run_folder_is_not_accepted(tmp_path, capsys, written):
    (tmp_path / "out").mkdir()
    if written is not None:
        (tmp_path / "out" / "run.json").write_text(written)
    accept = ["accept", str(tmp_path / "out"), "--baseline", str(tmp_path / "base"), "--yes", "--reason", "x"]
    assert run(accept) is ExitCode.INVALID
    said = capsys.readouterr().err
    assert "is no run folder: it has no run.json of replay" in said and said.count("\n") == 1
    assert not (tmp_path / "base").exists()


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


def changed_night(tmp_path):
    prepare(tmp_path, plain=2, bad=0, differing=2)
    path = tmp_path / "in" / "plain_1.yaml"
    path.write_text(path.read_text().replace("aperture: 20 deg", "aperture: 30 deg"))
    scenes.write(tmp_path / "in", "plain_0", contact="always")
    assert night(tmp_path, tmp_path / "out", "--rrd", "none") is ExitCode.FAILED
    return ["accept", str(tmp_path / "out"), "--baseline", str(tmp_path / "base"), "--yes", "--reason", "x"]


def test_a_night_is_accepted_in_parts(tmp_path, capsys):
    accept = changed_night(tmp_path)
    log = tmp_path / "base" / "accepted.jsonl"
    capsys.readouterr()
    assert run([*accept, "--group", "no such"]) is ExitCode.INVALID
    assert "its groups are: expect[0].contact never -> always; sensors.distance.tip.aperture" in capsys.readouterr().err
    assert run([*accept, "--select", "p*"]) is ExitCode.INVALID
    assert "did not pass: plain_0 (broken); --except NAME leaves one out" in capsys.readouterr().err
    for part, names in [
        (["--group", "wall/slab pose.xyz[[]0] 1.2 -> 1.25 m", "--except", "*_1"], ["differ_0"]),
        (["--group", "wall/slab pose.xyz[0] 1.2 -> 1.25 m"], ["differ_1"]),
        (["--select", "p*", "--except", "plain_0"], ["plain_1"]),
    ]:
        assert run([*accept, *part]) is ExitCode.FINE
        assert list(json.loads(log.read_text().splitlines()[-1])["scenarios"]) == names
    assert night(tmp_path, tmp_path / "again", "--rrd", "none") is ExitCode.FAILED
    assert verdicts_of(tmp_path / "again") == dict.fromkeys(["differ_0", "differ_1", "plain_1"], "same") | {
        "plain_0": "broken"
    }


def test_a_rule_may_be_for_some_scenarios_alone(tmp_path, capsys):
    prepare(tmp_path, plain=0, bad=0, differing=2)
    rules = tmp_path / "in" / "rules.yaml"
    rule = "{signal: '*', scenario: SCENARIO, ignore: true, reason: the wall is being moved, expires: 2999-01-31}"
    for scenario, verdicts in [("differ_0", ("same", "different")), ("['x', '*_1']", ("different", "same"))]:
        rules.write_text(f"rules_version: 1\nrules:\n  - {rule.replace('SCENARIO', scenario)}\n")
        assert night(tmp_path, tmp_path / "out", "--rrd", "none") is ExitCode.DIFFERENT
        assert tuple(verdicts_of(tmp_path / "out").values()) == verdicts
    rules.write_text(f"rules_version: 1\nrules:\n  - {rule.replace('SCENARIO', '3')}\n")
    assert night(tmp_path, tmp_path / "out", "--rrd", "none") is ExitCode.INVALID
    assert "must be the name of a scenario or a pattern" in capsys.readouterr().err
