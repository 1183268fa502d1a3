"""From ideal readings to what a sensor's electronics tell, block by block."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from replay.numerics.arrays import Flags, Floats, Integers
from replay.sensing.signal.noise import noise_key, random_numbers
from replay.sensing.signal.part import SignalPart


@dataclass(frozen=True, eq=False)
class ChainState:
    """What a chain keeps from one frame to the next: never changed, so that it can be gone back to.

    Attributes:
        smooth: the filter's output; NaN before the first reading.
        samples: the last samples, as many as are on their way, NaN where there was no reading.
        beyond: whether each was nearer than the sensor reads.
    """

    smooth: float
    samples: Floats
    beyond: Flags


class Chain:
    """The signal chain of a sensor: filter, samples, bias and noise, gaps, range, steps, delay, in this order.

    Args:
        kind, name: of the sensor, for its noise.
        part: as it is written; its rate divides the frame rate, its delay is a whole number of samples.
        frame_rate: of the scenario [Hz].
        substitute: what the filter takes where there is no reading; samples of such frames are NaN all the same.
    """

    def __init__(self, kind: str, name: str, part: SignalPart, frame_rate: Fraction, substitute: float) -> None:
        rate = frame_rate if part.rate is None else Fraction(part.rate)
        self.name = name
        self._every = int(frame_rate / rate)
        self._delay = int(Fraction(part.delay) * rate)
        turn = 0.0 if part.low_pass is None else 2.0 * math.pi * part.low_pass / float(frame_rate)
        self._gain = 1.0 if part.low_pass is None else -math.expm1(-turn)
        noise, steps = part.noise, part.quantisation
        self._bias, self._dropout, self._range = part.bias, part.dropout, part.range
        self._std, seed = (0.0, 0) if noise is None else (noise.std, noise.seed)
        self._key = noise_key(seed, kind, name)
        self._origin, self._step = 0.0, None if steps is None else steps.step
        if steps is not None and steps.bits is not None and part.range is not None:
            low, high = part.range
            self._origin, self._step = low, (high - low) / (2**steps.bits - 1)
        self._substitute = substitute

    @property
    def lag(self) -> float:
        """How late a reading comes at most [frames]: the delay, and the time to the next sample."""
        return float(self._every * (self._delay + 1))

    def begin(self) -> ChainState:
        """Return the state before the first frame."""
        return ChainState(math.nan, np.zeros(0), np.zeros(0, dtype=np.bool_))

    def run(self, first: int, readings: Floats, beyond: Flags, state: ChainState) -> tuple[Floats, Flags, ChainState]:
        """Return what is told in the next n frames.

        Args:
            first: number of the first of them.
            readings: (n,) ideal ones; NaN is none.
            beyond: (n,) whether they are nearer than the sensor reads.
            state: after the frame before.

        Returns:
            (n,) signal, NaN where there is none; (n,) whether it is of something nearer than the sensor reads; and the
            state after the last frame.

        Accuracy: of each operation; the same bits however frames are divided into blocks.
        """
        nothing = np.isnan(readings)
        smooth, last = self._filtered(np.where(nothing, self._substitute, readings), state.smooth)
        taken = np.arange(-first % self._every, len(readings), self._every)
        samples = self._sampled((first + self._every - 1) // self._every, smooth[taken])
        samples[nothing[taken]] = np.nan
        samples = np.concatenate([state.samples, samples])
        past = np.concatenate([state.beyond, beyond[taken]])
        # samples[0] has this number
        begin = (first + len(readings) - 1) // self._every + 1 - len(samples)
        wanted = (first + np.arange(len(readings))) // self._every - self._delay
        told, near = _at(samples, past, wanted, begin)
        keep = slice(max(len(samples) - self._delay - 1, 0), None)
        return told, near & ~np.isnan(told), ChainState(last, samples[keep].copy(), past[keep].copy())

    def _filtered(self, readings: Floats, last: float) -> tuple[Floats, float]:
        if self._gain == 1.0:
            return readings, float(readings[-1]) if len(readings) else last
        found = []
        for x in readings.tolist():
            last = x if math.isnan(last) else last + self._gain * (x - last)
            found.append(last)
        return np.array(found, dtype=np.float64), last

    def _sampled(self, first: int, values: Floats) -> Floats:
        """Return samples from number `first` on, of filtered readings."""
        values = values + self._bias
        if self._std > 0.0 or self._dropout > 0.0:
            normal, uniform = random_numbers(self._key, first, len(values))
            values = values + self._std * normal
            values[uniform < self._dropout] = np.nan
        if self._range is not None:
            values = np.clip(values, *self._range)
        if self._step is not None:
            values = self._origin + np.rint((values - self._origin) / self._step) * self._step
        return values


def _at(samples: Floats, beyond: Flags, wanted: Integers, begin: int) -> tuple[Floats, Flags]:
    """Return the samples of some numbers; NaN of those before the first one."""
    place = wanted - begin
    there = wanted >= 0
    told, near = np.full(len(wanted), np.nan), np.zeros(len(wanted), dtype=np.bool_)
    told[there], near[there] = samples[place[there]], beyond[place[there]]
    return told, near


@dataclass(frozen=True, eq=False)
class Signals:
    """The chains of one kind of sensor: its columns (n, S) in and out.

    Attributes:
        chains: by the column of the sensor.
        sensors: number of columns.
    """

    chains: dict[int, Chain]
    sensors: int

    def begin(self) -> dict[int, ChainState]:
        """Return the states before the first frame."""
        return {column: chain.begin() for column, chain in self.chains.items()}

    def run(
        self, first: int, readings: Floats, beyond: Flags, states: dict[int, ChainState]
    ) -> tuple[Floats, Flags, dict[int, ChainState]]:
        """Return the signals, (n, S), as of `Chain.run`: NaN of sensors that have none."""
        told, near = np.full(readings.shape, np.nan), np.zeros(readings.shape, dtype=np.bool_)
        after = {}
        for column, chain in self.chains.items():
            told[:, column], near[:, column], after[column] = chain.run(
                first, np.ascontiguousarray(readings[:, column]), beyond[:, column], states[column]
            )
        return told, near, after

    def names(self) -> Iterable[str]:
        """Return the names of the sensors that have a chain."""
        return (chain.name for chain in self.chains.values())
