"""A simulated signal and the channel of a log that measured it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from replay.alignment.clock import LogClock
from replay.errors import InvalidValue
from replay.numerics.arguments import as_floats
from replay.numerics.arrays import Floats


@dataclass(frozen=True, eq=False)
class SignalPair:
    """A simulated signal and the channel of a log that measured it, each on its own clock.

    Attributes:
        name: of the simulated signal, such as /capacitive/side_foot/output_voltage.
        time: (n,) of the frames [s], strictly increasing.
        value: (n,) simulated; NaN where nothing is detected. Infinite values (a capacitance in contact) are detected,
            but no numbers to compare.
        measured_time: (m,) of the samples [s] on the log's clock, strictly increasing.
        measured_value: (m,) in the unit of `value`, and as it.
        steps: a value holds until the next one (states, events as 0 and 1); else it is a line from one to the next.

    Raises:
        InvalidValue: shapes do not fit, or times are not finite and increasing.
    """

    name: str
    time: Floats
    value: Floats
    measured_time: Floats
    measured_value: Floats
    steps: bool = False

    def __post_init__(self) -> None:
        for times, values in (("time", "value"), ("measured_time", "measured_value")):
            time = as_floats(f"{self.name}: {times}", getattr(self, times), (None,))
            value = as_floats(f"{self.name}: {values}", getattr(self, values), (len(time),))
            if not (np.isfinite(time).all() and (np.diff(time) > 0.0).all()):
                raise InvalidValue(
                    f"{self.name}: {times}", f"{len(time)} times", "must be finite and strictly increasing"
                )
            object.__setattr__(self, times, time)
            object.__setattr__(self, values, value)


def fitted(pair: SignalPair, scale: float, offset: float) -> SignalPair:
    """Return the pair with what the simulation says turned into what the machine says: scale * value + offset."""
    value = scale * pair.value + offset
    return SignalPair(pair.name, pair.time, value, pair.measured_time, pair.measured_value, pair.steps)


def on_same_turn(pair: SignalPair, clock: LogClock, turn: float) -> SignalPair:
    """Return the pair with each measured angle on the turn on which it is nearest to the simulated one."""
    simulated = np.interp(clock.simulated(pair.measured_time), pair.time, pair.value)
    measured = pair.measured_value + turn * np.rint((simulated - pair.measured_value) / turn)
    return SignalPair(pair.name, pair.time, pair.value, pair.measured_time, measured, pair.steps)
