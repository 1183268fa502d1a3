"""What guards do in n frames, as columns, and when exactly it begins and ends."""

from __future__ import annotations

import enum
from dataclasses import dataclass, field
from typing import Annotated

from replay.numerics.arrays import Bytes, Flags, Floats
from replay.numerics.columns import Columns, Field, Kind

EXCESS = "excess acceleration"
EVENTS = {"trigger": 3, "hold": 3, "release": 2, EXCESS: 4}
"""What begins and ends of guards (excess acceleration: of their joints), and Foxglove's log level of its beginning."""


class GuardState(enum.IntEnum):
    """What a guard does in a frame."""

    ARMED = 0
    REACTING = 1  # triggered, and not braking yet
    BRAKING = 2
    HOLDING = 3  # its joints rest, or are as slow as it makes them
    RELEASING = 4  # its joints are let go


@dataclass(frozen=True)
class Happening:
    """What begins or ends at a moment between or at frames.

    Attributes:
        time: [s].
        kind: one of `EVENTS`.
        subject: the guard, or the joint.
        begins: whether it begins; else it ends.
    """

    time: float
    kind: str
    subject: str
    begins: bool


@dataclass(frozen=True, eq=False)
class GuardColumns(Columns):
    """G guards and J joints in n frames.

    Attributes:
        state: (n, G) uint8, see `GuardState`.
        condition: (n, G) bool, whether the guard's condition holds, as it is looked at in that state: with its
            hysteresis while it holds its joints.
        factor: (n, G), what it makes of the speed of its joints; 1 while it does not act.
        rate: (n, J), how fast the scripts of joints are played: the least factor of the guards that name them.
        script_time: (n, J) [s], how far the scripts have come.
        happenings: what began and ended since the frame before, by time; not a column.
    """

    state: Annotated[Bytes, Field(kind=Kind.CATEGORY, states=GuardState, each="guards")]
    condition: Annotated[Flags, Field(each="guards", begins=("condition",))]
    factor: Annotated[Floats, Field(each="guards")]
    rate: Annotated[Floats, Field(each="joints", chart="Clocks of the joints' scripts")]
    script_time: Annotated[Floats, Field(each="joints", unit="s")]
    happenings: tuple[Happening, ...] = field(default=())
