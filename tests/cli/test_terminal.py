"""Text of files and their names steers no terminal and forges no line, whatever way it takes there."""

import io
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import click
import pytest
from mcap.writer import Writer

import replay
from replay.batch.case import CaseResult, CaseStatus
from replay.cli import terminal
from replay.cli.exit_codes import ExitCode
from replay.cli.main import run
from replay.cli.progress import RunProgress
from replay.errors import InvalidValue, Problem, RecordingError, ScenarioError, WriteError, printable
from replay.numerics.compiling import Compiling
from replay.numerics.jit.progress import OnStderr
from tests.batch import scenes
from tests.comparison import made_up
from tests.comparison.changed import BASELINE, CANDIDATE

ROOT = Path(replay.__file__).parents[1]
STEERING = [*map(chr, range(0x20)), *map(chr, range(0x7F, 0xA0)), *"\xad\u061c\u180e\u200b\u200e\u200f\u2028\u2029"]
STEERING += [*"\u202a\u202b\u202c\u202d\u202e\u2060\u2066\u2067\u2068\u2069\ufeff\ufff9\uffff\udc80\udcff\U000e0041"]
EVIL = "a\x1b]0;b\x07c\x1b[2J\x9bd\u202ee\nreplay: passed\r\x08f"
SHOWN = r"a\x1b]0;b\x07c\x1b[2J\x9bd\u202ee\nreplay: passed\r\x08f"


def check(text, lines=None):
    """Check that text holds nothing that steers, and how many lines it has."""
    assert text.replace("\n", "").isprintable(), ascii(text)
    assert "replay: passed" not in text.splitlines()
    if lines is not None:
        assert text.count("\n") == lines, text


@pytest.mark.parametrize("character", STEERING, ids=ascii)
def test_each_such_character_is_shown_as_an_escape(character):
    shown = printable(f"a{character}b")
    assert shown.isprintable() and shown.isascii()
    assert shown.encode().decode("unicode_escape") == f"a{character}b"


@pytest.mark.parametrize("text", ["", "plain", "näher ß 漢字", "x² ≤ 1e-6 °", "👩\u200d⚕️", "می\u200cخواهم"])
def test_what_people_write_stays(text):
    assert printable(text) == text


@pytest.mark.parametrize(
    "error",
    [
        InvalidValue("x", EVIL, "is none"),
        RecordingError(EVIL, EVIL),
        WriteError(EVIL, EVIL),
        ScenarioError([Problem(EVIL, file=EVIL, line=1, column=2)]),
    ],
    ids=lambda error: type(error).__name__,
)
def test_an_error_is_one_line(error):
    check(f"{error}\n", lines=1)
    assert SHOWN in str(error)


def test_whatever_is_written_goes_through_the_door(monkeypatch):
    out = io.StringIO()
    monkeypatch.setattr(sys, "stdout", terminal.Door(out))
    print(EVIL)
    sys.stdout.writelines([EVIL, "\n"])
    click.echo(EVIL, color=True)
    with pytest.raises(AttributeError):
        _ = sys.stdout.buffer
    assert out.getvalue() == 3 * (SHOWN.replace(r"\n", "\n") + "\n")
    terminal.put([EVIL, "b"])
    assert out.getvalue().endswith(f"\n{SHOWN}\nb\n")


def test_bars_move_and_names_in_them_do_not(monkeypatch):
    class Terminal(io.StringIO):
        def isatty(self):
            return True

    monkeypatch.setenv("TERM", "xterm-256color")
    monkeypatch.setenv("COLUMNS", "400")
    screen = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal.Door(screen))
    with RunProgress() as progress:
        progress.plan({EVIL: 1.0})
        progress.follow(EVIL, 0, 0)
        progress.tell(EVIL)
        progress.compare(EVIL)
        progress.done(CaseResult(EVIL, CaseStatus.CRASHED, error=EVIL))
    assert "\x1b[" in screen.getvalue()  # the bars' own
    assert SHOWN in screen.getvalue()
    for part in ("\x1b]0", "\x07", "\x1b[2J", "\x9b", "\u202e", "\nreplay: passed", "\x08"):
        assert part not in screen.getvalue()
    screen.truncate(0)
    OnStderr()(Compiling(1, 2, 3.0))
    assert screen.getvalue().lstrip("\0").startswith("\r\x1b[K")


def log(path, name):
    """Write a log of others with one name everywhere."""
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start(profile=name, library=name)
        schema = writer.register_schema(name, "jsonschema", b"{}")
        channel = writer.register_channel(f"/{name}", "json", schema, {name: name})
        odd = writer.register_channel(f"/{name}/2", name, 0)
        writer.add_message(channel, 5, json.dumps({name: name}).encode(), 5)
        writer.add_message(odd, 6, b"\xff", 6)
        writer.add_attachment(0, 0, name, name, b"x")
        writer.add_metadata(name, {name: name})
        writer.finish()
    return path


def test_a_log_of_others_is_told_in_as_many_lines_as_a_plain_one(tmp_path, capsys):
    lines = {}
    for name in ("plain", EVIL):
        path = log(tmp_path / f"{'evil' if name == EVIL else name}.mcap", name)
        for command in (["info"], ["export", "--format", "csv", "--overwrite"], ["info", "--format", "json"]):
            assert run([*command, str(path)]) is ExitCode.FINE
            said = capsys.readouterr()
            check(said.out)
            check(said.err)
            lines.setdefault(tuple(command), []).append((said.out.count("\n"), said.err.count("\n")))
    assert all(plain == evil for plain, evil in lines.values()), lines


def test_names_of_files_and_folders_forge_no_line(tmp_path, capsys):
    folder = tmp_path / EVIL
    for side, recording in (("a", BASELINE), ("b", CANDIDATE)):
        for name in ("same", EVIL):
            made_up.write(BASELINE if name == "same" else recording, folder / side / name / f"{name}.mcap")
    made_up.write(BASELINE, folder / "b" / f"{EVIL}2" / f"{EVIL}2.mcap")
    (folder / "b" / "same" / "same.mcap").write_bytes(b"nothing")
    reports = tmp_path / "diff.html", tmp_path / "junit.xml"
    command = ["diff", str(folder / "a"), str(folder / "b"), "--html", str(reports[0]), "--junit", str(reports[1])]
    for more in ([], ["-v"], ["--suggest-rules"]):
        assert run([*command, *more]) is ExitCode.INVALID
        said = capsys.readouterr()
        check(said.out)
        check(said.err)
    for report in reports:
        check(report.read_text(encoding="utf-8"))
    names = [case.get("name") for case in ElementTree.parse(reports[1]).iter("testcase")]
    assert names == [SHOWN, "same", f"{SHOWN}2"]
    for words in (
        ["info", "none.mcap"],
        ["run", "none.yaml"],
        ["validate", "x"],
        ["diff", "a", "none"],
        ["view", "x.rrd"],
    ):
        command = [words[0], *(str(folder / word) for word in words[1:])]
        assert run(command) is ExitCode.INVALID
        check(capsys.readouterr().err, lines=1)
    assert run([EVIL]) is ExitCode.INVALID
    check(capsys.readouterr().err, lines=1)


def test_a_night_of_files_with_such_names_is_reported(tmp_path, capsys):
    scenes.write(tmp_path / "in", "good")
    for name in (EVIL, os.fsdecode(b"bad\xff"), "b\u202ea"):
        text = 'version: 1\nname: \'x\\0\'\nlinks: {"a\\e[2J\\nb": {}, }\nrate: "\\u202e"\n'
        (tmp_path / "in" / f"{name}.yaml").write_text(text)
    out, base = tmp_path / "out", tmp_path / os.fsdecode(b"base\xff\x1b")
    command = ["regress", str(tmp_path / "in"), "--baseline", str(base), "-o", str(out), "--rrd", "none"]
    assert run([*command, "--missing-baseline", "create"]) is ExitCode.INVALID
    said = capsys.readouterr()
    check(said.out)
    check(said.err)
    for file in ("index.html", "junit.xml", "run.json", "history.jsonl", f"{EVIL}/log.txt", "good/log.txt"):
        check((out / file).read_text(encoding="utf-8"))
    check((base / "accepted.jsonl").read_text(encoding="utf-8"))
    names = {case.get("name") for case in ElementTree.parse(out / "junit.xml").iter("testcase")}
    assert names == {"good", SHOWN, r"bad\udcff", r"b\u202ea"}
    assert json.loads((out / "history.jsonl").read_text())["verdicts"].keys() == {
        "good",
        EVIL,
        os.fsdecode(b"bad\xff"),
        "b\u202ea",
    }


@pytest.mark.parametrize("encoding", ["utf-8", "ascii", "latin-1"])
def test_the_command_itself_has_the_door(tmp_path, encoding):
    path = tmp_path / f"{EVIL}.mcap"
    shutil.copy(log(tmp_path / "log.mcap", f"{EVIL}ä漢"), path)
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "PYTHONIOENCODING": f"{encoding}:strict"}
    for command, code in ((["info", str(path)], 0), (["info", str(path) + "x"], 2), (["info", "--bad\x1b[2J"], 2)):
        done = subprocess.run(
            [sys.executable, "-m", "replay", *command], capture_output=True, env=environment, check=False
        )
        assert done.returncode == code, done.stderr
        for said in (done.stdout, done.stderr):
            check(said.decode(encoding))
        assert SHOWN.encode() in done.stdout + done.stderr or "--bad" in command[1]


def test_the_trace_of_a_fault_goes_through_it_too(tmp_path):
    code = "import replay.cli.info as info, replay.recording.summary as summary\n"
    code += "def broken(*_, **__): raise RuntimeError('a\\x1b[2J\\nreplay: passed')\n"
    code += "summary.summarize = broken\nfrom replay.cli.main import main\nmain(['info', 'x'])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == ExitCode.FAILED
    assert r"RuntimeError: a\x1b[2J" in done.stderr
    assert (
        done.stderr.splitlines()[-1]
        == r"replay: error: this is a fault of replay: RuntimeError: a\x1b[2J\nreplay: passed"
    )
    assert "\x1b" not in done.stderr
