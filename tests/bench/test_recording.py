"""The benchmarks of recordings, of diffs and of starting, small."""

import dataclasses

import pytest

from replay.bench import diff, recording, shipped, start
from replay.bench.measure import Row


def test_recordings_read_back_whole(small, monkeypatch):
    monkeypatch.setattr(recording, "shipped", lambda _: small.model_copy(update={"rate": 2}))
    monkeypatch.setattr(recording, "finer", lambda scene: scene.model_copy(update={"rate": 4, "name": "finer"}))
    names = (small.name, "finer")
    rows = [row for scene in (recording.shipped(""), recording.finer(small)) for row in recording.on(scene, 1)]
    assert [(row.case, row.method) for row in rows] == [
        (name, method) for name in names for method in (recording.PLAIN, recording.LOG, recording.BOTH)
    ]
    assert not any(row.failed for row in rows)


def test_what_recording_adds_is_told_from_two_lengths():
    def row(case, method, frames, seconds):
        return Row(case, method, seconds / frames, seconds / frames, seconds / frames, 1, 0.0, 0, frames, failed=False)

    long = "a" + recording.FINER
    rows = [
        row("a", recording.PLAIN, 100, 0.1),
        row("a", recording.BOTH, 100, 0.1 + 0.02 + 100 * 50e-6),
        row(long, recording.PLAIN, 400, 0.4),
        row(long, recording.BOTH, 400, 0.4 + 0.02 + 400 * 50e-6),
    ]
    cost = recording.cost({(one.case, one.method): one for one in rows}, "a")
    assert list(cost.values()) == ["a", "1.250", "250.0", "100.0"]  # 20 ms once, and 50 us a frame


def test_a_lost_frame_is_wrong(small, tmp_path):
    scene = recording.build(small.model_copy(update={"rate": 2}))
    path = recording._record(scene, tmp_path, False)
    assert not recording._judge(path, scene).failed
    assert recording._judge(path, dataclasses.replace(scene, scenario=small)).failed


def test_scenarios_that_are_not_at_hand_are_said(monkeypatch, tmp_path):
    monkeypatch.setattr(shipped, "FOLDER", tmp_path)
    report = recording.run(quick=True)
    assert all(row.rounds == 0 and "source tree" in row.note for row in report.tables[recording.TABLE])
    assert [goal.verdict for goal in report.goals] == ["not measured", "not measured"]


def test_finer_is_the_same_motion():
    found = shipped.shipped("carm_clear")
    assert recording.finer(found).frames == recording.TIMES * (found.frames - 1) + 1


def test_diffs_are_right_and_promise_nothing_on_few_frames():
    report = diff.run(frames=40)
    assert [line["verdict"] for line in report.grids[diff.TABLE].lines] == ["right", "right"]
    assert [goal.verdict for goal in report.goals] == ["not measured"] * 3


def test_commands_start_and_load_nothing_heavy():
    report = start.run(rounds=1)
    assert [goal.key for goal in report.goals] == ["start.help", "start.validate", "start.modules"]
    assert report.goals[2].verdict == "met"
    assert all(goal.measured > 0.0 for goal in report.goals[:2])


@pytest.mark.parametrize("command", [["-c", "raise SystemExit(3)"]])
def test_a_command_that_fails_has_no_time(command):
    assert start._seconds(command) != start._seconds(command)
