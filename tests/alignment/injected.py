"""Logs made from accepted recordings, with everything known that was done to them."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import replay
from replay.alignment.pair import SignalPair
from replay.comparison.signals import groups

BASELINES = Path(__file__).parents[1] / "baselines"
FIELDS = ("position", "distance", "output_voltage", "capacitance", "clearance")


@functools.cache
def recorded(name):
    """Return the frames' times [s] of an accepted recording and its signals that move, by name."""
    recording = replay.read(BASELINES / name / f"{name}.mcap")
    found = {}
    for group in groups(recording):
        if group.field.name in FIELDS and group.values.ndim == 2:
            for signal, value in zip(group.signals, group.values.T, strict=True):
                value = np.where(np.isfinite(value), value, np.nan).astype(float)
                there = value[np.isfinite(value)]
                if len(there) > 20 and np.ptp(there) > 1e-6 * np.abs(there).max():
                    found[signal.full_name] = value
    return recording.time * 1e-9, found


@dataclass(frozen=True)
class InjectedLog:
    """A log, and the truth: t = t_log + offset + drift * t_log; measured = scale * simulated + bias."""

    pairs: list[SignalPair]
    offset: float
    drift: float
    scale: dict[str, float]
    bias: dict[str, float]
    rate: float
    decibel: float

    def offset_at(self, log_time):
        return self.offset + self.drift * log_time

    @property
    def sample(self):
        """The larger of both sample times [s]."""
        return max(1.0 / self.rate, float(np.diff(self.pairs[0].time)[0]))


def injected(rng, name, *, drifts, signals=None, rate=None, decibel=None, clean=False):
    """Return a log of a recording: 5 Hz to 1 kHz, noise of 1 to 30 dB, jitter, dropouts, a gap, scale, bias, rounding.

    Args:
        rng: of NumPy.
        name: of the recording.
        drifts: whether the clock drifts, up to 1e-3.
        signals: how many of its signals are measured; 1 to 3 by chance.
        rate, decibel: by chance if not given.
        clean: neither jitter nor dropouts, gaps and rounding.
    """
    time, values = recorded(name)
    names = list(values)
    count = rng.integers(1, 4) if signals is None else signals
    chosen = [names[i] for i in rng.permutation(len(names))[:count]]
    offset, drift = rng.uniform(-2.0, 2.0), rng.uniform(-1e-3, 1e-3) if drifts else 0.0
    rate = np.exp(rng.uniform(np.log(5.0), np.log(1000.0))) if rate is None else rate
    decibel = rng.uniform(1.0, 30.0) if decibel is None else decibel
    at = np.arange(time[0] + rng.uniform(0.0, 1.0 / rate), time[-1], 1.0 / rate)
    jitter = 0.0
    if not clean:
        jitter = rng.choice([0.0, 0.1, 0.3]) * min(1.0 / rate, 0.02)
        kept = rng.random(len(at)) > rng.choice([0.0, 0.05, 0.2])
        if rng.random() < 0.4:
            begin = rng.uniform(time[0], time[-1])
            kept &= ~((at > begin) & (at < begin + 0.1 * time[-1]))
        at = at[kept]
    log_time = np.sort((at - offset) / (1.0 + drift) + jitter * rng.uniform(-1.0, 1.0, len(at)))
    pairs, scales, biases = [], {}, {}
    for signal in chosen:
        value = values[signal]
        size = float(np.nanstd(value))
        scale, bias = float(np.exp(rng.normal(0.0, 0.5))), float(rng.normal(0.0, 2.0) * size)
        noise = size * 10.0 ** (-decibel / 20.0) * rng.normal(size=len(at))
        measured = scale * (np.interp(at, time, value) + noise) + bias
        if not clean and rng.random() < 0.3:
            step = scale * size * rng.choice([0.05, 0.2])
            measured = np.round(measured / step) * step
        pairs.append(SignalPair(signal, time, value, log_time, measured))
        scales[signal], biases[signal] = scale, bias
    return InjectedLog(pairs, offset, drift, scales, biases, rate, decibel)
