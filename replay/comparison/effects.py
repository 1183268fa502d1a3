"""What differs, as what people see of it: one effect for each pair, sensor, guard and motion, the worst first.

What only follows from a reading (which triangle, which case, whether a clearance was evaluated, coordinates of the
point) is folded under the reading it belongs to and counted once with it.
"""

from __future__ import annotations

import enum
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from replay.collision.columns import CollisionColumns
from replay.comparison import quantities
from replay.comparison.difference import Difference, Fate, SignalDifference
from replay.comparison.event_wording import at_time, lone_contact, most_shifted, shifted, worst_event
from replay.comparison.rules import EXACT
from replay.errors import count
from replay.guarding.columns import GuardColumns
from replay.sensing.kinds import KINDS


class Severity(enum.IntEnum):
    """How much an effect matters, the worst first."""

    BROKEN = 0  # an expectation does not hold
    CRASHED = 1  # there is no result
    CONTACT = 2  # a contact appears or vanishes
    CONTACT_TIME = 3  # a contact begins or ends at another time
    CLEARANCE = 4
    READING = 5  # of a sensor, or how something moves
    UNCOMPARED = 6  # there is nothing to compare with
    BOOKKEEPING = 7  # nothing that is measured

    @property
    def words(self) -> str:
        """What it is called on pages."""
        return _WORDS[self]


_WORDS = {
    Severity.BROKEN: "broken expectation",
    Severity.CRASHED: "no result",
    Severity.CONTACT: "contact appears or vanishes",
    Severity.CONTACT_TIME: "contact moves in time",
    Severity.CLEARANCE: "clearance",
    Severity.READING: "reading",
    Severity.UNCOMPARED: "nothing to compare with",
    Severity.BOOKKEEPING: "bookkeeping",
}


@dataclass(frozen=True)
class Effect:
    """What differs of one pair, one sensor, one guard, or the motion.

    Attributes:
        severity: how much it matters.
        size: how large it is, in tolerances.
        text: in words and numbers: "contact 33 ms later".
        subject: the pair, the sensor, the guard, the joint or the link: "forearm/tube | person/body".
        signals: full names of all signals that differ of it, the one that the text is about first.
        at: the moment to look at [s]; None where there is none.
    """

    severity: Severity
    size: float
    text: str
    subject: str = ""
    signals: tuple[str, ...] = ()
    at: float | None = None

    def __str__(self) -> str:
        return f"{self.text}: {self.subject}" if self.subject else self.text


_COLLISION = "/collision"
_MOTION = ("/joint_states", "/tf")
_GUARDS = "/guards"
_ABOUT_A_PAIR = ("between", "evaluated", "clearance_bound")
"""What only says how a pair's clearance is known."""
_OF_GUARDS = [field.name for field in GuardColumns.fields() if field.each == "guards"]


def effects(found: Difference, limits: Mapping[str, float] | None = None) -> tuple[Effect, ...]:
    """Return what decides of a difference, the worst first.

    Args:
        found: the difference.
        limits: smallest clearances [m] that are expected, by pair.
    """
    by_item: dict[tuple[str, str], list[SignalDifference]] = {}
    for item in found.deciding:
        by_item.setdefault(_key(item), []).append(item)
    told = [_effect(key, items, limits or {}) for key, items in by_item.items()]
    told += [*_absences(found), *_of_the_scene(found)]
    return tuple(sorted(told, key=lambda effect: (effect.severity, -effect.size, effect.subject)))


def headline(found: Sequence[Effect]) -> str:
    """Return the worst effect, and how many more there are: "contact 33 ms later: a/b | c/d; 3 more readings".

    Bookkeeping is not counted beside what is measured.
    """
    if not found:
        return ""
    more = sum(effect.severity is not Severity.BOOKKEEPING for effect in found[1:])
    return f"{found[0]}; {count(more, 'more reading')}" if more else str(found[0])


def _key(item: SignalDifference) -> tuple[str, str]:
    """Return what a signal is of: a topic, and a pair or a guard on it; the clocks of joints belong to the motion."""
    topic = item.signal.topic
    if topic in _MOTION or (topic == _GUARDS and item.signal.field not in _OF_GUARDS):
        return "motion", ""
    return topic, item.signal.name if topic in (_COLLISION, _GUARDS) else ""


def _effect(key: tuple[str, str], items: list[SignalDifference], limits: Mapping[str, float]) -> Effect:
    topic, name = key
    if topic == "motion":
        worst, text = _motion(items)
        severity, subject = Severity.READING, worst.signal.name
    elif topic == _COLLISION:
        severity, worst, text = _pair(items, limits.get(name))
        subject = name.replace("|", " | ")
    elif topic == _GUARDS:
        worst = _first_of(items, ("condition", "state", "factor"))
        severity, text, subject = Severity.READING, f"guard: {_any(worst)}", name
    else:
        severity, worst, text = _sensor(items)
        subject = topic.split("/", 2)[2]
    rest = (item.signal.full_name for item in items if item is not worst)
    return Effect(severity, size(worst), text, subject, (worst.signal.full_name, *rest), _moment(worst))


def _moment(item: SignalDifference) -> float:
    """Return when a signal differs in the way that matters: at the event that is told, or its worst value."""
    wrong = [event for event in item.events if not event.allowed]
    if wrong:
        told = next((event for event in wrong if event.fate is not Fate.SHIFTED), most_shifted(wrong))
        at = told.candidate or told.baseline
        assert at is not None
        return at.time
    return item.first.time if item.worst_abs is None else item.worst_abs.at.time


def size(item: SignalDifference) -> float:
    """Return how large a difference is in tolerances; where there is none, in 1e-9 of the value."""
    tolerance = EXACT if item.rule is None else item.rule.tolerance
    if item.spread and item.rms is not None and tolerance.rms is not None and not item.outside:
        return item.rms / max(tolerance.rms, 1e-300)
    if item.event_count:
        if item.lone_events:
            return 1e6 * max(item.frames, 1)
        if item.max_shift_frames:
            return item.max_shift_frames / max(tolerance.frames, 1)
        return item.max_shift / max(tolerance.bracket or tolerance.time, 1e-6)
    worst = item.worst_abs
    if worst is None:
        return math.inf
    scale = max(abs(worst.baseline), abs(worst.candidate))
    return worst.error / max(tolerance.abs, tolerance.rel * scale, 1e-9 * scale, 1e-300)


def _pair(items: Sequence[SignalDifference], limit: float | None) -> tuple[Severity, SignalDifference, str]:
    """Return what matters most of a pair of shapes, the signal that says so, and the words for it."""
    by_field = {item.signal.field: item for item in items}
    level = by_field.get("level")
    if level is not None:
        contacts = [event for event in level.events if event.what.startswith("contact ") and not event.allowed]
        alone = [event for event in contacts if event.fate is not Fate.SHIFTED]
        if alone:
            return Severity.CONTACT, level, lone_contact(alone)
        if contacts:
            return Severity.CONTACT_TIME, level, shifted(most_shifted(contacts))
    if "undecided" in by_field:
        return Severity.CONTACT, by_field["undecided"], worst_event(by_field["undecided"])
    clearance = by_field.get("clearance")
    if clearance is not None and (clearance.worst_abs is not None or clearance.nan):
        return Severity.CLEARANCE, clearance, _clearance(clearance, limit)
    near = by_field.get("evaluated")
    if near is not None and near.lone_events:
        bound = by_field.get("clearance_bound", near)
        return Severity.CLEARANCE, bound, _nearness(near, bound, limit)
    if level is not None:
        return Severity.READING, level, worst_event(level)
    first = _first_of(items, _ABOUT_A_PAIR)
    return Severity.BOOKKEEPING, first, _any(first)


def _nearness(near: SignalDifference, bound: SignalDifference, limit: float | None) -> str:
    """Return how a pair comes within the margin, or leaves it, in one run alone, and what is proven of its way."""
    event = next(event for event in near.events if event.fate is not Fate.SHIFTED)
    at = event.baseline or event.candidate
    assert at is not None
    comes = event.what.endswith(" begins") is (event.fate is Fate.APPEARED)
    proven = "clearance" if bound.least is None else f"proven clearance {quantities.change(*bound.least, 'm')},"
    return f"{proven} {'comes within' if comes else 'leaves'} the margin at {at_time(at.time)}{_expected(limit)}"


def _expected(limit: float | None) -> str:
    return "" if limit is None else f" (limit {quantities.shown(limit, 'm')})"


def _clearance(item: SignalDifference, limit: float | None) -> str:
    expected = _expected(limit)
    worst, least = item.worst_abs, item.least
    if worst is None:
        return f"clearance known in one run only, in {count(item.nan, 'frame')}{expected}"
    tolerance = worst.error * 1e-3
    if least is not None and abs(least[0] - least[1]) > tolerance:
        return f"smallest clearance {quantities.change(*least, 'm')}{expected}"
    return f"clearance {quantities.change(worst.baseline, worst.candidate, 'm')} at {at_time(worst.at.time)}{expected}"


def _sensor(items: Sequence[SignalDifference]) -> tuple[Severity, SignalDifference, str]:
    kind = KINDS[items[0].signal.topic.split("/")[1]]
    gates = {field.gate for field in kind.columns.fields() if field.gate}
    main = [field.name for field in kind.columns.fields() if field.chart]
    other = [field.name for field in kind.columns.fields() if field.unit and not field.letters and not field.each]
    states = [field.name for field in kind.columns.fields() if field.events or field.begins]
    gate = next((item for item in items if item.signal.field in gates and item.event_count), None)
    if gate is not None:
        return Severity.READING, gate, worst_event(gate)
    for names in (main, states, other):
        chosen = [item for item in items if item.signal.field in names]
        if chosen:
            worst = max(chosen, key=size)
            return Severity.READING, worst, _any(worst)
    worst = max(items, key=size)
    return Severity.BOOKKEEPING, worst, _any(worst)


def _motion(items: Sequence[SignalDifference]) -> tuple[SignalDifference, str]:
    """Return what moves most differently: a joint where one does, whose links follow, else a link."""
    positions = [item for item in items if item.signal.field == "position"]
    worst = max(positions or items, key=size)
    what = "link" if worst.signal.topic == "/tf" else "joint"
    others = len({item.signal.name for item in items if item.signal.topic == worst.signal.topic}) - 1
    more = f" ({count(others, f'more {what}')} differently too)" if others else ""
    return worst, f"{what} {_any(worst)}{more}"


def _first_of(items: Sequence[SignalDifference], fields: Sequence[str]) -> SignalDifference:
    order = {name: k for k, name in enumerate(fields)}
    return min(items, key=lambda item: order.get(item.signal.field, len(order)))


def _any(item: SignalDifference) -> str:
    """Return how a signal differs in words and numbers."""
    if item.event_count:
        return worst_event(item)
    name = _label(item)
    if item.worst_abs is None:
        return f"{name} has no number in one run, first at {at_time(item.first.time)}"
    worst = item.worst_abs
    return f"{name} {quantities.signed(worst.candidate - worst.baseline, item.signal.unit)} at {at_time(worst.at.time)}"


def _label(item: SignalDifference) -> str:
    """Return what sentences call a field."""
    kind = KINDS.get(item.signal.topic.split("/")[1])
    columns = kind.columns if kind else CollisionColumns if item.signal.topic == _COLLISION else None
    spoken = {field.name: field.spoken for field in columns.fields()} if columns else {}
    return spoken.get(item.signal.field, item.signal.field.replace("_", " "))


def _absences(found: Difference) -> Iterator[Effect]:
    for where, items in (("is gone", found.missing), ("is new", found.extra)):
        for item in items:
            if item.decides:
                names = tuple(signal.full_name for signal in item.signals)
                told = all(s.topic == _COLLISION and s.field in _ABOUT_A_PAIR for s in item.signals)
                severity = Severity.BOOKKEEPING if told else Severity.READING
                yield Effect(severity, math.inf, f"{item.label} {where}", "", names)
    if found.frames.decides:
        for number, where in ((found.frames.missing, "missing"), (found.frames.extra, "more")):
            if number:
                yield Effect(Severity.READING, float(number), f"{count(number, 'frame')} {where}")


def _of_the_scene(found: Difference) -> Iterator[Effect]:
    if found.scene:
        names = tuple(change.name for change in found.scene)
        more = f" and {len(names) - 1} more" if len(names) > 1 else ""
        yield Effect(Severity.BOOKKEEPING, float(len(names)), f"scene: {names[0]}{more} changed", "", names)
