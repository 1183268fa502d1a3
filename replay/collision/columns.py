"""What the collision pipeline says of n frames, as columns."""

from __future__ import annotations

import enum
from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cache
from typing import Annotated

import numpy as np

from replay.numerics.arrays import Bytes, Flags, Floats, Integers
from replay.numerics.columns import Columns, Field, Kind

MARGIN = 0.05
"""[m] Clearances up to this one are computed where a scenario does not say another."""

_LEVELS = {"bounds": 3, "contact": 4}
_CHART = "Clearance of pairs that are near [m]"


class Level(enum.IntEnum):
    """State of a pair of shapes in one frame, as the thesis shows it."""

    CLEAR = 0
    BOUNDS = 1  # only the bounding volumes meet
    CONTACT = 2  # the shapes meet


class Between(enum.IntEnum):
    """What is known of a pair over the interval that ends at a frame."""

    CLEAR = 0  # proven: the shapes do not meet at any moment of it
    CONTACT = 1  # the shapes meet at a moment of it, its ends included
    UNDECIDED = 2  # neither is proven
    NOT_LOOKED = 3  # there is no interval, or nobody asked


@dataclass(frozen=True, eq=False)
class Crossings:
    """Moments at which levels of pairs begin or end: k entries, sorted by `latest`, then by pair.

    A moment is known by a bracket: the level has changed by `latest`, a moment at which the poses show it, and nothing
    is said of when, between `earliest` and `latest`, it did.

    Attributes:
        pair: (k,) column of the pair.
        level: (k,) uint8, `Level.BOUNDS` or `Level.CONTACT`: this level or a higher one begins or ends.
        begins: (k,) bool, whether it begins; else it ends.
        earliest: (k,) [ns] from the scenario's start, rounded down.
        latest: (k,) [ns], rounded up.
        frame: (k,) frame of the scenario, the first at or after `latest`.
    """

    pair: Integers
    level: Bytes
    begins: Flags
    earliest: Integers
    latest: Integers
    frame: Integers

    def __eq__(self, other: object) -> bool:
        names = [item.name for item in fields(Crossings)]
        return isinstance(other, Crossings) and all(
            np.array_equal(getattr(self, name), getattr(other, name)) for name in names
        )

    __hash__ = None  # type: ignore[assignment]

    @staticmethod
    @cache
    def none() -> Crossings:
        """Return no entries."""
        empty = np.zeros(0, dtype=np.int64)
        return Crossings(empty, np.zeros(0, dtype=np.uint8), np.zeros(0, dtype=bool), empty, empty, empty)

    @staticmethod
    def joined(parts: Sequence[Crossings]) -> Crossings:
        """Return the entries of several as one; at one moment, higher levels begin last and end first."""
        parts = [part for part in parts if len(part.pair)]
        if not parts:
            return Crossings.none()
        names = [item.name for item in fields(Crossings)]
        columns = {name: np.concatenate([getattr(part, name) for part in parts]) for name in names}
        rank = np.where(columns["begins"], 1, -1) * columns["level"].astype(np.int64)
        order = np.lexsort((rank, columns["pair"], columns["latest"]))
        return Crossings(**{name: values[order] for name, values in columns.items()})

    def of(self, pairs: Integers) -> Crossings:
        """Return the entries with pair k called pairs[k]."""
        return replace(self, pair=pairs[self.pair])


_BETWEEN = Field(
    kind=Kind.CATEGORY,
    each="pairs",
    states=Between,
    open=(Between.CLEAR, Between.CONTACT, Between.UNDECIDED),
    nothing=Between.NOT_LOOKED,
    since=2,
)


@dataclass(frozen=True, eq=False)
class CollisionColumns(Columns):
    """Collision results of n frames and P pairs.

    Attributes:
        level: (n, P) uint8, see `Level`.
        clearance: (n, P) [m], distance between the shapes; 0 in contact, NaN where not evaluated.
        evaluated: (n, P) bool, whether `clearance` is a distance.
        undecided: (n, P) bool, whether GJK reached its accuracy limit; the level is then contact, for safety.
        between: (n, P) uint8, see `Between`, of the interval that ends at the frame; None in a recording of before it
            was known, as `clearance_bound`.
        clearance_bound: (n, P) [m], proven lower bound of the clearance over that interval; 0 in contact, NaN where not
            looked at. It does not exceed the margin where the clearance is not evaluated.
        crossings: what began and ended between the frames; not a column.
    """

    level: Annotated[Bytes, Field(states=Level, each="pairs", events=_LEVELS, begins=("overlap of bounds", "contact"))]
    clearance: Annotated[Floats, Field(unit="m", each="pairs", gate="evaluated", chart=_CHART)]
    evaluated: Annotated[Flags, Field(each="pairs", open=(1,), begins=("evaluation of the clearance",))]
    undecided: Annotated[Flags, Field(each="pairs", events={"undecided": 3})]
    between: Annotated[Bytes | None, _BETWEEN] = None
    clearance_bound: Annotated[
        Floats | None, Field(unit="m", each="pairs", gate="between", since=2, spoken="proven clearance")
    ] = None
    crossings: Crossings = field(default_factory=Crossings.none)


@dataclass(frozen=True, eq=False)
class CollisionEntries:
    """Collision results of n frames without the clear ones: k entries, by frame, then by pair.

    Every pair and frame that has no entry is clear, without a clearance.

    Attributes:
        frame: (k,) frame within the block.
        bodies: (k, 2) the pair's two bodies, in the pair's order.
        level: (k,) uint8, see `Level`; clear where only the clearance is of interest.
        clearance: (k,) [m], distance between the shapes; 0 in contact, NaN where not evaluated.
        undecided: (k,) bool, see `CollisionColumns`.
    """

    frame: Integers
    bodies: Integers
    level: Bytes
    clearance: Floats
    undecided: Flags
