"""Something happens earlier, later, once more or not at all; the diff finds one event, and its readings are echoes."""

import dataclasses

import numpy as np
import pytest

from replay.comparison.diff import compare
from replay.comparison.difference import DiffVerdict, Fate
from replay.recording.events import Events, Transition
from tests.comparison import made_up
from tests.comparison.made_up import altered
from tests.comparison.planted import BASELINE, PAIR, changed, rules


def test_other_event_messages_of_equal_columns_are_a_difference():
    what = Transition("contact", True, PAIR, "/collision")
    time, frame = BASELINE.time[[40, 60]], np.array([40, 60])
    events = Events(time, frame, np.array([0, 1]), (what, dataclasses.replace(what, begins=False)))
    base = dataclasses.replace(BASELINE, events=events)
    assert compare(base, dataclasses.replace(BASELINE, events=events)).verdict is DiffVerdict.SAME
    others = {
        "2 events, 1 of them only here -> 1 event": events[:1],
        "2 events, 2 of them only here -> 0": Events.none(),
        "a frame": dataclasses.replace(events, frame=frame + 1),
        "a time": dataclasses.replace(events, time=time + 1),
        "a subject": dataclasses.replace(events, transitions=(what, dataclasses.replace(what, subject="x"))),
        "an order": events[::-1],
    }
    for other in others.values():
        found = compare(base, dataclasses.replace(BASELINE, events=other))
        assert found.verdict is DiffVerdict.DIFFERENT
        (change,) = found.scene
        assert change.name == "/events"
        only = len([event for event in events if event not in list(other)])
        assert change.baseline == f"2 events, {only} of them only here"
        assert change.candidate.startswith(f"{len(other)} events, ")
        assert (
            compare(base, dataclasses.replace(BASELINE, events=other), rules=rules("/events", ignore=True)).scene == ()
        )

    def move(recording):
        recording.joint_positions[5, 0] += 1.0

    found = compare(base, dataclasses.replace(altered(BASELINE, move), events=Events.none()))
    assert len(found.signals) == 1 and found.scene == ()  # they follow from what is told


@pytest.mark.parametrize(("begin", "end"), [(41, 60), (42, 60), (40, 61), (39, 60)])
def test_a_shifted_contact_is_one_event(begin, end):
    def shift(recording):
        recording.collision.level[30:70, 0] = 1
        recording.collision.level[begin:end, 0] = 2

    frames = max(abs(begin - 40), abs(end - 60))
    signal = changed(shift)
    assert signal.signal.full_name == f"/collision/level/{PAIR}"
    (event,) = signal.events
    assert event.what == ("contact begins" if begin != 40 else "contact ends")
    assert event.fate is Fate.SHIFTED
    assert abs(event.shift_frames) == frames
    assert (event.baseline.frame, event.candidate.frame) == ((40, begin) if begin != 40 else (60, end))
    assert event.shift == pytest.approx((begin - 40 + end - 60) / made_up.RATE, abs=2e-9)
    allowed = compare(BASELINE, altered(BASELINE, shift), rules=rules("*/level/*", frames=frames))
    assert allowed.verdict is DiffVerdict.SAME
    assert allowed.accepted[0].events[0].allowed
    less = rules("*/level/*", time=0.9 * frames / made_up.RATE)
    assert compare(BASELINE, altered(BASELINE, shift), rules=less).verdict is DiffVerdict.DIFFERENT
    more = rules("*/level/*", time=frames / made_up.RATE)
    assert compare(BASELINE, altered(BASELINE, shift), rules=more).verdict is DiffVerdict.SAME


def test_a_contact_that_vanishes_or_appears_is_never_a_shift():
    def vanish(recording):
        recording.collision.level[made_up.CONTACT, 0] = 1

    def appear(recording):
        recording.collision.level[35, 0] = 2

    signal = changed(vanish, rules=rules("*", frames=1000))
    assert [(event.what, event.fate) for event in signal.events] == [
        ("contact begins", Fate.VANISHED),
        ("contact ends", Fate.VANISHED),
    ]
    signal = changed(appear, rules=rules("*", frames=1000))
    assert [(event.what, event.fate, event.candidate.frame) for event in signal.events] == [
        ("contact begins", Fate.APPEARED, 35),
        ("contact ends", Fate.APPEARED, 36),
    ]


def test_a_later_detection_is_one_event_and_its_readings_are_echoes():
    def later(recording):
        recording.distance.status[10:13, 0] = 0
        for name in ("distance", "point", "point_sensor", "normal"):
            getattr(recording.distance, name)[10:13, 0] = np.nan
        recording.distance.shape[10:13, 0] = recording.distance.triangle[10:13, 0] = -1
        recording.distance.case[10:13, 0] = 0

    signal = changed(later)
    assert signal.signal.full_name == "/distance/left/status"
    assert [(event.what, event.shift_frames) for event in signal.events] == [("detection begins", 3)]


def test_later_saturation_is_one_event_and_its_readings_are_echoes():
    def saturate(begin):
        def change(recording):
            columns = recording.capacitive
            columns.saturated[begin:70] = True
            columns.capacitance[begin:70] = columns.per_object[begin:70] = np.inf
            columns.output_voltage[begin:70] = 0.0
            columns.delta_output[begin:70] = 2.5

        return change

    found = compare(altered(BASELINE, saturate(50)), altered(BASELINE, saturate(51)))
    (signal,) = found.signals
    assert [(event.what, event.shift_frames) for event in signal.events] == [("saturation begins", 1)]
