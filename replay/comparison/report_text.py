"""The difference as text for people: short by default, everything with `verbose`."""

from __future__ import annotations

from collections.abc import Iterator

from replay.comparison import wording
from replay.comparison.difference import Change, Difference, DiffVerdict, SignalDifference
from replay.comparison.effects import effects, headline
from replay.comparison.runs import Case, RunDifference
from replay.errors import count, printable

SHOWN_SIGNALS = 12
"""Signals of a scenario in the short form."""


def text(found: RunDifference, *, verbose: bool = False) -> str:
    """Return the report, ending in a newline; control characters in names are written as escapes."""
    return "".join(f"{printable(line)}\n" for line in lines(found, verbose=verbose))


def lines(found: RunDifference, *, verbose: bool = False) -> Iterator[str]:
    """Yield the lines of the report, with names as they are."""
    alone = [*found.missing, *found.extra]
    several = len(found.cases) + len(found.unreadable) + len(alone) > 1
    above: tuple[Change, ...] = ()
    for case in found.cases:
        yield from _case(case, verbose, above)
        above = case.difference.provenance or above
    yield from (f"{DiffVerdict.UNREADABLE.value}: {one.name}: {one.error}" for one in found.unreadable)
    for where, names in (("missing in the candidate", found.missing), ("only in the candidate", found.extra)):
        for name in names:
            yield f"scenario {name}: {where}{' [ignored]' if name in found.ignored else ''}"
    if several:
        yield f"{found.verdict.value}: {wording.totals(found)}"


def _case(case: Case, verbose: bool, above: tuple[Change, ...]) -> Iterator[str]:
    """Yield the lines of a scenario; `above` is the provenance that was written last."""
    found = case.difference
    yield f"{found.verdict.value}: {case.name}: {wording.summary(found)}"
    if found.verdict is DiffVerdict.DIFFERENT:
        yield from (f"  worst: {line}" for line in [headline(effects(found))] if line)
    repeats = found.provenance == above
    if found.provenance and (verbose or not repeats or found.verdict is DiffVerdict.DIFFERENT):
        decides = "decides" if found.strict_provenance else "does not decide"
        yield f"  provenance ({decides}){': as above' if repeats else ''}"
        if not repeats:
            yield from (f"    {wording.change(change)}" for change in found.provenance)
    if found.scene:
        yield "  scene"
        yield from (f"    {wording.change(change)}" for change in found.scene)
    yield from (f"  {line}" for line in wording.frames(found.frames))
    for where, items in (("missing", found.missing), ("extra", found.extra)):
        for item in items:
            yield f"  {wording.absence(item, where)}"
            if verbose:
                yield from (f"    {signal.full_name}" for signal in item.signals)
    yield from _signals(found, verbose)
    yield from (f"  {wording.expired(rule)}" for rule in found.expired)


def _signals(found: Difference, verbose: bool) -> Iterator[str]:
    shown = found.signals if verbose else found.deciding[:SHOWN_SIGNALS]
    for item in shown:
        yield f"  {'changed' if item.decides else 'within the rules'}: {item.signal.full_name}"
        yield from (f"    {line}" for line in _details(item, found, verbose))
    hidden = len(found.deciding) - len(shown)
    if hidden > 0:
        yield f"  and {count(hidden, 'more changed signal')}; -v lists all"


def _details(item: SignalDifference, found: Difference, verbose: bool) -> Iterator[str]:
    yield from wording.signal(item, found.frames.matched, events=None if verbose else wording.SHOWN_EVENTS)
    if verbose:
        yield wording.rule(item.rule)
    elif item.rule is not None:
        yield f"rule {wording.tolerance(item.rule)}"
