"""What the collision pipeline says of n frames, as columns."""

from __future__ import annotations

import enum
from dataclasses import dataclass
from typing import Annotated

from replay.numerics.arrays import Bytes, Flags, Floats, Integers
from replay.numerics.columns import Columns, Field

MARGIN = 0.05
"""[m] Clearances up to this one are computed where a scenario does not say another."""

_LEVELS = {"bounds": 3, "contact": 4}
_CHART = "Clearance of pairs that are near [m]"


class Level(enum.IntEnum):
    """State of a pair of shapes in one frame, as the thesis shows it."""

    CLEAR = 0
    BOUNDS = 1  # only the bounding volumes meet
    CONTACT = 2  # the shapes meet


@dataclass(frozen=True, eq=False)
class CollisionColumns(Columns):
    """Collision results of n frames and P pairs.

    Attributes:
        level: (n, P) uint8, see `Level`.
        clearance: (n, P) [m], distance between the shapes; 0 in contact, NaN where not evaluated.
        evaluated: (n, P) bool, whether `clearance` is a distance.
        undecided: (n, P) bool, whether GJK reached its accuracy limit; the level is then contact, for safety.
    """

    level: Annotated[Bytes, Field(states=Level, each="pairs", events=_LEVELS, begins=("overlap of bounds", "contact"))]
    clearance: Annotated[Floats, Field(unit="m", each="pairs", gate="evaluated", chart=_CHART)]
    evaluated: Annotated[Flags, Field(each="pairs", open=(1,), begins=("evaluation of the clearance",))]
    undecided: Annotated[Flags, Field(each="pairs", events={"undecided": 3})]


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
