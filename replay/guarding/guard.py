"""A guard of a scene: its condition by columns, its joints by index, its times in frames."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class SensorLeaf:
    """A sensor tells less than a threshold.

    Attributes:
        kind, column: of the sensor.
        below: the threshold; `released` the one below which the condition is not gone yet.
    """

    kind: str
    column: int
    below: float
    released: float


@dataclass(frozen=True, eq=False)
class PairLeaf:
    """The smallest clearance of some pairs is below a threshold [m]; 0: any of them is in contact.

    Attributes:
        columns: of the pairs among all that are tested.
        below, released: see `SensorLeaf`.
    """

    columns: NDArray[np.intp]
    below: float
    released: float


@dataclass(frozen=True, eq=False)
class SeparationLeaf:
    """A distance sensor, or the smallest clearance of pairs, tells less than S = K (reaction + t_stop) + C.

    t_stop is the time in which the guard's joints stop from their speed in that frame.

    Attributes:
        sensor, pairs: one of the two; thresholds of it are not used.
        speed: K [m/s].
        constant: C + K reaction [m].
        hysteresis: added to S for the release [m].
        largest: S where all joints are as fast as they ever are [m].
    """

    sensor: SensorLeaf | None
    pairs: PairLeaf | None
    speed: float
    constant: float
    hysteresis: float
    largest: float


Leaf = SensorLeaf | PairLeaf | SeparationLeaf


@dataclass(frozen=True, eq=False)
class Combined:
    """Several conditions, of which all or any must hold."""

    parts: tuple[Leaf | Combined, ...]
    all: bool


def leaves(condition: Leaf | Combined) -> Iterator[Leaf]:
    """Yield the conditions that are no combinations, in the order in which they are written."""
    if isinstance(condition, Combined):
        for part in condition.parts:
            yield from leaves(part)
    else:
        yield condition


@dataclass(frozen=True, eq=False)
class Guard:
    """A guard.

    Attributes:
        name: of the guard.
        when: its condition.
        directions: joints by index and the sign of their script's velocity, one of which must be so; none: any motion.
        hold_frames: how many frames later than the first one the condition must still hold.
        reaction: [s].
        target: what it makes of the speed of its joints, 0 to stop.
        joints: indices of its joints among those with a position, ascending.
        deceleration, acceleration: (k,) limits of these joints for braking and for going on.
        release_frames: how many frames later than the first one the condition must still be gone; None: it never lets
            go.
    """

    name: str
    when: Leaf | Combined
    directions: tuple[tuple[int, int], ...]
    hold_frames: int
    reaction: float
    target: float
    joints: tuple[int, ...]
    deceleration: tuple[float, ...]
    acceleration: tuple[float, ...]
    release_frames: int | None


def whole_frames(time: Fraction, rate: Fraction) -> int:
    """Return how many frames at a rate [Hz] are at least a time [s]."""
    frames = time * rate
    return -(-frames.numerator // frames.denominator)
