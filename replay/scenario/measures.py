"""Results of a scenario as numbers to keep for years: what its expectations say, and extremes of its readings."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from replay.collision.columns import CollisionColumns, Level
from replay.numerics.arrays import Floats, Integers
from replay.numerics.constants import SECOND
from replay.scenario.layout import Layout
from replay.sensing.kinds import KINDS


@dataclass(frozen=True)
class Measure:
    """One number.

    Attributes:
        name: what it is: "clearance.min", "distance.tip.min", "expect[0].contact".
        value: in `unit`; None when there is none, such as the first contact of pairs that never meet.
        time: when it was so [s]; None when it is of no moment.
        subject: what it was then, such as a pair; "" when it is of nothing in particular.
        limit: what is expected of it; None when nothing is.
        margin: how far it is on the right side of the limit, in `unit`; negative where the expectation is broken.
    """

    name: str
    value: float | None
    unit: str
    time: float | None = None
    subject: str = ""
    limit: float | None = None
    margin: float | None = None

    def as_json(self, scenario: str) -> dict[str, Any]:
        """Return the row of a table that it is."""
        return {"scenario": scenario, **{name: getattr(self, name) for name in COLUMNS[1:]}}


COLUMNS = ("scenario", "name", "value", "unit", "time", "subject", "limit", "margin")


def finite(value: float | None) -> float | None:
    """Return a number, or None for one that JSON cannot hold."""
    return None if value is None or not math.isfinite(value) else float(value)


class _Extreme:
    """The smallest (or, with sign -1, largest) of k columns' values each, with its moment and what was read then."""

    def __init__(self, columns: int, sign: int) -> None:
        self._sign = sign
        self._best = np.full(columns, math.inf)
        self.time = np.zeros(columns, dtype=np.int64)
        self.about = np.full(columns, -1, dtype=np.int64)

    def update(self, time_ns: Integers, values: Floats, about: Integers | None) -> None:
        """Take values (n, k), NaN for none, and what each is about (n, k)."""
        signed = np.where(np.isfinite(values), self._sign * values, math.inf)
        row = np.argmin(signed, axis=0)
        column = np.arange(signed.shape[1])
        better = signed[row, column] < self._best
        self._best = np.where(better, signed[row, column], self._best)
        self.time = np.where(better, time_ns[row], self.time)
        if about is not None:
            self.about = np.where(better, about[row, column], self.about)

    @property
    def value(self) -> Floats:
        """(k,), infinite where there was none."""
        found: Floats = self._sign * self._best
        return found


class Measures:
    """Follows the results of all frames, block by block."""

    def __init__(self, layout: Layout) -> None:
        self._layout = layout
        self._clearance = _Extreme(1, 1)
        self._touched = np.zeros(len(layout.pairs), dtype=bool)
        self._first: tuple[int, int] | None = None
        self._readings: dict[tuple[str, str, str], _Extreme] = {}

    def update(self, time_ns: Integers, collision: CollisionColumns | None, readings: Mapping[str, Any]) -> None:
        """Take the results of the next frames, at times (n,) [ns]."""
        if collision is not None and len(self._layout.pairs):
            self._pairs(time_ns, collision)
        for kind, columns in readings.items():
            described = KINDS[kind]
            names = next((f.name for f in described.columns.fields() if f.names == "shapes"), None)
            about = None if names is None else getattr(columns, names)
            for expected in described.expected:
                values = np.asarray(expected.values(columns))
                if not expected.unit or not values.shape[1]:
                    continue
                for word, sign in (("min", 1), ("max", -1)):
                    key = kind, expected.what, word
                    extreme = self._readings.setdefault(key, _Extreme(values.shape[1], sign))
                    extreme.update(time_ns, values, about)

    def _pairs(self, time_ns: Integers, collision: CollisionColumns) -> None:
        contact = collision.level == Level.CONTACT
        values = np.where(contact, 0.0, np.where(collision.evaluated, collision.clearance, np.nan))
        pair = np.argmin(np.where(np.isnan(values), math.inf, values), axis=1)
        rows = np.arange(len(values))
        self._clearance.update(time_ns, values[rows, pair, None], pair[:, None])
        begins = collision.crossings
        mine = (begins.level == Level.CONTACT) & begins.begins
        if self._first is None:
            moments = [(int(begins.latest[k]), int(begins.pair[k])) for k in np.flatnonzero(mine)[:1].tolist()]
            at = np.argmax(contact.any(axis=1)) if contact.any() else None
            if at is not None:
                moments.append((int(time_ns[at]), int(np.argmax(contact[at]))))
            self._first = min(moments, default=None)
        self._touched |= contact.any(axis=0)
        self._touched[begins.pair[mine]] = True

    def results(self) -> tuple[Measure, ...]:
        """Return the numbers that there are."""
        found = []
        pairs = self._layout.pairs
        least = float(self._clearance.value[0])
        if math.isfinite(least):
            pair = pairs[int(self._clearance.about[0])]
            found.append(Measure("clearance.min", least, "m", _seconds(self._clearance.time[0]), _spaced(pair)))
        if len(pairs):
            found.append(Measure("contact.pairs", float(self._touched.sum()), ""))
        if self._first is not None:
            time, number = self._first
            found.append(Measure("contact.first", _seconds(time), "s", _seconds(time), _spaced(pairs[number])))
        for (kind, what, word), extreme in self._readings.items():
            unit = next(expected.unit for expected in KINDS[kind].expected if expected.what == what)
            for k, sensor in enumerate(self._layout.sensors[kind]):
                value, about = float(extreme.value[k]), int(extreme.about[k])
                if math.isfinite(value):
                    subject = self._layout.shapes[about] if about >= 0 else ""
                    name = f"{what}.{sensor}.{word}"
                    found.append(Measure(name, value, unit, _seconds(extreme.time[k]), subject))
        return tuple(found)


def _seconds(time_ns: int) -> float:
    return int(time_ns) / SECOND


def _spaced(pair: str) -> str:
    """Return a pair as people read it: "arm/rod | person/body"."""
    return pair.replace("|", " | ")
