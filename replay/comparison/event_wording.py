"""Events that differ, in words: "contact 33 ms later", "contact appears at 3.2 s, until 3.4 s"."""

from __future__ import annotations

from collections.abc import Sequence

from replay.comparison import quantities
from replay.comparison.difference import EventDifference, Fate, SignalDifference


def worst_event(item: SignalDifference) -> str:
    """Return "detection appears, at 3.2 s" of an event that one run has alone, else what has shifted most."""
    wrong = [event for event in item.events if not event.allowed] or list(item.events)
    alone = [event for event in wrong if event.fate is not Fate.SHIFTED]
    if not alone:
        return shifted(most_shifted(wrong))
    event = alone[0]
    at = event.baseline or event.candidate
    assert at is not None
    what = event.what.removesuffix(" begins")
    if event.what.endswith(" begins"):
        return f"{what} {'appears' if event.fate is Fate.APPEARED else 'vanishes'}, {_when(event, at.time)}"
    new = event.fate is Fate.APPEARED
    if event.what.endswith(" ends"):
        return f"{event.what.removesuffix(' ends')} {'ends' if new else 'no longer ends'} at {at_time(at.time)}"
    return f"{what} {'only in this run' if new else 'no longer'}, {_when(event, at.time)}"


def _when(event: EventDifference, time: float) -> str:
    return f"at {at_time(time)}" if event.fate is Fate.APPEARED else f"was at {at_time(time)}"


def lone_contact(events: Sequence[EventDifference]) -> str:
    """Return "contact appears at 3.2 s, until 3.4 s" of beginnings and ends that one run has alone."""
    first = next((event for event in events if event.what == "contact begins"), events[0])
    at = first.baseline or first.candidate
    assert at is not None
    gone = first.fate is Fate.VANISHED
    if first.what == "contact begins":
        ends = (event for event in events if event.what == "contact ends" and event.fate is first.fate)
        until = next((end for end in ((e.baseline or e.candidate) for e in ends) if end and end.time >= at.time), None)
        ended = "" if until is None else f", until {at_time(until.time)}"
        return f"contact {'vanishes, was' if gone else 'appears'} at {at_time(at.time)}{ended}"
    return f"contact {'no longer ends, did' if gone else 'ends'} at {at_time(at.time)}"


def most_shifted(events: Sequence[EventDifference]) -> EventDifference:
    """Return the event that both runs have at moments farthest apart."""
    return max(events, key=lambda event: abs(event.shift or 0.0))


def shifted(event: EventDifference) -> str:
    """Return "contact 33 ms later" of a beginning and "contact ends 33 ms later" of an end."""
    shift = event.shift or 0.0
    if not shift and event.shift_frames:
        shift = float(event.shift_frames)
    much = f"{quantities.shown(abs(shift), 's')} {'later' if shift > 0 else 'earlier'}"
    return f"{event.what.removesuffix(' begins')} {much}"


def at_time(seconds: float) -> str:
    """Return a moment [s] in words."""
    return f"{seconds:.6g} s"
