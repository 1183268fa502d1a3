"""A sampled signal between its samples: straight lines, not beyond the ends, not next to a sample that is missing."""

from __future__ import annotations

import numpy as np

from replay.numerics.arrays import Flags, Floats, Integers

_PARABOLA = 0.5 / 30.0**0.5
"""Root mean square of u (1 - u) / 2."""

_JUMP, _JUMP_OF_TWO = 3.0, 10.0
"""A jump is so many times as large as the two steps before and the two after it; and as these but the largest one."""


class Places:
    """Where some times lie among the times of samples.

    Attributes:
        index: (k,) of the last sample that is not later, n - 2 at most.
        weight: (k,) of the sample after it, 0..1.
        inside: (k,) whether the time is not before the first sample and not after the last.
    """

    def __init__(self, time: Floats, at: Floats) -> None:
        """Find them.

        Args:
            time: (n,) of the samples [s], increasing, n >= 2.
            at: (k,) [s].
        """
        self.index: Integers = np.clip(np.searchsorted(time, at, side="right") - 1, 0, len(time) - 2)
        before = time[self.index]
        self.weight: Floats = (at - before) / (time[self.index + 1] - before)
        self.inside: Flags = (at >= time[0]) & (at <= time[-1])

    def values(self, samples: Floats) -> Floats:
        """Return (k,) values on the lines between (n,) samples; beyond the ends the last line goes on."""
        before = samples[self.index]
        return np.asarray(before + self.weight * (samples[self.index + 1] - before))


def line_errors(value: Floats) -> Floats:
    """Return (n - 1,) how far each line between (n,) samples may be off, root mean square.

    A parabola whose second differences are b leaves its chord by b u (1 - u) / 2, u in 0..1; b is the mean of those at
    both ends. A corner between two samples is off by up to 3.2 times that, a jump by more: see `jump_errors`.
    """
    bends = np.abs(np.diff(value, 2, prepend=np.nan, append=np.nan))
    bends = np.where(np.isnan(bends), 0.0, bends)
    return np.asarray(0.5 * (bends[:-1] + bends[1:]) * _PARABOLA)


def jump_errors(value: Floats) -> Floats:
    """Return (n - 1,) how far each line between (n,) samples may be off where it is a jump, root mean square; else 0.

    A jump is somewhere between two samples, anywhere as likely: of its height the line is off by 1 / sqrt(12) at best.
    """
    steps = np.abs(np.nan_to_num(np.diff(value)))
    around = np.sort(np.lib.stride_tricks.sliding_window_view(np.pad(steps, 2), 5)[:, [0, 1, 3, 4]], axis=1)
    usual = np.minimum(_JUMP * around[:, 3], _JUMP_OF_TWO * around[:, 2])
    return np.asarray(np.where(steps > usual, steps / np.sqrt(12.0), 0.0))


def slopes(time: Floats, value: Floats) -> tuple[Floats, Floats]:
    """Return the slopes (n - 1,) of the lines between samples, and (n,) at the samples: the mean of both sides.

    A sample at an end, or beside one that is not there (NaN), has the slope of its one line; NaN if it has none.
    """
    lines = np.diff(value) / np.diff(time)
    before, after = np.append(np.nan, lines), np.append(lines, np.nan)
    before, after = np.where(np.isnan(before), after, before), np.where(np.isnan(after), before, after)
    return lines, 0.5 * (before + after)
