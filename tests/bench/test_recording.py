"""The benchmarks of recordings, of diffs and of starting, small."""

import dataclasses
import re

import pytest

from replay.bench import diff, recording, shipped, start
from replay.bench.measure import Row

pytestmark = pytest.mark.compiled  # it measures them

METHODS = (
    recording.PLAIN,
    recording.LOG,
    recording.BOTH,
    recording.LIBRARY,
    recording.BESIDE,
    recording.MORE_PLAIN,
    recording.MORE_BOTH,
)


def test_recordings_read_back_whole(small):
    rows = recording.on("a", small.model_copy(update={"rate": 2}), 1)
    assert [(row.case, row.method) for row in rows] == [("a", method) for method in METHODS]
    assert not any(row.failed for row in rows)
    frames, *_, longer = (row.queries for row in rows)
    assert longer - frames >= recording.MORE
    assert not any(row.failed for row in recording.nothing(1))


def row(case, method, frames, seconds, *, failed=False):
    return Row(case, method, seconds / frames, seconds / frames, seconds / frames, 1, 0.0, 0, frames, failed=failed)


def made_up(frames, once, more):
    """Return what `on` measures on scenes whose recordings take so many seconds once, and so many a frame."""

    def on(name, _, rounds):
        n, longer = frames[name], frames[name] + 400
        both = once + n * more
        adds = {recording.PLAIN: 0.0, recording.LOG: 0.25 * both, recording.BOTH: both}
        rows = [row(name, method, n, n * 1e-3 + seconds) for method, seconds in adds.items()]
        rows += [row(name, recording.LIBRARY, n, 0.5 * both), row(name, recording.BESIDE, n, 0.8 * both)]
        rows.append(row(name, recording.MORE_PLAIN, longer, longer * 1e-3))
        return [*rows, row(name, recording.MORE_BOTH, longer, longer * 1e-3 + once + longer * more)]

    return on


def test_what_a_frame_more_costs_is_told_apart_from_what_a_recording_costs(monkeypatch):
    frames = {recording.GUARDED: 400, "b": 200, "c": 100, "d": 99, "e": 40}
    monkeypatch.setattr(recording, "shipped", lambda _: None)
    monkeypatch.setattr(recording, "on", made_up(frames, 8e-3, 30e-6))
    report = recording.run(scenes=tuple(frames), rounds=1)
    lines = report.grids[recording.COSTS].lines
    assert list(lines[1].values()) == ["b", "200", "1.070", "17.5", "70.0", "35.0", "56.0", "30.0", "8.0", "115"]
    assert list(lines[4].values()) == ["e", "40", "1.230", "57.5", "230.0", "115.0", "184.0", "30.0", "8.0", "115"]
    goals = {goal.key: (goal.measured, goal.verdict) for goal in report.goals}
    assert goals == {
        "recording.ratio": (1.05, "met"),
        "recording.frame": (30.0, "met"),
        "recording.all": (110.0, "missed"),  # of c
        "recording.short": (230.0, "missed"),  # of e
    }
    empty, short = report.notes
    assert re.match(r"Nobody can record fewer than \d+ frames within 100 us a frame: .* take [\d.]+ ms\.$", empty)
    assert "fewer than 100 frames take 89 to 184 us a frame: the rerun library beside the MCAP log" in short
    monkeypatch.setattr(recording, "on", made_up(frames, 0.0, 101e-6))
    report = recording.run(scenes=("b",), rounds=1)
    assert report.grids[recording.COSTS].lines[0]["frames from which it is met"] == "never"
    verdicts = [goal.verdict for goal in report.goals]
    assert verdicts == ["not measured", "missed", "missed", "not measured"]


def test_a_wrong_recording_is_never_a_fast_one(monkeypatch):
    def failed(name):
        frames = {method: 700 if method in (recording.MORE_PLAIN, recording.MORE_BOTH) else 300 for method in METHODS}
        return [row(name, m, frames[m], 0.1, failed=m != recording.LOG) for m in METHODS]

    monkeypatch.setattr(recording, "shipped", lambda _: None)
    monkeypatch.setattr(recording, "on", lambda name, *_: failed(name))
    assert {goal.verdict for goal in recording.run(rounds=1).goals} == {"wrong"}


def test_every_scene_that_is_shipped_is_in_the_benchmark():
    found = [path for folder in (shipped.FOLDER, shipped.FOLDER / "experiments") for path in folder.glob("*.yaml")]
    swept = "carm_bodyguard_reaction"  # its cases are carm_bodyguard_stops with another number
    names = {str(path.relative_to(shipped.FOLDER).with_suffix("")) for path in found} - {"rules", swept}
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
    assert [goal.verdict for goal in report.goals] == ["not measured"] * 4


def test_diffs_are_right_and_promise_nothing_on_few_frames():
    report = diff.run(frames=40)
    assert [line["verdict"] for line in report.grids[diff.TABLE].lines] == ["right", "right"]
    assert [goal.verdict for goal in report.goals] == ["not measured"] * 3


def test_commands_start_and_load_nothing_heavy():
    report = start.run(rounds=1, first_runs=False)
    assert [goal.key for goal in report.goals] == ["start.help", "start.validate", "start.modules"]
    assert report.goals[2].verdict == "met"
    assert all(goal.measured > 0.0 for goal in report.goals[:2])


@pytest.mark.parametrize("command", [["-c", "raise SystemExit(3)"]])
def test_a_command_that_fails_has_no_time(command):
    assert start._seconds(command) != start._seconds(command)
