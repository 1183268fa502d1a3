"""Slips that explain most of what a machine's signal is off by: a unit, a sign, a constant, a delay."""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from replay.alignment.clock import ClockEstimate, LogClock
from replay.alignment.estimate import estimate_clock
from replay.alignment.pair import SignalPair
from replay.alignment.residuals import SampledFrames, match
from replay.alignment.statistics import ResidualStatistics
from replay.alignment.trace import thinned
from replay.numerics.arrays import Floats

_LEFT = 1.0 / 3.0
"""A slip explains most where the root mean square of what is left is below this part of the whole."""

_LIKE_ONE = 0.1
"""A scale that is farther from 1 is not explained by a constant."""

_ROUNDING = 1e-9
"""Residuals below this part of the signal's size need no explanation."""

_FEWEST_VALUES, _SEVERAL, _FAR = 10, 2, 3.0
"""Different values of a signal, samples of one, and its distance from others beside theirs, that tell a stand-in."""

_LONGEST_DELAY = 2.0
_MOST_LOOKED_AT = 1 << 12

_FACTORS = (
    (1000.0, "as milli-units are beside units"),
    (0.001, "as units are beside milli-units"),
    (180.0 / math.pi, "as degrees are beside radians"),
    (math.pi / 180.0, "as radians are beside degrees"),
    (-1.0, "the sign is the other one"),
)


def hints(matched: SampledFrames, statistics: ResidualStatistics) -> tuple[str, ...]:
    """Return what explains most of a signal's residual, in words; nothing where nothing does.

    Args:
        matched: the signal at the frames' times.
        statistics: of it.
    """
    if statistics.count == 0 or matched.pair.steps:
        return ()
    stand_in = stand_in_for_nothing(matched)
    if stand_in is not None:
        return (stand_in,)
    simulated, measured, rms = matched.simulated, matched.measured, statistics.rms
    if not (math.isfinite(rms) and rms > _ROUNDING * max(_size(simulated), _size(measured))):
        return ()
    found = []
    for factor, meaning in _FACTORS:
        if _size(measured / factor - simulated) < _LEFT * min(rms, _size(simulated)):
            found.append(f"measured values are {factor:.4g} times the simulated ones: {meaning}")
    fit = statistics.fit
    if (
        not found
        and (fit is None or abs(fit.scale - 1.0) < _LIKE_ONE)
        and _size(matched.residual - statistics.bias) < _LEFT * rms
    ):
        found.append(f"a constant of {statistics.bias:.4g} explains most of it")
    off = _size(measured - np.mean(measured)) * math.sqrt(max(1.0 - statistics.correlation**2, 0.0))
    if not found and not off < _LEFT * rms:  # else the best scale and offset explain it, which statistics tell
        delay = own_delay(matched)
        if delay is not None:
            found.append(f"a delay of {1e3 * delay:.4g} ms of this signal alone explains most of it")
    return tuple(found)


def stand_in_for_nothing(matched: SampledFrames) -> str | None:
    """Return that a number which loggers write where nothing is detected seems to be among the values, if one does.

    That is the lowest or the highest value, exactly the same at several samples, far from all others beside how close
    these are, and not what is simulated there.
    """
    measured = matched.pair.measured_value
    known = np.unique(measured[np.isfinite(measured)])
    if len(known) < _FEWEST_VALUES:
        return None
    steps = np.diff(known)
    for number, gap, others in ((known[0], steps[0], steps[1:]), (known[-1], steps[-1], steps[:-1])):
        times = int((measured == number).sum())
        if times < _SEVERAL or not gap > _FAR * float(np.max(others)):
            continue
        simulated = matched.simulated[matched.measured == number]
        if not (np.abs(simulated - number) < 0.5 * gap).any():
            what = f"{times} measured values are exactly {number:.6g}, far from all others"
            return f"{what}: if that stands for nothing detected, state it as `nothing`"
    return None


def own_delay(matched: SampledFrames) -> float | None:
    """Return by how much this signal alone is measured late [s], if that explains most of its residual."""
    pair, rms = matched.pair, _size(matched.residual)
    there = np.isfinite(pair.measured_value)
    time, value = thinned(
        matched.clock.simulated(pair.measured_time[there]), pair.measured_value[there], _MOST_LOOKED_AT
    )
    if len(time) < 2 or len(pair.time) < 2:
        return None
    alone = SignalPair(pair.name, pair.time, pair.value, time, value)
    longest = min(_LONGEST_DELAY, 0.25 * float(pair.time[-1] - pair.time[0]))
    clock = estimate_clock([alone], drift=False, lowest=-longest, highest=longest)
    if not isinstance(clock, ClockEstimate) or clock.offset_interval[0] <= 0.0 <= clock.offset_interval[1]:
        return None
    gap = 1.5 * float(np.max(np.diff(time)))
    moved = match(dataclasses.replace(alone, measured_time=time), LogClock(clock.offset), max_gap=gap)
    if 2 * len(moved.frames) < len(matched.frames) or not _size(moved.residual) < _LEFT * rms:
        return None
    return -clock.offset


def _size(values: Floats) -> float:
    """Return the root mean square of values, 0 of none."""
    largest = float(np.max(np.abs(values), initial=0.0))
    return largest * float(np.sqrt(np.mean((values / largest) ** 2))) if largest > 0.0 else 0.0
