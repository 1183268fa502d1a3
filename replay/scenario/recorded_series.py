"""One joint or frame of a log as the scenario sees it: what is wrong in its time, and what is left for people to judge.

What lies outside the scenario's time does not count, but for the order of the samples.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from replay.language.node import KeyPath
from replay.logs.joint_log import Publisher, Series
from replay.numerics.arrays import Flags, Floats, Integers

APART = 1e-2
"""Least distance [rad or m] of two publishers' values that take turns: below, one encoder's noise looks the same."""
RARE = 50
"""Most samples of one publisher to one of the other that still count as taking turns; fewer are dropouts."""
OFTEN = 2 * 10**8
"""Longest usual time [ns] between samples that take turns: by hand, people write a motion to and fro with fewer."""


class Unusable(Exception):
    """A part of the recorded motion cannot be used: the path of the language, and the rule that is broken."""

    def __init__(self, path: KeyPath, rule: str) -> None:
        self.path = path
        self.rule = rule
        super().__init__(rule)


@dataclass(frozen=True)
class Window:
    """The scenario's time in a log.

    Attributes:
        log_begin: time of the log's first sample [ns].
        begin, end: the scenario's start and end [ns].
        max_gap: longest time [ns] between two samples that is bridged.
        published: whether there may be several publishers.
    """

    log_begin: int
    begin: int
    end: int
    max_gap: int
    published: bool

    def seconds(self, time: Integers) -> Floats:
        """Return times of the log in seconds from the scenario's start, each rounded once."""
        seconds: Floats = (time - self.begin) / 1e9
        return seconds

    def shown(self, time: np.int64) -> str:
        """Return a time of the log as messages say it, from its first sample on."""
        return f"{(int(time) - self.log_begin) / 1e9:.9g} s"


def in_window(path: KeyPath, series: Series, window: Window) -> Series:
    """Return the samples of the scenario's time and one on either side of it.

    Raises:
        Unusable: publishers contradict each other, the samples are not in the order of time, a value is no finite
            number, or there is a gap.
    """
    if series.by_turns:
        raise Unusable(path, _several(series.by_turns))
    time = series.time
    steps = np.diff(time)
    if (steps <= 0).any():
        raise Unusable(path, _disorder(path, series, window, steps))
    begin = max(int(np.searchsorted(time, window.begin, side="right")) - 1, 0)
    end = min(int(np.searchsorted(time, window.end)) + 1, len(time))
    cut = Series(time[begin:end], series.value[begin:end], series.row[begin:end])
    finite = np.asarray(np.isfinite(cut.value).reshape(len(cut.time), -1).all(axis=1))
    if not finite.all():
        rule = f"has a position in the log that is no finite number: sample {begin + _first(~finite)}"
        raise Unusable(path, rule)
    wide = np.diff(cut.time) > window.max_gap
    if wide.any():
        at = _first(wide)
        gap = f"a gap of {np.diff(cut.time)[at] * 1e-9:.6g} s in the log at {window.shown(cut.time[at])}"
        raise Unusable(path, f"has {gap}; raise max_gap to bridge it in a straight line")
    return cut


def _disorder(path: KeyPath, series: Series, window: Window, steps: Integers) -> str:
    """Return what is wrong with a series whose times do not increase."""
    time = series.time
    at = _first(steps <= 0)
    if window.published and steps[at] == 0:
        if not time[:-1][steps == 0].any():
            return "has samples in the log that differ and are all stamped 0, as before a clock is there"
        both = " and ".join(_value(value) for value in series.value[at : at + 2])
        return f"is moved by several publishers: at {window.shown(time[at])} it is {both}; {_WAY_OUT}"
    if window.published and steps.min() >= -OFTEN:  # messages that overtake each other; else a clock that was set
        order = np.argsort(time, kind="stable")
        check_turns(path, time[order], series.value[order, :3] if series.value.ndim > 1 else series.value[order])
    before, after = map(window.shown, time[at : at + 2])
    return f"has times in the log that do not increase: after {before} comes {after}"


_WAY_OUT = "channel and frame_id do not tell them apart: record one alone, or each on a topic of its own"


def check_turns(path: KeyPath, time: Integers, value: Floats) -> None:
    """Refuse samples that two publishers give in turn: two smooth motions, apart from each other.

    Where one publisher's sample stands between two of the other's, it is off the line between them by far more than
    these differ. Of such samples in a row every other one is taken out. What is left is the other's motion, which is
    smooth beside the distance; in noise it is as rough as before, and a joint that goes to and fro by itself is not
    sampled so often.

    Args:
        path: of the joint, for messages.
        time: (n,) [ns].
        value: (n,) or (n, 3) [rad or m].

    Raises:
        Unusable: it is so.
    """
    if len(time) < 8 or np.median(np.diff(time)) > OFTEN:
        return
    points = value.reshape(len(time), -1)
    off, apart = _off_line(points)
    odd = (off > APART) & (off > 5.0 * apart)
    run_begin = np.maximum.accumulate(np.where(odd, 0, np.arange(1, len(odd) + 1)))
    taken = odd & ((np.arange(len(odd)) - run_begin) % 2 == 0)
    count = int(taken.sum())
    if count < max(4, len(time) / RARE):
        return
    distance = float(np.median(off[taken]))
    left = points[np.concatenate([[True], ~taken, [True]])]
    if distance > 5.0 * float(np.median(_off_line(left)[0])):
        rule = f"is moved by several publishers in turn: {count} samples are {distance:.3g} off the others' motion"
        raise Unusable(path, f"{rule}, the first at sample {_first(taken) + 1}; {_WAY_OUT}")


def _off_line(points: Floats) -> tuple[Floats, Floats]:
    """Return how far each inner point is off the middle of its neighbours, and how far these are apart: (n - 2,)."""
    before, after = points[:-2], points[2:]
    off: Floats = np.abs(points[1:-1] - 0.5 * (before + after)).max(axis=1)
    apart: Floats = np.abs(after - before).max(axis=1)
    return off, apart


def unwrapped(value: Floats, turn: float) -> Floats:
    """Return a continuous joint's positions without the jumps of an encoder that begins anew: the short way round.

    A log that goes on for more than a turn and has two such steps one after another in one direction counts turns by
    itself: the joint is that fast.

    Args:
        value: (n,) in the log's unit.
        turn: a full turn in this unit.
    """
    steps = np.diff(value)
    turns = np.rint(steps / turn)
    if len(value) and np.ptp(value) > turn * (1 + 1e-6):
        same = np.sign(turns[1:]) * np.sign(turns[:-1]) > 0
        fast = np.concatenate([[False], same]) | np.concatenate([same, [False]]) if len(turns) > 1 else turns > 2
        turns = np.where(fast, 0.0, turns)
    return value - turn * np.concatenate([[0.0], np.cumsum(turns)])


def _several(publishers: tuple[Publisher, ...]) -> str:
    channels = sorted({channel for channel, _ in publishers})
    rule = "is moved by several publishers on one topic of the log at the same time"
    if len(channels) > 1:
        named = ", ".join(map(str, channels))
        return f"{rule}: channels {named}; choose one by motion.recorded.channel"
    named = ", ".join(repr(frame) for _, frame in publishers)
    return f"{rule}: frame_id {named}; choose one by motion.recorded.frame_id"


def _value(value: np.ndarray) -> str:
    return " ".join(f"{number:.6g}" for number in np.atleast_1d(value))


def _first(mask: Flags) -> int:
    return int(np.flatnonzero(mask)[0])
