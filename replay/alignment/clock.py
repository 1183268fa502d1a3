"""The clock of a log beside the time of a simulation: where it stands, how surely, or why that is not known."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from replay.errors import InvalidValue
from replay.numerics.arrays import Floats


@dataclass(frozen=True)
class LogClock:
    """How a log's clock stands to the time of a simulation: t = t_log + offset + drift (t_log - reference).

    Attributes:
        offset: [s].
        drift: how much faster the simulation's time runs; 1e-6 is 1 ppm.
        reference: the log's time at which they are `offset` apart [s].
    """

    offset: float
    drift: float = 0.0
    reference: float = 0.0

    def __post_init__(self) -> None:
        if not np.isfinite([self.offset, self.drift, self.reference]).all() or not self.drift > -1.0:
            raise InvalidValue(
                "clock", f"offset {self.offset} s, drift {self.drift}", "must be finite, the drift above -1"
            )

    def simulated(self, log_time: Floats) -> Floats:
        """Return the simulation's time [s] at times of the log [s]."""
        return np.asarray(log_time + self.offset + self.drift * (log_time - self.reference))

    def logged(self, time: Floats) -> Floats:
        """Return the log's time [s] at times of the simulation [s]."""
        return np.asarray((time - self.offset + self.drift * self.reference) / (1.0 + self.drift))

    @property
    def deviations(self) -> tuple[float, float]:
        """Standard deviations of offset [s] and drift; 0 of a clock that is given."""
        return 0.0, 0.0


@dataclass(frozen=True)
class SignalDelay:
    """How much later one signal says that the log's clock is than all together do, by itself.

    Attributes:
        name: of the signal.
        delay: of what was measured behind what was simulated [s], on the clock that was found for all.
        interval: that covers it [s].
        deviation: its standard deviation [s].
        freedom: degrees of freedom of that number.
    """

    name: str
    delay: float
    interval: tuple[float, float]
    deviation: float
    freedom: float


@dataclass(frozen=True)
class ClockEstimate(LogClock):
    """The clock that signals tell.

    Attributes:
        offset_interval: covers the true offset with the probability asked for [s].
        drift_interval: the same of the drift; (0, 0) where none was looked for, -1 .. 1 where nothing tells it.
        confidence: the probability.
        spread: standard deviations of offset and drift.
        used: the signals that told it.
        unused: the others, each with the reason.
        delays: what each signal says by itself.
        agree: whether these agree with each other; where not, the interval holds those of all.
    """

    offset_interval: tuple[float, float] = (0.0, 0.0)
    drift_interval: tuple[float, float] = (0.0, 0.0)
    confidence: float = 0.95
    spread: tuple[float, float] = (0.0, 0.0)
    used: tuple[str, ...] = ()
    unused: tuple[tuple[str, str], ...] = ()
    delays: tuple[SignalDelay, ...] = ()
    agree: bool = True

    @property
    def deviations(self) -> tuple[float, float]:
        """Standard deviations of offset [s] and drift."""
        return self.spread

    def offset_at(self, log_time: float) -> tuple[float, tuple[float, float]]:
        """Return the offset at a time of the log [s], and the interval that covers it."""
        since = log_time - self.reference
        offset = self.offset + self.drift * since
        of_offset, of_drift = (0.5 * (high - low) for low, high in (self.offset_interval, self.drift_interval))
        half = float(np.hypot(of_offset, of_drift * since))
        return offset, (offset - half, offset + half)


@dataclass(frozen=True)
class Undetermined:
    """The data cannot tell the clock.

    Attributes:
        reason: in one line.
        candidates: offsets that explain the data equally well [s], if that is the reason, in ascending order.
        unused: signals that say nothing, each with the reason.
    """

    reason: str
    candidates: tuple[float, ...] = ()
    unused: tuple[tuple[str, str], ...] = ()
