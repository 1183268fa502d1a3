"""The readings of one kind of sensor as frames come: what the suite computes, and what signal chains make of it."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any

from replay.numerics.arrays import Flags, Floats
from replay.sensing.kind import SensorKind, Suite
from replay.sensing.signal.chain import Signals

if TYPE_CHECKING:
    from replay.kinematics.linkage import LinkPoses


class KindReadings:
    """All sensors of a kind in a scene.

    Signal chains remember: where there are any, frames are asked for in order, and what was read counts as past only
    when it is kept.

    Args:
        kind: of the sensors.
        suite: computes them.
        signals: their chains; None where no sensor has one.
    """

    def __init__(self, kind: SensorKind, suite: Suite, signals: Signals | None) -> None:
        self._kind, self._suite, self._signals = kind, suite, signals
        self.restart()

    def restart(self) -> None:
        """Go back to before the first frame."""
        self._states = {} if self._signals is None else self._signals.begin()

    def read(self, poses: LinkPoses, first: int) -> Any:
        """Return the columns of n frames from frame `first` of the scenario on."""
        columns: Any = self._suite.run(poses)
        if self._signals is None or self._kind.output is None:
            return columns
        output = self._kind.output
        told, _, _ = self._signals.run(first, output.reading(columns), output.beyond(columns), self._states)
        return dataclasses.replace(columns, measured=told)

    def told(self, columns: Any, column: int, first: int) -> tuple[Floats, Flags]:
        """Return what one sensor tells of the frames last read: its signal if it has a chain, else its reading.

        Returns:
            (n,) NaN where there is nothing; and (n,) whether it is of something nearer than the sensor reads.
        """
        output = self._kind.output
        assert output is not None
        reading, beyond = output.reading(columns)[:, column], output.beyond(columns)[:, column]
        if self._signals is None or column not in self._signals.chains:
            return reading, beyond
        told, near, _ = self._signals.chains[column].run(first, reading, beyond, self._states[column])
        return told, near

    def keep(self, columns: Any, first: int) -> None:
        """Let frames that were read be past: those of `columns`, which begin at frame `first`."""
        if self._signals is not None and self._kind.output is not None:
            output = self._kind.output
            _, _, self._states = self._signals.run(first, output.reading(columns), output.beyond(columns), self._states)
