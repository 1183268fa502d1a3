"""Nothing outside a run folder or a baseline folder is written or deleted, whatever links and names lie in them."""

import hashlib
import json
import os

import pytest

from replay.batch.baseline import LOG, Baseline, Entry
from replay.batch.case import CaseResult, CaseStatus
from replay.batch.run import Execution, run_all
from replay.cli.exit_codes import ExitCode
from replay.cli.main import run
from replay.errors import InvalidValue, RecordingError
from replay.recording.slim import attached_files
from tests.batch import scenes
from tests.batch.test_baseline import NOW
from tests.comparison import made_up
from tests.comparison.changed import BASELINE

BEAM = hashlib.sha256(made_up.FILES["meshes/beam.stl"]).hexdigest()


def named(name):
    return made_up.with_provenance(BASELINE, scenario=name)


def listing(folder):
    """Return all that is in a folder: content by path, and where links lead."""
    found = sorted(folder.rglob("*"))
    return {path: path.readlink() if path.is_symlink() else path.is_file() and path.read_bytes() for path in found}


@pytest.fixture
def ran(tmp_path):
    """A run folder with scenario `a`, a folder `victim` that nobody may change, and a place for a baseline."""
    made_up.write(named("a"), tmp_path / "run" / "a" / "a.mcap")
    tell(tmp_path, "a")
    (tmp_path / "victim" / "sub").mkdir(parents=True)
    for name in ("thesis.txt", "log.txt", "accepted.jsonl", "a.rrd", "a.mcap", "a.mcap.part", "sub/a.mcap", "0" * 64):
        (tmp_path / "victim" / name).write_bytes(b"precious")
    return tmp_path


def tell(folder, *names):
    text = json.dumps({"interrupted": False, "scenarios": {name: {"status": "passed"} for name in names}})
    (folder / "run" / "run.json").write_text(text)


def accept(folder):
    return run(["accept", str(folder / "run"), "--baseline", str(folder / "base"), "--reason", "x", "--yes"])


@pytest.mark.parametrize("place", ["objects", "a", "accepted.jsonl", ".staging", ".lock"])
@pytest.mark.parametrize("target", ["victim", "victim/thesis.txt", "nothing"])
def test_a_baseline_with_a_link_in_it_is_refused(ran, capsys, place, target):
    (ran / "base").mkdir()
    (ran / "base" / place).symlink_to(ran / target)
    before = listing(ran)
    assert accept(ran) is ExitCode.INVALID
    assert f"{ran / 'base' / place}: cannot be written: it is a link, and nothing" in capsys.readouterr().err
    assert listing(ran) == before


@pytest.mark.skipif(os.name != "posix", reason="pipes as POSIX has them")
@pytest.mark.parametrize(
    ("place", "words"),
    [
        (".staging", "base/.staging: cannot be written: File exists"),
        ("objects", "base/objects is a file where a folder is needed"),
        ("a", "base/a: cannot be written: File exists"),
        ("accepted.jsonl", "base/accepted.jsonl: cannot be written: it is a pipe or a device"),
    ],
)
def test_a_pipe_in_a_baseline_is_not_waited_for(ran, capsys, place, words):
    (ran / "base").mkdir()
    os.mkfifo(ran / "base" / place)
    assert accept(ran) is ExitCode.INVALID
    assert words in capsys.readouterr().err


@pytest.mark.skipif(os.name != "posix", reason="pipes as POSIX has them")
def test_a_night_waits_for_no_pipe(tmp_path, capsys):
    places = [".lock", ".rrd", "run.json", "index.html", "junit.xml", "summary.md", "metrics.parquet"]
    places += ["a/log.txt", "a/result.json", "a/a.mcap", "a/a.mcap.part", "a/a.rrd", "a/report.html"]
    scenes.write(tmp_path / "in", "a", duration=0.2, contact="always")
    (tmp_path / "out" / "a").mkdir(parents=True)
    for place in places:
        os.mkfifo(tmp_path / "out" / place)
    command = ["regress", str(tmp_path / "in"), "--baseline", str(tmp_path / "base"), "-o", str(tmp_path / "out")]
    assert run([*command, "--workers", "1"]) is ExitCode.FAILED
    assert "a: broken" in capsys.readouterr().out
    assert json.loads((tmp_path / "out" / "run.json").read_text())["verdicts"]["a"]["verdict"] == "broken"


def test_a_baseline_folder_may_be_a_link_that_the_user_names(ran):
    """It is where the user says; but nothing that was there before is removed."""
    before = listing(ran / "victim")
    (ran / "base").symlink_to("victim")
    (ran / "victim" / "objects").mkdir()
    (ran / "victim" / "objects" / "notes.txt").write_bytes(b"precious")
    (ran / "victim" / "accepted.jsonl").unlink()
    assert accept(ran) is ExitCode.FINE
    after = listing(ran / "victim")
    assert {path: after[path] for path in before if path.name != "accepted.jsonl"}.items() <= before.items()
    assert after[ran / "victim" / "objects" / "notes.txt"] == b"precious"
    assert after[ran / "victim" / "objects" / BEAM] == made_up.FILES["meshes/beam.stl"]


def test_only_what_accept_has_put_there_is_removed(ran):
    objects = ran / "base" / "objects"
    objects.mkdir(parents=True)
    for name in ("0" * 64, "A" * 64, "0" * 63, "0" * 65, "0" * 64 + ".txt", "x.mcap"):
        (objects / name).write_bytes(b"x")
    (objects / ("1" * 64)).symlink_to(ran / "victim" / "thesis.txt")
    (objects / ("2" * 64)).symlink_to(ran / "victim")
    (objects / ("3" * 64)).mkdir()
    (objects / ("3" * 64) / "file").write_bytes(b"x")
    (objects / ("4" * 64)).hardlink_to(ran / "victim" / "thesis.txt")
    os.mkfifo(objects / ("5" * 64))
    victim, before = listing(ran / "victim"), {path.name for path in objects.iterdir()}
    assert accept(ran) is ExitCode.FINE
    assert {path.name for path in objects.iterdir()} == (before | {BEAM}) - {"0" * 64, "4" * 64}
    assert listing(ran / "victim") == victim


def test_a_scenario_may_be_called_as_the_folder_of_meshes(ran):
    made_up.write(named("objects"), ran / "run" / "objects" / "objects.mcap")
    tell(ran, "a", "objects")
    assert accept(ran) is ExitCode.FINE
    assert Baseline(ran / "base").names() == ["a", "objects"]
    assert {path.name for path in (ran / "base" / "objects").iterdir()} == {BEAM, "objects.mcap"}


@pytest.mark.parametrize("kind", ["link", "hard link", "folder", "link to a folder"])
def test_a_mesh_is_put_in_place_of_what_has_its_name(ran, capsys, kind):
    place = ran / "base" / "objects" / BEAM
    place.parent.mkdir(parents=True)
    same = ran / "victim" / "same"
    same.write_bytes(made_up.FILES["meshes/beam.stl"])
    match kind:
        case "link":
            place.symlink_to(same)  # of the same content: it would be gone with the other folder
        case "hard link":
            place.hardlink_to(ran / "victim" / "thesis.txt")
        case "folder":
            place.mkdir()
        case "link to a folder":
            place.symlink_to(ran / "victim")
    before = listing(ran / "victim")
    code = accept(ran)
    assert listing(ran / "victim") == before
    if kind == "folder":
        assert code is ExitCode.INVALID
        assert f"{place}: cannot be written: Is a directory" in capsys.readouterr().err
        assert not (ran / "base" / "a").exists()
        return
    assert code is ExitCode.FINE
    assert not place.is_symlink()
    assert place.read_bytes() == made_up.FILES["meshes/beam.stl"]
    assert attached_files(ran / "base" / "a" / "a.mcap")[2] == made_up.FILES


def test_a_recording_and_a_log_with_other_names_keep_what_those_hold(ran):
    (ran / "base" / "a").mkdir(parents=True)
    (ran / "base" / "a" / "a.mcap").hardlink_to(ran / "victim" / "thesis.txt")
    (ran / "base" / LOG).hardlink_to(ran / "victim" / "log.txt")
    before = listing(ran / "victim")
    assert accept(ran) is ExitCode.FINE
    assert listing(ran / "victim") == before
    assert (ran / "base" / LOG).read_text().startswith("precious{")
    (ran / "base" / "a" / "a.mcap").unlink()
    (ran / "base" / "a" / "a.mcap").symlink_to(ran / "victim" / "thesis.txt")
    assert accept(ran) is ExitCode.FINE
    assert listing(ran / "victim") == before
    assert not (ran / "base" / "a" / "a.mcap").is_symlink()


@pytest.mark.parametrize("what", ["log", "link", "other scenario", "strange name", "folder that is a link"])
def test_a_staged_acceptance_of_others_is_looked_at_before_it_is_completed(ran, capsys, what):
    """It may not be what a killed process of ours has left."""
    staging = ran / "base" / ".staging"
    staging.mkdir(parents=True)
    name = "b\x1b[2J" if what == "strange name" else "b"
    made_up.write(named("c" if what == "other scenario" else name), ran / "other.mcap")
    (staging / f"{name}.mcap").write_bytes((ran / "other.mcap").read_bytes())
    (staging / LOG).write_text('{"reason": "theirs\\u001b[2J"}\n')
    match what:
        case "log":
            (staging / LOG).unlink()
            (staging / LOG).symlink_to(ran / "victim" / "thesis.txt")
        case "link":
            (staging / "b.mcap").unlink()
            (staging / "b.mcap").symlink_to(ran / "other.mcap")
        case "folder that is a link":
            (ran / "base" / "b").symlink_to(ran / "victim")
    before = listing(ran / "victim")
    code = accept(ran)
    assert listing(ran / "victim") == before
    if what == "log":  # that is not all of one, and goes
        assert code is ExitCode.FINE
        assert not staging.exists()
        assert Baseline(ran / "base").names() == ["a"]
    else:
        assert code is ExitCode.INVALID
        (line,) = capsys.readouterr().err.splitlines()
        assert line.isprintable()
        assert {path.name for path in (ran / "base").iterdir()} <= {".staging", "b"}


def test_the_line_of_a_staged_acceptance_is_one_line(ran):
    staging = ran / "base" / ".staging"
    staging.mkdir(parents=True)
    (staging / LOG).write_text('{"reason":\n "theirs\\u001b[2J"}\n')
    (ran / "base" / LOG).write_bytes(b"\xff\n")
    assert accept(ran) is ExitCode.FINE
    cut, theirs, ours = (ran / "base" / LOG).read_bytes().splitlines()
    assert (cut, theirs) == (b"\xff", b'{"reason": "theirs\\u001b[2J"}')
    assert json.loads(ours)["reason"] == "x"


NAMES = [
    *("..", ".", "", "../victim", "a/../../victim", "sub/a", "/tmp", "a/", "./a", "..\\victim", "a\\b", "C:\\a"),
    *("a\0b", "a\nb", "\x1b[2J", "a\u202eb", ".staging-x", "x" * 300, "accepted.jsonl", "\udcff", "a ", "NUL"),
]


@pytest.mark.parametrize("name", NAMES)
def test_names_that_lead_elsewhere_are_refused(ran, capsys, name):
    tell(ran, "a", name)
    before = listing(ran)
    assert accept(ran) is ExitCode.INVALID
    (line,) = capsys.readouterr().err.splitlines()
    assert line.endswith("is no scenario's name, which is that of a folder and no path")
    assert line.isprintable()
    assert listing(ran) == before
    entry = Entry(ran / "run" / "a" / "a.mcap", "new")
    with pytest.raises(InvalidValue, match="is no scenario's name"):
        Baseline(ran / "base").store({name: entry}, reason="x", now=NOW)
    assert listing(ran) == before


def test_a_recording_is_accepted_for_its_own_scenario_alone(ran, capsys):
    made_up.write(named("b"), ran / "run" / "c" / "c.mcap")
    tell(ran, "a", "c")
    before = listing(ran)
    assert accept(ran) is ExitCode.INVALID
    assert "c.mcap: is a recording of the scenario 'b', not of 'c'" in capsys.readouterr().err
    assert listing(ran) == before
    with pytest.raises(RecordingError, match="of the scenario 'a', not of 'c'"):
        Baseline(ran / "base").store({"c": Entry(ran / "run" / "a" / "a.mcap", "new")}, reason="x", now=NOW)
    assert listing(ran) == before


@pytest.mark.parametrize("kind", ["file", "folder", "run.json"])
def test_a_recording_outside_of_the_run_is_refused(ran, capsys, kind):
    made_up.write(named("b"), ran / "other" / "b" / "b.mcap")
    if kind == "folder":
        (ran / "run" / "b").symlink_to(ran / "other" / "b")
    else:
        (ran / "run" / "b").mkdir()
        (ran / "run" / "b" / "b.mcap").symlink_to(ran / "other" / "b" / "b.mcap")
    tell(ran, "a", "b")
    before = listing(ran)
    assert accept(ran) is ExitCode.INVALID
    assert "b.mcap: is a link, or in a folder that is one" in capsys.readouterr().err
    assert listing(ran) == before


FILES = ("log.txt", "result.json", "a.mcap", "a.mcap.part", "a.rrd", "a.rrd.part")


@pytest.mark.parametrize("link", ["to a file", "hard", "to nothing"])
def test_files_of_a_run_are_never_written_through_links(tmp_path, link):
    folder, victim = tmp_path / "run", tmp_path / "victim"
    victim.mkdir()
    (folder / "a").mkdir(parents=True)
    for name in (*(f"a/{name}" for name in FILES), "run.json", "run.json.part"):
        target = victim / name.replace("/", "_")
        target.write_bytes(b"precious")
        if link == "hard":
            (folder / name).hardlink_to(target)
        else:
            (folder / name).symlink_to(target)
        if link == "to nothing":
            target.unlink()
    before = listing(victim)
    (result,) = run_all([scenes.scene("a")], folder, overwrite=True, execution=Execution(workers=1)).results
    assert result.status is CaseStatus.PASSED
    assert listing(victim) == before
    names = {path.name for path in (folder / "a").iterdir() if path.is_file() and not path.is_symlink()}
    assert names >= {"log.txt", "result.json", "a.mcap", "a.rrd"}
    assert "a: passed" in (folder / "a" / "log.txt").read_text()


def test_the_folder_of_a_scenario_that_is_a_link_is_its_error(tmp_path):
    folder, victim = tmp_path / "run", tmp_path / "victim"
    folder.mkdir()
    victim.mkdir()
    for name in (*FILES, "invalid.mcap", "invalid.rrd"):
        (victim / name).write_bytes(b"precious")
    for name in ("a", "invalid"):
        (folder / name).symlink_to(victim)
    before = listing(victim)
    failed = [CaseResult("invalid", CaseStatus.FAILED, error="not valid", invalid=True)]
    done = run_all([scenes.scene("a")], folder, rrd=False, overwrite=True, failed=failed)
    assert [result.status for result in done.results] == [CaseStatus.FAILED] * 2
    assert done.results[0].error.startswith(f"{folder / 'a'}: cannot be written: it is a link")
    assert listing(victim) == before


def test_a_night_writes_through_no_link(tmp_path, capsys):
    out, victim = tmp_path / "out", tmp_path / "victim"
    scenes.write(tmp_path / "in", "a", contact="always")
    (victim / "a").mkdir(parents=True)
    out.mkdir()
    for name in ("history.jsonl", "index.html", "junit.xml", "run.json", "a/a.rrd", "a/a.difference.rrd"):
        (victim / name).write_bytes(b"precious")
    for name in ("history.jsonl", "index.html", "junit.xml"):
        (out / name).symlink_to(victim / name)
    (out / ".rrd").symlink_to(victim)
    before = listing(victim)
    command = ["regress", str(tmp_path / "in"), "--baseline", str(tmp_path / "base"), "-o", str(out)]
    assert run(command) is ExitCode.INVALID
    assert "history.jsonl: cannot be written: it is a link" in capsys.readouterr().err
    assert listing(victim) == before
    assert not (out / "index.html").is_symlink()
    assert (out / "a" / "a.rrd").is_file()
