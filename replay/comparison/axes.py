"""What the axes of a drawing say: times, values in units that suit them, names of states, values under the pointer."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from replay.comparison import quantities
from replay.numerics.arrays import Floats

_TICKS = 6
_COLUMNS = 40
"""Parts of the time in each of which a drawing tells its values under the pointer."""

Mark = tuple[float, str]
"""A place on an axis [px], and what is written there."""


def time_ticks(begin: float, end: float, width: float) -> tuple[Mark, ...]:
    """Return round times from begin to end [s], and where they are on an axis of a width [px]."""
    span = end - begin
    if not span > 0.0:
        return ((0.0, f"{begin:.6g} s"),)
    step = 10.0 ** math.floor(math.log10(span / _TICKS))
    step = next(step * k for k in (1, 2, 5, 10) if span / (step * k) <= _TICKS)
    first = math.ceil(begin / step - 1e-9)
    last = math.floor(end / step + 1e-9)
    return tuple(((k * step - begin) / span * width, f"{k * step:.6g} s") for k in range(first, last + 1))


def state_marks(states: Sequence[str], low: float, high: float, height: float) -> tuple[Mark, ...]:
    """Return where states 0, 1, ... are on an axis from low to high, and their names."""
    shown = ((k, name) for k, name in enumerate(states) if low <= k <= high)
    return tuple((height * (1.0 - (k - low) / (high - low)), name) for k, name in shown)


def columns(
    seconds: Floats, x: Floats, baseline: Floats, candidate: Floats, unit: str, states: Sequence[str]
) -> tuple[tuple[float, float, str], ...]:
    """Return parts of the time: where each begins and how wide it is [px], and what both runs say in its middle."""
    edges = np.unique(np.linspace(0, len(x), min(_COLUMNS, len(x)) + 1).astype(np.int64))
    found = []
    for first, last in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True):
        middle = (first + last) // 2
        values = (float(column[middle]) for column in (baseline, candidate))
        texts = [_value(value, unit, states) for value in values]
        left = float(x[first])
        right = float(x[min(last, len(x) - 1)])
        told = texts[0] if texts[0] == texts[1] else f"{texts[0]} -> {texts[1]}"
        found.append((left, max(right - left, 1.0), f"{seconds[middle]:.6g} s: {told}"))
    return tuple(found)


def _value(value: float, unit: str, states: Sequence[str]) -> str:
    if math.isnan(value):
        return "none"
    if states and 0 <= value < len(states):
        return states[int(value)]
    return quantities.shown(value, unit, digits=5)
