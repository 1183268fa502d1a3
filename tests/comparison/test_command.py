"""`replay diff`: what it prints and writes, and its exit code."""

import itertools
import json
import shutil
from xml.etree import ElementTree

import pytest

from replay.cli import main
from replay.comparison import runs
from replay.comparison.suggest import MARK


@pytest.fixture
def run(capsys, monkeypatch):
    """Return what `replay diff` returns and writes to stdout and stderr."""
    monkeypatch.setitem(main.COMMANDS, "diff", "")

    def call(*arguments):
        code = main.run(["diff", *map(str, arguments)])
        return (int(code), *capsys.readouterr())

    return call


def test_the_command_says_it_by_its_exit_code(folders, tmp_path, run):
    same = folders / "a" / "same" / "same.mcap", folders / "b" / "same" / "same.mcap"
    other = folders / "a" / "other" / "other.mcap", folders / "b" / "other" / "other.mcap"
    assert run(*same) == (0, "same: made_up: all 59 signals equal in 100 frames\n", "")
    code, out, _ = run(*other, "--format", "json", "--html", tmp_path / "new" / "d.html", "--junit", tmp_path / "d.xml")
    assert (code, json.loads(out)["verdict"]) == (1, "different")
    assert "contact begins" in (tmp_path / "new" / "d.html").read_text(encoding="utf-8")
    ElementTree.fromstring((tmp_path / "d.xml").read_bytes())
    code, out, _ = run(*other, "--suggest-rules")
    assert (code, MARK in out) == (1, True)
    code, out, _ = run(folders / "a", folders / "b", "-v", "--rrd", tmp_path / "overlays")
    assert code == 1
    assert [path.name for path in (tmp_path / "overlays").iterdir()] == ["other.rrd"]


def test_the_command_says_what_it_cannot_read(folders, tmp_path, run):
    good = folders / "a" / "same" / "same.mcap"
    code, _, err = run(tmp_path / "none.mcap", good)
    assert (code, "none.mcap: cannot be read: No such file" in err) == (2, True)
    code, _, err = run(good, folders)
    assert (code, "must be a file" in err) == (2, True)
    damaged = bytearray(good.read_bytes())
    damaged[len(damaged) // 2] ^= 1
    (tmp_path / "damaged.mcap").write_bytes(damaged)
    code, _, err = run(good, tmp_path / "damaged.mcap")
    assert (code, "damaged" in err) == (2, True)
    (tmp_path / "rules.yaml").write_text("rules_version: 1\nrules: [{signal: x}]\n")
    code, _, err = run(good, good, "--rules", tmp_path / "rules.yaml")
    assert (code, "rules.yaml:2:18: rules[0].signal = 'x'" in err) == (2, True)
    assert run(good)[0] == 2


def test_a_damaged_recording_is_told_and_the_others_are_compared(folders, tmp_path, run):
    shutil.copytree(folders / "b", tmp_path / "b")
    damaged = tmp_path / "b" / "same" / "same.mcap"
    damaged.write_bytes(damaged.read_bytes()[:-100])
    code, out, _ = run(folders / "a", tmp_path / "b", "--html", tmp_path / "d.html", "--junit", tmp_path / "d.xml")
    assert code == 2
    assert out.startswith("different: other: ")
    assert f"unreadable: same: {damaged}: damaged: its end" in out
    assert out.endswith("unreadable: 1 of 1 scenario differ, 1 missing, 1 extra, 1 unreadable\n")
    assert "its end is missing" in (tmp_path / "d.html").read_text(encoding="utf-8")
    tags = {
        case.get("name"): [child.tag for child in case]
        for case in ElementTree.parse(tmp_path / "d.xml").iter("testcase")
    }
    assert tags == {"other": ["failure"], "same": ["error"], "gone": ["failure"], "new": ["failure"]}
    code, out, _ = run(folders / "a", tmp_path / "b", "--format", "json")
    assert (code, json.loads(out)["verdict"]) == (2, "unreadable")
    assert "its end is missing" in run(folders / "a", tmp_path / "b", "--suggest-rules")[1]


def test_the_command_applies_rules(folders, tmp_path, run):
    rules = tmp_path / "rules.yaml"
    rules.write_text("rules_version: 1\nrules: [{signal: '*', ignore: true, reason: everything may differ}]\n")
    assert run(folders / "a", folders / "b", "--rules", rules)[0] == 0
    assert run(folders / "a", folders / "b", "--rules", rules, "--strict-provenance")[0] == 1


def report(folder, **statuses):
    entries = {name: {"status": status} for name, status in statuses.items()}
    (folder / "run.json").write_text(json.dumps({"scenarios": entries, "interrupted": False}))


def test_of_run_folders_what_their_last_run_made_is_compared(folders, tmp_path, run):
    """Not what earlier nights left beside it."""
    for side in "ab":
        shutil.copytree(folders / side, tmp_path / side)
    report(tmp_path / "a", same="passed")
    report(tmp_path / "b", same="broken", new="failed", other="interrupted")
    code, out, _ = run(tmp_path / "a", tmp_path / "b")
    assert (code, out) == (0, "same: same: all 59 signals equal in 100 frames\n")
    report(tmp_path / "b", same="passed", new="passed")
    assert run(tmp_path / "a", tmp_path / "b")[0] == 1
    assert run(folders / "a", tmp_path / "b")[1].endswith("0 of 1 scenario differ, 2 missing, 1 extra\n")
    (tmp_path / "b" / "same" / "same.mcap").unlink()
    code, out, _ = run(tmp_path / "a", tmp_path / "b")
    assert (code, "unreadable: same: " in out, "No such file" in out) == (2, True, True)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[]", "run.json: is not one that replay wrote"),
        ("{", "run.json: is not one that replay wrote"),
        ('{"scenarios": {"same": 3}}', "run.json: is not one that replay wrote"),
        ("[" * 100_000, "run.json: is not one that replay wrote"),
        (
            '{"scenarios": {"../a/same": {"status": "passed"}}, "interrupted": false}',
            "'../a/same' is no scenario's name",
        ),
        ('{"scenarios": {"same": {"status": "interrupted"}}, "interrupted": true}', "its run.json lists no recording"),
    ],
)
def test_a_run_json_of_another_kind_is_one_line(folders, tmp_path, run, text, message):
    shutil.copytree(folders / "b", tmp_path / "b")
    (tmp_path / "b" / "run.json").write_text(text)
    code, _, err = run(folders / "a", tmp_path / "b")
    assert (code, message in err, err.count("\n")) == (2, True, 1)


def test_a_recording_that_is_replaced_while_it_is_read_is_read_again(folders, tmp_path, run, monkeypatch):
    shutil.copytree(folders / "b", tmp_path / "b")
    mine, count = tmp_path / "b" / "other" / "other.mcap", iter(range(100))
    same = (folders / "a" / "other" / "other.mcap").read_bytes()
    read = runs.read

    def replacing(path, **options):
        if str(path) == str(mine) and next(count) < replaced:
            new = tmp_path / "new"
            new.write_bytes(same)
            new.replace(mine)
        return read(path, **options)

    monkeypatch.setattr(runs, "read", replacing)
    replaced = 1
    assert run(folders / "a" / "other" / "other.mcap", mine)[0] == 0
    replaced, changing = 100, itertools.count()
    shutil.copy(folders / "b" / "other" / "other.mcap", mine)
    monkeypatch.setattr(runs, "_identity", lambda file: (next(changing),))
    code, _, err = run(folders / "a" / "other" / "other.mcap", mine)
    assert (code, "is replaced by another process while it is read" in err) == (2, True)
