"""Signals beside what was measured as drawings: both, tolerance and residual over time; the residual over distance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from replay.comparison import quantities
from replay.comparison.measured.result import MeasuredComparison, MeasuredSignal
from replay.comparison.numbers import compare_numbers
from replay.comparison.plots import WIDTH, ComparedCurve, Plot, plot_of
from replay.comparison.rules import EXACT
from replay.numerics.arrays import Floats

SCATTER = 140.0
"""Height of a drawing over distance [px]."""
_POINTS = 2000


@dataclass(frozen=True)
class Scatter:
    """The residual of a signal over another quantity.

    Attributes:
        over: what the horizontal axis is; `unit` of it, `of` of the residual.
        points: lines in SVG's path language, one a frame.
        low, high: of the residual; `begin`, `end` of the axis.
        zero: where the residual is 0 [px].
        limits: where it is as large as the tolerance [px].
    """

    over: str
    unit: str
    of: str
    points: str
    low: float
    high: float
    begin: float
    end: float
    zero: float
    limits: tuple[float, ...] = ()

    def shown(self, value: float) -> str:
        """Return a residual in a unit that suits it."""
        return quantities.shown(value, self.of, digits=4)

    def told(self, value: float) -> str:
        """Return a value of the axis in a unit that suits it."""
        return quantities.shown(value, self.unit, digits=4)


def curve_of(signal: MeasuredSignal) -> ComparedCurve:
    """Return both sides of a signal at all frames; NaN where there is none."""
    matched = signal.matched
    measured, simulated = matched.at_frames, matched.pair.value
    if matched.pair.steps:
        differs = np.isfinite(measured) & (measured != simulated)
        error, limit = np.abs(measured - simulated), np.zeros(len(measured))
        return ComparedCurve(matched.pair.time, measured, simulated, error, limit, differs, steps=True)
    tolerance = EXACT if signal.rule is None else signal.rule.tolerance
    errors = compare_numbers(measured, simulated, tolerance)
    known = np.isfinite(measured) & np.isfinite(simulated)
    with np.errstate(over="ignore", invalid="ignore"):
        limit = np.maximum(tolerance.abs, tolerance.rel * np.fmax(np.abs(measured), np.abs(simulated)))
    outside = errors.outside & known
    return ComparedCurve(matched.pair.time, measured, simulated, errors.error, limit, outside, steps=False)


def plot(signal: MeasuredSignal) -> Plot:
    """Return the drawing of a signal over time."""
    return plot_of(signal.signal, curve_of(signal))


def scatter(signal: MeasuredSignal, found: MeasuredComparison) -> Scatter | None:
    """Return the residual of a signal over distance: its own if it is one, else that of the first signal that is one.

    Without any, it is drawn over the simulated value itself. None of states, and where there is nothing to draw.
    """
    matched = signal.matched
    if matched.pair.steps or not len(matched.frames):
        return None
    over = signal if signal.signal.unit == "m" else next(filter(_is_distance, found.signals), signal)
    x, y = over.matched.pair.value[matched.frames], matched.residual
    known = np.isfinite(x) & np.isfinite(y)
    if not known.any():
        return None
    x, y = x[known], y[known]
    step = max(1, len(x) // _POINTS)
    x, y = x[::step], y[::step]
    begin, end = _ends(x)
    bound = 0.0 if signal.rule is None or signal.rule.tolerance.rel > 0.0 else signal.rule.tolerance.abs
    low, high = _ends(np.concatenate([y, [0.0, bound, -bound]]))
    across, down = (x - begin) / (end - begin) * WIDTH, SCATTER * (1.0 - (y - low) / (high - low))
    points = "".join(f"M{a:.1f} {b:.1f}h.1" for a, b in zip(across.tolist(), down.tolist(), strict=True))
    limits = tuple(SCATTER * (1.0 - (value - low) / (high - low)) for value in (bound, -bound) if bound > 0.0)
    zero = SCATTER * (1.0 - (0.0 - low) / (high - low))
    name = over.signal.full_name
    return Scatter(name, over.signal.unit, signal.signal.unit, points, low, high, begin, end, zero, limits)


def _is_distance(signal: MeasuredSignal) -> bool:
    joint = signal.signal.topic in ("/joint_states", "/tf")
    return signal.signal.unit == "m" and not joint and not signal.matched.pair.steps


def _ends(values: Floats) -> tuple[float, float]:
    low, high = float(values.min()), float(values.max())
    return (low, high) if high > low else (low - 0.5e-3, high + 0.5e-3)
