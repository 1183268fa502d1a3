"""A log is resumed by the whole of it, although a recording keeps an excerpt only."""

import json

import replay
from replay.batch import resume
from replay.batch.resume import earlier_result
from replay.batch.run import run_all
from replay.comparison.provenance import file_changes
from replay.recording.provenance import library_versions
from replay.recording.record import record
from tests.batch.test_run import TWO, Remarks

SCENARIO = """
version: 1
name: swing
rate: 10 Hz
duration: 1 s
links:
  base: {shapes: {foot: {type: cube, size: 0.2}}}
  arm: {parent: base, joint: {type: revolute, axis: [0, 1, 0]}, shapes: {rod: {type: cube, size: 0.1}}}
motion: {recorded: {file: log.csv}}
"""


def written(folder, end):
    (folder / "log.csv").write_text("time,arm\n" + "".join(f"{k / 10},{k / 50}\n" for k in range(end)))
    (folder / "swing.yaml").write_text(SCENARIO)
    return replay.load(folder / "swing.yaml")


def test_a_run_is_resumed_unless_the_log_changed_even_where_nobody_looks(tmp_path):
    run_all([written(tmp_path, 30)], tmp_path / "run", rrd=False, execution=TWO)
    remarks = Remarks()
    run_all([written(tmp_path, 30)], tmp_path / "run", rrd=False, resume=True, execution=TWO, watch=remarks)
    longer = written(tmp_path, 31)
    run_all([longer], tmp_path / "run", rrd=False, resume=True, execution=TWO, watch=remarks)
    assert remarks.said[0] == "swing: reused"
    assert remarks.said[1].startswith("swing: runs again: changed: ")
    assert remarks.said[1].endswith("original of log.csv")


def test_only_a_run_by_the_same_libraries_of_as_many_frames_is_used_again(tmp_path, monkeypatch):
    scenario = written(tmp_path, 30)
    run_all([scenario], tmp_path / "run", rrd=False, execution=TWO)
    folder = tmp_path / "run" / "swing"

    def earlier():
        return earlier_result(scenario, folder, model=None, rrd=False)

    assert earlier().reused
    versions = library_versions()
    for name in versions:
        monkeypatch.setattr(resume, "library_versions", lambda name=name: {**versions, name: "0.0.1"})
        assert earlier() == f"changed: version of {name}"
    monkeypatch.setattr(resume, "library_versions", lambda: {**versions, "more": "1"})
    assert earlier() == "changed: version of more"
    monkeypatch.undo()
    result = json.loads((folder / "result.json").read_text())
    others = {"frames": result["frames"] - 1, "scenario": "swung", "status": "failed"}
    for key, value in others.items():
        (folder / "result.json").write_text(json.dumps({**result, key: value}))
        assert earlier() == "result.json belongs to another recording"
    (folder / "result.json").write_text(json.dumps({**result, "status": "broken"}))
    assert earlier().status.value == "broken"


def test_recordings_of_one_log_are_alike_whether_they_keep_it_or_an_excerpt(tmp_path):
    scenario = written(tmp_path, 30)
    ours = replay.read(record(scenario, tmp_path / "a", rrd=False).mcap).provenance
    origin = ours.originals["log.csv"]["sha256"]
    whole = ours.__class__(**{**vars(ours), "files": {**ours.files, "log.csv": origin}, "originals": {}})
    assert file_changes(whole, ours) == ()
    (change,) = file_changes(
        whole, replay.read(record(written(tmp_path, 31), tmp_path / "b", rrd=False).mcap).provenance
    )
    assert change.name == "/files/log.csv"
