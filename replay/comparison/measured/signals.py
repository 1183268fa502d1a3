"""The signals of a recording that a log may measure: one column of numbers each, and events as true and false."""

from __future__ import annotations

import dataclasses
from collections.abc import Collection, Iterator
from dataclasses import dataclass

import numpy as np

from replay.comparison.signals import Group, Signal, groups
from replay.numerics.arrays import Column, Floats
from replay.numerics.columns import Field, Kind
from replay.recording.reader import Recording
from replay.scenario.measured_signals import EVENTS


@dataclass(frozen=True, eq=False)
class SimulatedSignal:
    """A signal of a recording.

    Attributes:
        signal: which.
        field: how its values are compared, without a gate.
        column: (F,) as recorded.
    """

    signal: Signal
    field: Field
    column: Column

    @property
    def values(self) -> Floats:
        """(F,) as numbers; NaN where there is nothing."""
        return self.column.astype(np.float64)

    def states(self, measured: Floats) -> Column:
        """Return measured values (F,) as values of this signal's kind: what is not 0 is true, states are rounded."""
        if not self.field.kind.is_state:
            return measured
        known = np.where(np.isfinite(measured), np.clip(measured, -(2.0**31), 2.0**31), 0.0)
        return known != 0.0 if self.field.kind is Kind.FLAG else np.rint(known).astype(np.int64)


def simulated_signals(recording: Recording, names: Collection[str]) -> dict[str, SimulatedSignal]:
    """Return those signals of a recording that have one of these full names, by name."""
    found = {}
    for group in groups(recording):
        if group.values.ndim != 2 or (group.field.kind is Kind.CATEGORY and group.field.states is None):
            continue  # rotations, and numbers of names
        plain = dataclasses.replace(group.field, gate=None, open=())
        for column, signal in enumerate(group.signals):
            if signal.full_name in names:
                found[signal.full_name] = SimulatedSignal(signal, plain, group.values[:, column])
        for signal, field, values in _events(group, names):
            found[signal.full_name] = SimulatedSignal(signal, field, values)
    return found


def _events(group: Group, names: Collection[str]) -> Iterator[tuple[Signal, Field, Column]]:
    """Yield what events of a field of states tell, as true while it lasts."""
    for threshold, event in enumerate(group.field.events, start=1):
        for column, of in enumerate(group.signals):
            signal = Signal(EVENTS, event, of.name or of.topic.split("/", 2)[2])
            if signal.full_name in names:
                values = group.values[:, column] >= threshold
                yield signal, Field(event, Kind.FLAG, begins=(event,)), values
