"""The benchmarks of recordings, of diffs and of starting, small."""

import dataclasses

import pytest

from replay.bench import diff, recording, shipped, start
from replay.bench.measure import Row


def test_recordings_read_back_whole(small):
    rows = recording.on("a", small.model_copy(update={"rate": 2}), 1)
    assert [(row.case, row.method) for row in rows] == [
        ("a", method) for method in (recording.PLAIN, recording.LOG, recording.BOTH, recording.LIBRARY)
    ]
    assert not any(row.failed for row in rows)


def row(case, method, frames, seconds, *, failed=False):
    return Row(case, method, seconds / frames, seconds / frames, seconds / frames, 1, 0.0, 0, frames, failed=failed)


def made_up(frames, seconds):
    """Return what `on` measures on a scene that takes a millisecond a frame and `seconds` to record."""

    def on(name, _, rounds):
        adds = {recording.PLAIN: 0.0, recording.LOG: 0.25 * seconds, recording.BOTH: seconds}
        rows = [row(name, method, frames[name], frames[name] * 1e-3 + more) for method, more in adds.items()]
        return [*rows, row(name, recording.LIBRARY, frames[name], 0.5 * seconds)]

    return on


def test_goals_are_those_of_the_worst_long_and_the_worst_short_scene(monkeypatch):
    frames = {recording.GUARDED: 400, "b": 200, "c": 100, "d": 99, "e": 40}
    monkeypatch.setattr(recording, "shipped", lambda _: None)
    monkeypatch.setattr(recording, "on", made_up(frames, 8e-3))
    report = recording.run(scenes=tuple(frames))
    lines = report.grids[recording.COSTS].lines
    assert list(lines[1].values()) == ["b", "200", "1.040", "10.0", "40.0", "20.0"]
    goals = {goal.key: (goal.measured, goal.verdict) for goal in report.goals}
    assert goals == {
        "recording.ratio": (1.02, "met"),
        "recording.frame": (80.0, "met"),
        "recording.short": (200.0, "missed"),
    }


def test_a_wrong_recording_is_never_a_fast_one(monkeypatch):
    methods = (recording.PLAIN, recording.LOG, recording.BOTH, recording.LIBRARY)
    monkeypatch.setattr(recording, "shipped", lambda _: None)
    monkeypatch.setattr(recording, "on", lambda name, *_: [row(name, m, 300, 0.1, failed=m != "MCAP") for m in methods])
    assert {goal.verdict for goal in recording.run().goals} == {"wrong"}


def test_every_scene_that_is_shipped_is_in_the_benchmark():
    found = [path for folder in (shipped.FOLDER, shipped.FOLDER / "experiments") for path in folder.glob("*.yaml")]
    names = {str(path.relative_to(shipped.FOLDER).with_suffix("")) for path in found} - {"rules"}
    assert set(recording.SCENES) == names


def test_a_lost_frame_is_wrong(small, tmp_path):
    scene = recording.build(small.model_copy(update={"rate": 2}))
    path = recording._record(scene, tmp_path, False)
    assert not recording._judge(path, scene).failed
    assert recording._judge(path, dataclasses.replace(scene, scenario=small)).failed


def test_scenarios_that_are_not_at_hand_are_said(monkeypatch, tmp_path):
    monkeypatch.setattr(shipped, "FOLDER", tmp_path)
    report = recording.run(quick=True)
    assert all(row.rounds == 0 and "source tree" in row.note for row in report.tables[recording.TABLE])
    assert [goal.verdict for goal in report.goals] == ["not measured"] * 3


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
