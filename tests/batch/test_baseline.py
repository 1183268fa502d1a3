"""Accepted recordings: slim, complete together with their meshes, replaced whole, and logged."""

import datetime
import json
import os
from pathlib import Path

import pytest

import replay
from replay.batch.baseline import Baseline, Entry
from replay.batch.history import Night, append_night, failing_since, read_history
from replay.batch.select import load_all
from replay.comparison.runs import diff
from replay.errors import RecordingError, WriteError
from replay.geometry import primitives
from replay.recording.slim import attached_files
from replay.recording.summary import summarize

NOW = datetime.datetime(2027, 3, 1, 2, 0, tzinfo=datetime.UTC)
TEXT = """
version: 1
name: {name}
rate: 5 Hz
duration: 1 s
links:
  ball: {{joint: {{type: free}}, shapes: {{ball: {{type: mesh, file: ball.stl, scale: 1}}}}}}
  wall: {{shapes: {{slab: {{type: cube, size: 1}}}}}}
"""


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    import trimesh

    folder = tmp_path_factory.mktemp("meshes")
    solid = primitives.sphere(0.5, 0.01)
    mesh = trimesh.Trimesh(**trimesh.triangles.to_kwargs(solid.triangles))
    (folder / "ball.stl").write_bytes(mesh.export(file_type="stl"))
    for name in ("a", "b"):
        (folder / f"{name}.yaml").write_text(TEXT.format(name=name))
        replay.record(replay.load(folder / f"{name}.yaml"), folder / name, rrd=False)
    return folder


def entries(run, *names):
    return {name: Entry(run / name / f"{name}.mcap", "new") for name in names}


def test_slim_recordings_share_their_meshes_and_say_all_that_the_whole_ones_do(run, tmp_path):
    baseline = Baseline(tmp_path / "base")
    baseline.store(entries(run, "a", "b"), reason="first", now=NOW)
    assert baseline.names() == ["a", "b"]
    (mesh,) = (tmp_path / "base" / "objects").iterdir()
    assert mesh.read_bytes() == (run / "ball.stl").read_bytes()
    slim, whole = baseline.recording("a"), run / "a" / "a.mcap"
    assert slim.stat().st_size < whole.stat().st_size - mesh.stat().st_size
    assert any(line.endswith("  elsewhere  ball.stl") for line in summarize(slim).lines())
    found = diff(slim, whole)
    assert found.verdict.value == "same"
    assert not found.provenance
    assert not found.scene
    assert attached_files(slim) == attached_files(whole)
    (scenario,) = load_all([slim])
    again = replay.record(scenario, tmp_path / "again", rrd=False)
    assert again.mcap.read_bytes() == whole.read_bytes()


def test_what_and_why_is_logged_and_unneeded_meshes_go(run, tmp_path):
    baseline = Baseline(tmp_path)
    baseline.store(entries(run, "a"), reason="first", now=NOW)
    (tmp_path / "objects" / ("0" * 64)).write_bytes(b"left over")
    baseline.store(entries(run, "a"), reason="näher \udcff", now=NOW)
    log = [json.loads(line) for line in (tmp_path / "accepted.jsonl").read_text(encoding="utf-8").splitlines()]
    assert [line["reason"] for line in log] == ["first", "näher \udcff"]
    assert log[1]["scenarios"] == {"a": "new"}
    assert len(list((tmp_path / "objects").iterdir())) == 1
    assert not list(tmp_path.glob(".staging*"))


def test_meshes_stay_while_a_baseline_that_may_need_them_cannot_be_read(run, tmp_path):
    baseline = Baseline(tmp_path)
    baseline.store(entries(run, "a", "b"), reason="first", now=NOW)
    (mesh,) = (tmp_path / "objects").iterdir()
    unknown = tmp_path / "objects" / ("0" * 64)
    unknown.write_bytes(b"of the one that cannot be read")
    whole = baseline.recording("a").read_bytes()
    baseline.recording("a").write_bytes(whole[:-100])
    baseline.store(entries(run, "b"), reason="second", now=NOW)
    assert mesh.is_file()
    assert unknown.is_file()
    baseline.recording("a").write_bytes(whole)
    baseline.store(entries(run, "b"), reason="third", now=NOW)
    assert list((tmp_path / "objects").iterdir()) == [mesh]


def test_nothing_changes_when_one_of_them_cannot_be_stored(run, tmp_path):
    baseline = Baseline(tmp_path)
    baseline.store(entries(run, "a"), reason="first", now=NOW)
    before = baseline.recording("a").read_bytes()
    (tmp_path / "cut.mcap").write_bytes((run / "b" / "b.mcap").read_bytes()[:-100])
    with pytest.raises(RecordingError):
        baseline.store({**entries(run, "a"), "b": Entry(tmp_path / "cut.mcap", "new")}, reason="x", now=NOW)
    assert baseline.names() == ["a"]
    assert baseline.recording("a").read_bytes() == before
    assert len((tmp_path / "accepted.jsonl").read_text().splitlines()) == 1
    with pytest.raises(RecordingError):  # the mesh of a, the first of them, was written by then
        Baseline(tmp_path / "new").store(
            {**entries(run, "a"), "b": Entry(tmp_path / "cut.mcap", "new")}, reason="x", now=NOW
        )
    assert not (tmp_path / "new").exists()
    with pytest.raises(RecordingError):  # no mesh was written by then
        Baseline(tmp_path / "new").store({"b": Entry(tmp_path / "cut.mcap", "new")}, reason="x", now=NOW)
    assert not (tmp_path / "new").exists()


def test_a_mesh_that_is_missing_or_changed_is_an_error(run, tmp_path):
    baseline = Baseline(tmp_path)
    baseline.store(entries(run, "a"), reason="first", now=NOW)
    (mesh,) = (tmp_path / "objects").iterdir()
    mesh.write_bytes(b"x")
    with pytest.raises(RecordingError, match="SHA-256 is not its name"):
        attached_files(baseline.recording("a"))
    baseline.store(entries(run, "a"), reason="again", now=NOW)
    assert mesh.read_bytes() == (run / "ball.stl").read_bytes()
    mesh.unlink()
    with pytest.raises(RecordingError, match="neither attached nor in a folder 'objects'"):
        attached_files(baseline.recording("a"))


@pytest.mark.parametrize("after", [0, 1, 2])
def test_an_acceptance_that_was_killed_is_completed_by_the_next(run, tmp_path, monkeypatch, after):
    """Each baseline is wholly old or new at any moment, no mesh is missing, and the log says all that was put."""
    baseline = Baseline(tmp_path)
    baseline.store(entries(run, "a"), reason="first", now=NOW)
    replace, count = Path.replace, iter(range(9))

    def killing(file, target):
        if file.parent.name == ".staging" and file.suffix == ".mcap" and next(count) == after:
            raise KeyboardInterrupt
        return replace(file, target)

    monkeypatch.setattr(Path, "replace", killing)
    if after < 2:
        with pytest.raises(KeyboardInterrupt):
            baseline.store(entries(run, "a", "b"), reason="second", now=NOW)
    else:
        baseline.store(entries(run, "a", "b"), reason="second", now=NOW)
    monkeypatch.setattr(Path, "replace", replace)
    assert (after == 0) <= (baseline.names() == ["a"])
    for name in baseline.names():
        attached_files(baseline.recording(name))
    baseline.store(entries(run, "a"), reason="third", now=NOW)
    assert baseline.names() == ["a", "b"]
    attached_files(baseline.recording("b"))
    log = [json.loads(line) for line in (tmp_path / "accepted.jsonl").read_text().splitlines()]
    assert [(line["reason"], list(line["scenarios"])) for line in log] == [
        ("first", ["a"]),
        ("second", ["a", "b"]),
        ("third", ["a"]),
    ]
    assert sorted(file.name for file in tmp_path.iterdir()) == ["a", "accepted.jsonl", "b", "objects"]


def test_what_a_killed_acceptance_had_not_all_written_is_dropped(run, tmp_path):
    (tmp_path / ".staging").mkdir()
    (tmp_path / ".staging" / "b.mcap").write_bytes(b"half")
    Baseline(tmp_path).store(entries(run, "a"), reason="first", now=NOW)
    assert Baseline(tmp_path).names() == ["a"]
    assert not (tmp_path / ".staging").exists()


def test_a_row_of_failing_nights_is_counted_from_its_first(tmp_path):
    path = tmp_path / "history.jsonl"
    for day, verdicts in enumerate(
        ({"a": "different"}, {"a": "same"}, {"a": "crashed"}, {"b": "same"}, {"a": "timeout"})
    ):
        failing = frozenset(name for name, verdict in verdicts.items() if verdict != "same")
        append_night(path, Night(f"day {day}", "1", verdicts, failing))
    append_night(path, Night("day 5", "1", {"\udcff": "failed"}, frozenset(["\udcff"])))
    with path.open("a") as file:
        file.write('{"time": "cut')
    nights = read_history(path)
    assert len(nights) == 6
    assert failing_since(nights, "\udcff") == "day 5"
    assert failing_since(nights, "a") == "day 2"
    assert failing_since(nights, "b") is None
    assert failing_since([], "a") is None


def test_a_pointer_of_git_lfs_in_place_of_a_mesh_or_a_recording_is_told_as_one(run, tmp_path):
    baseline = Baseline(tmp_path)
    baseline.store(entries(run, "a"), reason="first", now=NOW)
    pointer = "version https://git-lfs.github.com/spec/v1\noid sha256:4d7a21\nsize 12345\n"
    (mesh,) = (tmp_path / "objects").iterdir()
    mesh.write_text(pointer)
    with pytest.raises(RecordingError, match=f"{mesh.name}: is a Git LFS pointer"):
        attached_files(baseline.recording("a"))
    baseline.recording("a").write_text(pointer)
    with pytest.raises(RecordingError, match=r"a.mcap: is a Git LFS pointer.*git lfs pull"):
        diff(baseline.recording("a"), run / "a" / "a.mcap")


def test_a_mesh_that_is_too_large_is_not_read_and_replaced(run, tmp_path):
    baseline = Baseline(tmp_path)
    baseline.store(entries(run, "a"), reason="first", now=NOW)
    (mesh,) = (tmp_path / "objects").iterdir()
    data = mesh.read_bytes()
    with mesh.open("wb") as file:
        file.truncate(1 << 40)
    with pytest.raises(RecordingError, match="has 1099511627776 bytes; at most 1073741824 are read"):
        attached_files(baseline.recording("a"))
    baseline.store(entries(run, "b"), reason="second", now=NOW)
    assert mesh.read_bytes() == data


@pytest.mark.parametrize("make", [os.mkfifo, lambda path: os.mknod(path, 0o20644, os.makedev(1, 5))])
def test_results_are_kept_in_files_alone(run, tmp_path, make):
    log = tmp_path / "accepted.jsonl"
    try:
        make(log)  # /dev/zero never ends, and a pipe never begins
    except PermissionError:
        pytest.skip("only root makes devices")
    with pytest.raises(WriteError, match=r"accepted\.jsonl: cannot be written: it is a pipe or a device"):
        Baseline(tmp_path).store(entries(run, "a"), reason="x", now=NOW)
    assert read_history(log) == []
    with pytest.raises(WriteError, match="it is a pipe or a device"):
        append_night(log, Night("now", "1", {}, frozenset()))
    log.unlink()
    Baseline(tmp_path).store({}, reason="the rest", now=NOW)
    assert Baseline(tmp_path).names() == ["a"]
