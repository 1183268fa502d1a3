"""Events known by brackets: overlapping ones are the same, and the shift of others is the gap between them."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from replay.collision.columns import Between
from replay.comparison import wording
from replay.comparison.diff import compare
from replay.comparison.difference import DiffVerdict, Fate
from replay.comparison.rules import Rule, Rules, Tolerance
from replay.comparison.runs import Case, RunDifference
from replay.comparison.suggest import suggest
from replay.recording.events import Events, Transition
from tests.comparison import made_up

PAIR = made_up.LAYOUT.pairs[0]
SIGNAL = f"/collision/level/{PAIR}"
MADE = made_up.recording()
KINDS = tuple(Transition("contact", begins, PAIR, "/collision") for begins in (False, True))
SHOWN = np.array([made_up.CONTACT.start, made_up.CONTACT.stop])
OLD = dataclasses.replace(MADE, events=Events(MADE.time[SHOWN], SHOWN, np.array([1, 0]), KINDS))
"""The made-up run as one of format 1, which knows frames only."""
FRAME = int(1e9 / made_up.RATE)
BEGIN, END = (int(OLD.time[frame]) - FRAME // 2 for frame in (made_up.CONTACT.start, made_up.CONTACT.stop))


def proven(moments=((BEGIN, True), (END, False)), *, width=1000, contact=made_up.CONTACT):
    """Return the made-up run as one that looked between its frames: contact begins (True) and ends at moments [ns]."""
    time = OLD.time
    level = np.minimum(OLD.collision.level, 1)
    level[contact, 0] = 2
    between = np.full(level.shape, Between.CLEAR, dtype=np.uint8)
    between[0] = Between.NOT_LOOKED
    latest = np.array([moment for moment, _ in moments], dtype=np.int64)
    frame = np.searchsorted(time, latest)
    between[contact, 0] = between[contact.stop, 0] = Between.CONTACT
    between[frame, 0] = Between.CONTACT
    code = np.array([int(begins) for _, begins in moments], dtype=np.int64)
    return dataclasses.replace(
        OLD,
        collision=dataclasses.replace(
            OLD.collision, level=level, between=between, clearance_bound=np.ones(level.shape)
        ),
        events=Events(latest, frame, code, KINDS, latest - width),
    )


BASELINE = proven()


def rules(**tolerance):
    return Rules(
        (Rule((SIGNAL,), Tolerance(**tolerance), "tested"), Rule(("*between*", "*bound*"), Tolerance(ignore=True), ""))
    )


def level_of(found):
    return next((item for item in found.signals if item.signal.full_name == SIGNAL), None)


@pytest.mark.parametrize("shift", [0, 1, -400, 999, 1000, -1000])
def test_brackets_that_overlap_or_touch_are_the_same(shift):
    found = compare(BASELINE, proven([(BEGIN + shift, True), (END - shift, False)]))
    assert found.verdict is DiffVerdict.SAME and found.signals == () and found.scene == ()


@pytest.mark.parametrize("shift", [1001, -1001, 250_000, -5_000_000])
def test_the_shift_is_the_gap_between_brackets(shift):
    other = proven([(BEGIN + shift, True), (END, False)])
    found = compare(BASELINE, other)
    (event,) = level_of(found).events
    gap = (abs(shift) - 1000) * np.sign(shift)
    assert (event.what, event.fate, event.shift_frames) == ("contact begins", Fate.SHIFTED, 0)
    assert event.shift == pytest.approx(gap * 1e-9, abs=1e-15)
    assert event.baseline.time == BEGIN / 1e9 and event.candidate.time == (BEGIN + shift) / 1e9
    assert f"contact begins {abs(gap) / 1e3:.4g} us {'later' if shift > 0 else 'earlier'}: " in wording.event(event)
    assert found.verdict is DiffVerdict.DIFFERENT
    much = abs(gap) * 1e-9
    for tolerance, verdict in [
        ({"time": 1.01 * much + 1e-9}, DiffVerdict.SAME),
        ({"time": 0.99 * much - 2e-9}, DiffVerdict.DIFFERENT),
        ({"frames": 1}, DiffVerdict.SAME),
        ({"frames": 1, "bracket": 1.01 * much}, DiffVerdict.SAME),
        ({"frames": 1, "bracket": 0.99 * much}, DiffVerdict.DIFFERENT),
    ]:
        if tolerance.get("time", 1.0) > 0.0:
            assert compare(BASELINE, other, rules=rules(**tolerance)).verdict is verdict, tolerance


def test_a_moment_on_the_other_side_of_a_frame_is_as_far_as_its_bracket():
    at = int(OLD.time[made_up.CONTACT.start])
    before, after = (
        proven([(at, True), (END, False)]),
        proven([(at + 1500, True), (END, False)], contact=slice(made_up.CONTACT.start + 1, made_up.CONTACT.stop)),
    )
    (event,) = level_of(compare(before, after, rules=rules())).events
    assert (event.shift_frames, event.shift) == (1, pytest.approx(500e-9))
    assert compare(before, after, rules=rules(bracket=1e-6)).verdict is DiffVerdict.SAME
    assert compare(before, after, rules=rules(bracket=4e-7)).verdict is DiffVerdict.DIFFERENT


def test_a_run_that_knows_frames_only_agrees_with_what_lies_before_its_frame():
    for baseline, candidate in ((OLD, BASELINE), (OLD, proven(width=FRAME // 4))):
        found = compare(baseline, candidate)
        assert found.verdict is DiffVerdict.SAME and found.signals == ()
        assert [change for change in found.provenance if change.name == "/collision"] == [
            dataclasses.replace(found.provenance[-1], candidate="between, clearance_bound (4 signals)")
        ]


def test_a_run_that_knows_frames_only_is_apart_by_what_lies_between_the_brackets():
    later = made_up.altered(OLD, lambda r: r.collision.level.__setitem__((slice(40, 43), 0), 1))  # begins in frame 43
    (event,) = level_of(compare(BASELINE, later, rules=rules())).events
    assert event.shift_frames == 3
    assert event.shift == pytest.approx((OLD.time[42] - BEGIN) * 1e-9, abs=1e-12)


def test_a_contact_that_no_frame_shows_is_a_difference_between_runs_that_look():
    unseen = [(int(OLD.time[80]) - 9_000_000, True), (int(OLD.time[80]) - 6_000_000, False)]
    other = proven([(BEGIN, True), (END, False), *unseen])
    found = compare(BASELINE, other, rules=rules(frames=5, time=1.0))
    assert [(event.what, event.fate, event.candidate.time) for event in level_of(found).events] == [
        ("contact begins", Fate.APPEARED, unseen[0][0] / 1e9),
        ("contact ends", Fate.APPEARED, unseen[1][0] / 1e9),
    ]
    assert found.verdict is DiffVerdict.DIFFERENT
    names = {item.signal.full_name for item in compare(BASELINE, other).signals}
    assert names == {SIGNAL, f"/collision/between/{PAIR}"}
    shifted = proven([(BEGIN, True), (END, False), *((moment + 3000, begins) for moment, begins in unseen)])
    found = compare(other, shifted)
    assert [(event.what, event.shift) for event in level_of(found).events] == [
        ("contact begins", pytest.approx(2e-6)),
        ("contact ends", pytest.approx(2e-6)),
    ]


def test_what_an_older_run_could_not_see_is_added_and_does_not_decide():
    unseen = [(int(OLD.time[80]) - 9_000_000, True), (int(OLD.time[80]) - 6_000_000, False)]
    found = compare(OLD, proven([(BEGIN, True), (END, False), *unseen]))
    assert found.verdict is DiffVerdict.SAME and found.signals == ()
    assert found.provenance[-1].candidate == "between, clearance_bound (4 signals); 1 contact between two frames"


def test_a_run_that_no_longer_looks_lacks_it_once():
    found = compare(BASELINE, OLD)
    assert found.verdict is DiffVerdict.DIFFERENT and found.signals == ()
    assert [(item.label, len(item.signals)) for item in found.missing] == [("/collision between, clearance_bound", 4)]
    assert compare(BASELINE, OLD, rules=rules()).verdict is DiffVerdict.SAME


def test_a_run_that_does_not_look_by_its_model_is_as_one_of_before():
    sampled = dataclasses.replace(
        OLD,
        collision=dataclasses.replace(
            OLD.collision,
            between=np.full(OLD.collision.level.shape, Between.NOT_LOOKED, dtype=np.uint8),
            clearance_bound=np.full(OLD.collision.level.shape, np.nan),
        ),
    )
    assert compare(sampled, BASELINE).verdict is DiffVerdict.SAME
    assert [item.label for item in compare(BASELINE, sampled).missing] == ["/collision between, clearance_bound"]
    found = compare(sampled, sampled)
    assert found.verdict is DiffVerdict.SAME and found.compared == compare(OLD, OLD).compared + 4


def test_what_a_run_says_of_moments_counts_only_where_its_columns_agree():
    forgotten = made_up.altered(BASELINE, lambda r: r.collision.level.__setitem__((slice(40, 42), 0), 1))
    (event,) = level_of(compare(BASELINE, forgotten, rules=rules())).events
    assert (event.what, event.shift_frames) == ("contact begins", 2)


def test_moments_are_matched_in_the_frames_that_both_runs_have():
    kept = np.delete(np.arange(100), [39, 40, 41, 70])
    fewer = made_up.only_frames(BASELINE, kept)
    frame = np.searchsorted(fewer.time, fewer.events.time)
    fewer = dataclasses.replace(fewer, events=dataclasses.replace(fewer.events, frame=frame))
    for baseline, candidate in ((BASELINE, fewer), (fewer, BASELINE)):
        found = compare(baseline, candidate)
        assert found.signals == () and found.frames.matched == 96


def test_a_suggested_rule_accepts_the_shift():
    other = proven([(BEGIN + 251_000, True), (END, False)])
    found = compare(BASELINE, other)
    assert "time: 2.6e-4" in suggest(_runs(found))
    moved = proven([(BEGIN + FRAME, True), (END, False)], contact=slice(41, 60))
    assert "time: 1 frame" in suggest(_runs(compare(BASELINE, moved, rules=rules())))


def _runs(found):
    return RunDifference("a", "b", (Case("made_up", Path("a"), Path("b"), found),))
