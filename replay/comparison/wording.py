"""What differs, in sentences: the words that the text, HTML and JUnit reports share."""

from __future__ import annotations

import re
from collections.abc import Iterator

from replay.comparison.difference import (
    Absence,
    Change,
    Difference,
    EventDifference,
    Fate,
    Frames,
    Moment,
    SignalDifference,
    Worst,
)
from replay.comparison.rules import EXACT, Rule
from replay.comparison.runs import RunDifference
from replay.comparison.signals import ROTATION_FIELD
from replay.errors import count

SHOWN_EVENTS = 5
"""Events of a signal in the short form."""


def number(value: float, unit: str = "") -> str:
    """Return a value with three digits and its unit."""
    return f"{value:.3g} {unit}".rstrip()


def seconds(value: float) -> str:
    """Return a time with as many digits as a frame needs."""
    return f"{value:.10g} s"


def moment(at: Moment) -> str:
    """Return "frame 41 (0.6833 s)"."""
    return f"frame {at.frame} ({seconds(at.time)})"


def change(item: Change) -> str:
    """Return "name: old -> new", with what one run lacks as "-"."""
    return f"{item.name}: {shown(item.baseline)} -> {shown(item.candidate)}"


def shown(value: str | None) -> str:
    """Return a value with digests cut to what tells them apart, and "-" for what a run lacks."""
    return "-" if value is None else re.sub(r"\b([0-9a-f]{12})[0-9a-f]{52}\b", r"\1...", value)


def frames(found: Frames) -> Iterator[str]:
    """Yield what there is to say of frames that only one run has."""
    for number_, at, where in (
        (found.missing, found.first_missing, "missing in the candidate"),
        (found.extra, found.first_extra, "only in the candidate"),
    ):
        if number_ and at is not None:
            yield f"{count(number_, 'frame')} {where}, the first at {moment(at)}; {found.matched} in both"


def absence(item: Absence, where: str) -> str:
    """Return "topic /distance/left (14 signals) missing; ..."; `where` is "missing" or "extra"."""
    text = f"{where}: {item.label} ({count(len(item.signals), 'signal')})"
    if item.same_as is not None:
        topic, name = item.same_as
        text += f"; {f'{topic} {name}'.rstrip()} has exactly the same readings: renamed?"
    if not item.decides:
        text += " [ignored]"
    return text


RUNS = ("baseline", "candidate")
"""What the two sides of a difference are called."""


def event(item: EventDifference, runs: tuple[str, str] = RUNS) -> str:
    """Return one event in words; `runs` are what the sides are called."""
    allowed = " [allowed]" if item.allowed else ""
    if item.fate is Fate.SHIFTED:
        assert item.baseline is not None and item.candidate is not None
        assert item.shift is not None and item.shift_frames is not None
        later = "later" if (item.shift_frames or item.shift) > 0 else "earlier"
        much = f"{abs(item.shift) * 1e6:.4g} us {later}"
        if item.shift_frames:
            much = f"{count(abs(item.shift_frames), 'frame')} {later} ({item.shift * 1e3:+.4g} ms)"
        return f"{item.what} {much}: {moment(item.baseline)} -> {moment(item.candidate)}{allowed}"
    at = item.baseline if item.fate is Fate.VANISHED else item.candidate
    assert at is not None
    where = runs[0] if item.fate is Fate.VANISHED else runs[1]
    return f"{item.what} only in the {where}: {moment(at)}{allowed}"


def signal(
    item: SignalDifference, total: int, *, events: int | None = SHOWN_EVENTS, runs: tuple[str, str] = RUNS
) -> list[str]:
    """Return what a signal says, a line each: counts and first frame, then worst errors or events.

    Args:
        item: the signal.
        total: number of frames that were compared.
        events: how many events to tell; None for all that are kept.
        runs: what the sides are called.
    """
    lines = []
    if item.event_count:
        shifted = item.event_count - item.lone_events
        parts = [f"{count(shifted, 'event')} shifted"] if shifted else []
        parts += [f"{count(item.lone_events, 'event')} in one run only"] if item.lone_events else []
        lines.append(f"{', '.join(parts)}; {item.frames} of {count(total, 'frame')} differ")
        shown = item.events[:events]
        lines.extend(event(one, runs) for one in shown)
        if len(shown) < item.event_count:
            lines.append(f"and {count(item.event_count - len(shown), 'more event')}")
    else:
        within = "" if item.outside == item.frames else f", {item.outside} outside the tolerance"
        lines.append(f"{item.frames} of {count(total, 'frame')} differ{within}; first {moment(item.first)}")
        lines.extend(_worst(item))
        if item.rms is not None:
            above = ", more than the rule accepts" if item.spread else ""
            lines.append(f"root mean square {number(item.rms, item.signal.unit)}{above}")
        if item.nan:
            lines.append(f"{count(item.nan, 'frame')} with NaN in place of a number, or the reverse")
        if item.infinite:
            lines.append(f"{count(item.infinite, 'frame')} with an infinity in one run, or of the other sign")
    if item.echo:
        lines.append(f"{count(item.echo, 'more frame')} without a value in one run, told by the signal that says so")
    return lines


def _worst(item: SignalDifference) -> Iterator[str]:
    unit, largest, relative = item.signal.unit, item.worst_abs, item.worst_rel
    if largest is None:
        return
    together = relative is not None and relative.at == largest.at
    also = f" (rel {number(relative.error)})" if together and relative is not None else ""
    yield f"worst abs {number(largest.error, unit)}{also} at {moment(largest.at)}{_values(item, largest)}"
    if relative is not None and not together:
        yield f"worst rel {number(relative.error)} at {moment(relative.at)}{_values(item, relative)}"


def _values(item: SignalDifference, found: Worst) -> str:
    if item.signal.field == ROTATION_FIELD.name:  # the angle between the two says it all
        return ""
    return f": {found.baseline!r} -> {found.candidate!r} {item.signal.unit}".rstrip()


def rule(item: Rule | None) -> str:
    """Return which rule was applied, and why it is there."""
    if item is None:
        return "no rule: exact"
    link = f" ({item.link})" if item.link else ""
    until = f", until {item.expires.isoformat()}" if item.expires else ""
    only = f" of {', '.join(item.scenarios)}" if item.scenarios else ""
    return f"rule {tolerance(item)}{only}{until}: {item.reason.strip()}{link}"


def tolerance(item: Rule) -> str:
    """Return what a rule accepts, and where it is written."""
    default, given = EXACT, item.tolerance
    parts = ["ignored"] if given.ignore else []
    parts += [f"{key} {getattr(given, key):g}" for key in ("abs", "rel") if getattr(given, key)]
    parts += [f"rms {given.rms:g}"] if given.rms is not None else []
    parts += [f"time {seconds(given.time)}"] if given.time else []
    parts += [f"time {count(given.frames, 'frame')}"] if given.frames else []
    parts += [f"bracket {seconds(given.bracket)}"] if given.bracket is not None else []
    parts += [
        f"{key}: {getattr(given, key)}" for key in ("nan", "zero") if getattr(given, key) != getattr(default, key)
    ]
    return f"{', '.join(parts) or 'exact'}{f' ({item.place})' if item.place else ''}"


def expired(item: Rule) -> str:
    """Return that a rule no longer applies."""
    assert item.expires is not None
    return f"expired on {item.expires.isoformat()}, no longer applies: {', '.join(item.signals)}: {item.reason.strip()}"


def totals(found: RunDifference) -> str:
    """Return "1 of 3 scenarios differ, 0 missing, 0 extra", and how many are unreadable if any."""
    unreadable = f", {len(found.unreadable)} unreadable" if found.unreadable else ""
    differ = f"{len(found.different)} of {count(len(found.cases), 'scenario')} differ"
    return f"{differ}, {len(found.missing)} missing, {len(found.extra)} extra{unreadable}"


def summary(found: Difference) -> str:
    """Return the difference in one line."""
    parts = []
    if found.scene:
        parts.append(f"{count(len(found.scene), 'change')} of the scene")
    if found.frames.missing or found.frames.extra:
        ignored = "" if found.frames.decides else " (ignored)"
        parts.append(f"{count(found.frames.missing + found.frames.extra, 'frame')} in one run only{ignored}")
    for where, items in (("missing", found.missing), ("extra", found.extra)):
        for decides, ignored in ((True, ""), (False, " (ignored)")):
            total = sum(len(item.signals) for item in items if item.decides is decides)
            parts += [f"{count(total, 'signal')} {where}{ignored}"] if total else []
    if found.deciding:
        parts.append(f"{len(found.deciding)} of {count(found.compared, 'signal')} changed")
    if found.accepted:
        parts.append(f"{count(len(found.accepted), 'signal')} within the rules")
    if found.expired:
        parts.append(f"{count(len(found.expired), 'expired rule')} would have applied")
    if found.provenance:
        parts.append(f"{count(len(found.provenance), 'difference')} of provenance")
    return ", ".join(parts) or f"all {count(found.compared, 'signal')} equal in {count(found.frames.matched, 'frame')}"
