"""Signals that differ as drawings: baseline, candidate and tolerance over time, and the difference below."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from replay.comparison import quantities
from replay.comparison.axes import Mark, columns, state_marks, time_ticks
from replay.comparison.diff import match_frames
from replay.comparison.difference import Difference, SignalDifference
from replay.comparison.effects import effects
from replay.comparison.numbers import compare_numbers, compare_rotations
from replay.comparison.rules import EXACT, Rules
from replay.comparison.runs import RecordingPair
from replay.comparison.signals import Signal, groups, unify_categories
from replay.numerics.arrays import Column, Flags, Floats, Integers
from replay.numerics.columns import Kind
from replay.numerics.constants import SECOND

WIDTH, HEIGHT, LOWER = 720.0, 150.0, 70.0
"""Width of a drawing, height of its upper area (values) and of its lower one (differences) [px]."""
SHOWN = 40
"""Signals of a scenario that are drawn; those that decide come first."""

_BUCKETS = 700


@dataclass(frozen=True, eq=False)
class ComparedCurve:
    """A signal of two runs in their common frames, (F,) each.

    Attributes:
        seconds: time.
        baseline, candidate: values; for rotations 0, and the angle between the two.
        error: the difference; `limit` what its tolerance accepts.
        outside: frames outside the tolerance; for states, frames that differ.
        steps: the values are states, which hold until the next frame.
        states: their names from 0 on, where they have any.
    """

    seconds: Floats
    baseline: Floats
    candidate: Floats
    error: Floats
    limit: Floats
    outside: Flags
    steps: bool
    states: tuple[str, ...] = ()


@dataclass(frozen=True)
class Plot:
    """One drawing: lines in SVG's path language, and what its axes say.

    Attributes:
        signal: full name; `unit` of its values.
        baseline, candidate: lines of the values; `band` the area that the tolerance accepts, "" when exact.
        error, limit: lines of the difference and of what the tolerance accepts.
        marks: x of frames outside the tolerance, one a pixel at most.
        low, high: of the values; `largest` of the differences; `begin`, `end` of the time [s].
        ticks: times along the axis; `levels` names of states, `bounds` what is expected of the values, up the axis.
        columns: what is told under the pointer: from where, how wide, and the values of both runs.
    """

    signal: str
    unit: str
    baseline: str
    candidate: str
    band: str
    error: str
    limit: str
    marks: tuple[float, ...]
    low: float
    high: float
    largest: float
    begin: float
    end: float
    ticks: tuple[Mark, ...] = ()
    levels: tuple[Mark, ...] = ()
    bounds: tuple[Mark, ...] = ()
    columns: tuple[tuple[float, float, str], ...] = ()

    def shown(self, value: float) -> str:
        """Return one of its values in a unit that suits it."""
        return quantities.shown(value, self.unit, digits=4)

    @property
    def size(self) -> int:
        """Length of its lines, which is nearly all of the drawing [bytes]."""
        return sum(len(line) for line in (self.baseline, self.candidate, self.band, self.error, self.limit))


class Curves:
    """The signals that two recordings share, as curves."""

    def __init__(self, pair: RecordingPair) -> None:
        _, self._frames = match_frames(pair.baseline.time, pair.candidate.time, Rules())
        self._groups_a = {(g.key, signal): (g, k) for g in groups(pair.baseline) for k, signal in enumerate(g.signals)}
        self._groups_b = {(g.key, signal): (g, k) for g in groups(pair.candidate) for k, signal in enumerate(g.signals)}
        self.seconds = self._frames.time / SECOND

    def curve(self, item: SignalDifference) -> ComparedCurve:
        """Return what both runs say of a signal."""
        key = (item.signal.topic.split("/")[1], item.signal.field), item.signal
        (group_a, k), (group_b, j) = self._groups_a[key], self._groups_b[key]
        values_a, values_b, _ = unify_categories(group_a, group_b)
        x = _rows(values_a[:, k], self._frames.baseline)
        y = _rows(values_b[:, j], self._frames.candidate)
        tolerance = EXACT if item.rule is None else item.rule.tolerance
        if group_a.field.kind.is_state:
            a, b = x.astype(np.float64), y.astype(np.float64)
            names = tuple(state.name.lower().replace("_", " ") for state in group_a.field.states or ())
            names = names or (("no", "yes") if group_a.field.kind is Kind.FLAG else ())
            return ComparedCurve(self.seconds, a, b, np.abs(a - b), np.zeros(len(a)), a != b, steps=True, states=names)
        if group_a.field.kind is Kind.ROTATION:
            errors = compare_rotations(x, y, tolerance)
            limit = np.full(len(x), tolerance.abs)
            return ComparedCurve(
                self.seconds, np.zeros(len(x)), errors.error, errors.error, limit, errors.outside, steps=False
            )
        errors = compare_numbers(x, y, tolerance)
        with np.errstate(over="ignore", invalid="ignore"):
            limit = np.maximum(tolerance.abs, tolerance.rel * np.fmax(np.abs(x), np.abs(y)))
        return ComparedCurve(self.seconds, x, y, errors.error, limit, errors.outside, steps=False)


def _rows(column: Column, rows: Integers | None) -> Column:
    return column if rows is None else column[rows]


def plots(found: Difference, pair: RecordingPair, limits: Mapping[str, float] | None = None) -> tuple[Plot, ...]:
    """Return the drawings of the first `SHOWN` signals that differ, those that the effects are about before others.

    Args:
        found: how the recordings of the pair differ.
        pair: the recordings.
        limits: smallest clearances [m] that are expected, by pair of shapes.
    """
    curves = Curves(pair)
    main = {effect.signals[0]: k for k, effect in enumerate(effects(found)) if effect.signals}
    ordered = sorted(found.signals, key=lambda item: (not item.decides, main.get(item.signal.full_name, len(main))))
    known = {f"{_CLEARANCE}{name}": limit for name, limit in (limits or {}).items()}
    return tuple(plot_of(item.signal, curves.curve(item), known.get(item.signal.full_name)) for item in ordered[:SHOWN])


_CLEARANCE = "/collision/clearance/"


def plot_of(signal: Signal, curve: ComparedCurve, bound: float | None = None) -> Plot:
    """Return the drawing of a signal; `bound` is what is expected of its values."""
    begin, end = float(curve.seconds[0]), float(curve.seconds[-1])
    width = end - begin or 1.0
    x = (curve.seconds - begin) / width * WIDTH
    low, high = _range(np.concatenate((curve.baseline, curve.candidate, [] if bound is None else [bound])))
    _, largest = _range(np.concatenate((curve.error, [0.0])))

    def upper(values: Floats) -> Floats:
        return HEIGHT * (1.0 - (values - low) / (high - low))

    def lower(values: Floats) -> Floats:
        return LOWER * (1.0 - values / largest)

    has_limit = not curve.steps and bool((curve.limit > 0).any())
    with np.errstate(over="ignore", invalid="ignore"):
        band = _band(x, upper(curve.baseline - curve.limit), upper(curve.baseline + curve.limit)) if has_limit else ""
        limit = _line(x, lower(curve.limit), False) if has_limit else ""
        return Plot(
            signal=signal.full_name,
            unit=signal.unit,
            baseline=_line(x, upper(curve.baseline), curve.steps),
            candidate=_line(x, upper(curve.candidate), curve.steps),
            band=band,
            error=_line(x, lower(curve.error), curve.steps),
            limit=limit,
            marks=tuple(float(at) for at in np.unique(np.round(x[curve.outside]))),
            low=low,
            high=high,
            largest=largest,
            begin=begin,
            end=end,
            ticks=time_ticks(begin, end, WIDTH),
            levels=state_marks(curve.states, low, high, HEIGHT),
            bounds=() if bound is None else ((float(upper(np.array([bound]))[0]), "limit"),),
            columns=columns(curve.seconds, x, curve.baseline, curve.candidate, signal.unit, curve.states),
        )


def _range(values: Floats) -> tuple[float, float]:
    """Return a low and a high value, different and finite, between which the finite ones lie."""
    finite = values[np.isfinite(values)]
    low, high = (float(finite.min()), float(finite.max())) if len(finite) else (0.0, 1.0)
    if not np.isfinite(high - low):
        return -1.0, 1.0  # beyond what can be drawn
    return (low, high) if high > low else (low - (abs(low) or 1.0) * 1e-3, high + (abs(high) or 1.0) * 1e-3)


def _reduced(x: Floats, y: Floats) -> tuple[Floats, Floats]:
    """Return the least and the largest value of each bucket of time, so that no peak is lost."""
    if len(x) <= 2 * _BUCKETS:
        return x, y
    starts = np.linspace(0, len(x), _BUCKETS, endpoint=False).astype(np.int64)
    pairs = np.stack((np.fmin.reduceat(y, starts), np.fmax.reduceat(y, starts)), axis=1)
    return np.repeat(x[starts], 2), pairs.ravel()


def _line(x: Floats, y: Floats, steps: bool) -> str:
    """Return a path through the finite points; it breaks where there is none."""
    x, y = _reduced(x, y)
    parts = []
    drawing = False
    for at, value in zip(x.tolist(), y.tolist(), strict=True):
        if not np.isfinite(value) or abs(value) > 1e6:
            drawing = False
            continue
        if not drawing:
            parts.append(f"M{at:.1f} {value:.1f}h.5")
        else:
            parts.append(f"H{at:.1f}V{value:.1f}" if steps else f"L{at:.1f} {value:.1f}")
        drawing = True
    return "".join(parts)


def _band(x: Floats, bottom: Floats, top: Floats) -> str:
    """Return the outline of the area between two lines, where both are finite."""
    known = np.isfinite(bottom) & np.isfinite(top)
    if not known.any():
        return ""
    step = max(1, int(known.sum()) // _BUCKETS)
    x, bottom, top = x[known][::step], bottom[known][::step], top[known][::step]
    bottom, top = np.clip(bottom, -HEIGHT, 2 * HEIGHT), np.clip(top, -HEIGHT, 2 * HEIGHT)
    there = [f"{at:.1f} {value:.1f}" for at, value in zip(x.tolist(), top.tolist(), strict=True)]
    back = [f"{at:.1f} {value:.1f}" for at, value in zip(x[::-1].tolist(), bottom[::-1].tolist(), strict=True)]
    return f"M{'L'.join((*there, *back))}Z"
