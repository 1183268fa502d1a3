"""Rules that would make two runs the same: the tightest, for a person to review."""

from __future__ import annotations

import json
from collections.abc import Iterator
from decimal import ROUND_CEILING, Decimal

from replay.comparison import wording
from replay.comparison.difference import Difference, SignalDifference
from replay.comparison.rules import EXACT
from replay.comparison.runs import RunDifference
from replay.errors import count
from replay.language.globs import literal_glob

MARK = "REVIEW"
"""Begins the reason of every suggested rule."""

_LEAST = 1e-300
"""Tolerance for rotations whose quaternions differ by less than any angle shows."""


def suggest(found: RunDifference) -> str:
    """Return a rules file with the tightest tolerances, rounded up to two digits, that accept what differs.

    Of several scenarios, a signal gets the largest of what each needs. Where no tolerance helps (an event in one run
    only, NaN in place of a number, a missing signal) a comment says so and no rule is proposed: that is for a person to
    understand first.
    """
    needed: dict[str, list[SignalDifference]] = {}
    for case in found.cases:
        for item in case.difference.deciding:
            needed.setdefault(item.signal.full_name, []).append(item)
    rules: dict[tuple[str, ...], list[str]] = {}
    hopeless = []
    for name, items in sorted(needed.items()):
        reasons = dict.fromkeys(reason for item in items for reason in _beyond_tolerance(item))
        if reasons:
            hopeless.append(f"{name}: {', '.join(reasons)}")
        else:
            rules.setdefault(tuple(_tolerance(items)), []).append(name)
    for case in found.cases:
        hopeless.extend(f"{case.name}: {line}" for line in _structure(case.difference))
    hopeless.extend(f"scenario {one.name}: {one.error}" for one in found.unreadable)
    alone = [name for name in (*found.missing, *found.extra) if name not in found.ignored]
    hopeless.extend(f"scenario {name}: in one run only" for name in alone)
    return "\n".join([*_head(found), *_rules(rules), *_comments(hopeless)]) + "\n"


def round_up(value: float) -> str:
    """Return the smallest decimal with two significant digits that is not below a positive number.

    The double that reads back from it is not below the number either: rounding keeps the order.
    """
    exact = Decimal(value)
    step = Decimal(1).scaleb(exact.adjusted() - 1)
    return f"{exact.quantize(step, rounding=ROUND_CEILING):.1e}"


def _beyond_tolerance(item: SignalDifference) -> Iterator[str]:
    if item.lone_events:
        yield count(item.lone_events, "event") + " in one run only"
    if item.nan:
        yield count(item.nan, "frame") + " with NaN"
    if item.infinite:
        yield count(item.infinite, "frame") + " with an infinity"
    zero = item.worst_abs is not None and item.worst_abs.error == 0.0
    if item.rule is not None and item.rule.tolerance.zero == "signed" and zero:
        yield "0.0 and -0.0 under `zero: signed`"


def _tolerance(items: list[SignalDifference]) -> Iterator[str]:
    """Yield the lines of a rule that accepts a signal; it keeps what the signal's present rule says of NaN and zero."""
    present = items[0].rule.tolerance if items[0].rule is not None else EXACT
    if items[0].event_count:
        frames, shift = (max(getattr(item, name) for item in items) for name in ("max_shift_frames", "max_shift"))
        yield f"time: {count(frames, 'frame')}" if frames else f"time: {round_up(shift)}"
        if frames and present.bracket is not None:
            yield f"bracket: {round_up(shift)}"
        return
    worst = max(item.worst_abs.error for item in items if item.worst_abs is not None)
    relative = [item.worst_rel.error for item in items if item.worst_rel is not None]
    instead = f"  # or rel: {round_up(max(relative))}" if relative and max(relative) > 0.0 else ""
    yield f"abs: {round_up(max(worst, _LEAST))}{instead}"
    if present.rms is not None:
        yield f"rms: {round_up(max([_LEAST, present.rms, *(item.rms for item in items if item.rms is not None)]))}"
    if present.nan != EXACT.nan:
        yield f"nan: {present.nan}"
    if present.zero != EXACT.zero:
        yield f"zero: {present.zero}"


def _structure(found: Difference) -> Iterator[str]:
    yield from (wording.change(change) for change in found.scene)
    yield from wording.frames(found.frames) if found.frames.decides else ()
    for where, items in (("missing", found.missing), ("extra", found.extra)):
        yield from (wording.absence(item, where) for item in items if item.decides)


def _head(found: RunDifference) -> Iterator[str]:
    yield "# Suggested by `replay diff --suggest-rules`: the tightest tolerances with which"
    yield f"# {json.dumps(found.candidate)} passes against {json.dumps(found.baseline)}."
    yield "# Review each: is the difference meant? Then say why in the rule's reason, and move the rule to the top of"
    yield "# your rules. If not, leave it out: it would hide a fault."
    yield "rules_version: 1"


def _rules(rules: dict[tuple[str, ...], list[str]]) -> Iterator[str]:
    if not rules:
        yield "rules: []"
        return
    yield "rules:"
    for lines, names in rules.items():
        yield "  - signal:"
        yield from (f"      - {json.dumps(literal_glob(name))}" for name in names)
        yield from (f"    {line}" for line in lines)
        yield f'    reason: "{MARK}: say why this difference is acceptable"'


def _comments(hopeless: list[str]) -> Iterator[str]:
    if hopeless:
        yield "# No tolerance accepts these; understand them first:"
        yield from (f"#   {json.dumps(line)}" for line in hopeless)
