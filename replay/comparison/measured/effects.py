"""What people see of a comparison with the machine: the worst of each signal that is off, in a line."""

from __future__ import annotations

from replay.comparison import effects, quantities, wording
from replay.comparison.effects import Effect, Severity
from replay.comparison.measured.result import MeasuredComparison, MeasuredSignal
from replay.comparison.signals import Signal


def effects_of(found: MeasuredComparison) -> tuple[Effect, ...]:
    """Return an effect for each signal that is further off than the rules accept, the worst first."""
    told = [_of(signal) for signal in found.signals if signal.decides]
    told += [_absent(one) for absence in found.difference.missing if absence.decides for one in absence.signals]
    return tuple(sorted(told, key=lambda effect: -effect.size))


def worst(found: MeasuredComparison) -> str:
    """Return the worst of them in words, and how many more there are."""
    first, *others = effects_of(found)
    more = f", and {len(others)} more" if others else ""
    return f"{first}{more}"


def _of(signal: MeasuredSignal) -> Effect:
    item = max((one for one in signal.differences if one.decides), key=effects.size)
    name, numbers = signal.signal.full_name, signal.statistics
    if item.event_count:
        text = wording.event(next((event for event in item.events if not event.allowed), item.events[0]), RUNS)
        at = item.first.time
    else:
        at = float(signal.matched.pair.time[numbers.frame])
        off = quantities.signed(numbers.largest, signal.signal.unit)
        rms = quantities.shown(numbers.rms, signal.signal.unit)
        text = f"measured {off} off at {wording.seconds(at)}, rms {rms}"
    return Effect(Severity.READING, effects.size(item), text, name, (name,), at)


def _absent(signal: Signal) -> Effect:
    name = signal.full_name
    return Effect(Severity.READING, 1e6, "no sample in the scenario's time", name, (name,), None)


RUNS = ("log", "simulation")
"""What the sides of a difference are called."""
