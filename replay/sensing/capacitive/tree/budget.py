"""How wrong the sum over a tree may be, and what is known of it on the way."""

from __future__ import annotations

import math
from typing import NamedTuple

from replay.numerics.arrays import Floats
from replay.numerics.jit import inlined_kernel
from replay.sensing.capacitive.placed_plate import PlacedPlate, beyond_borders, place
from replay.sensing.capacitive.tree.registers import AREA, CENTROID, MEAN2

_FIRST_PARTS = 32.0
"""Before errors are compared, a part is opened that has more than this fraction of the whole error, times the eighth
root of rtol: the smaller that is, the more parts share the error."""


class Budget(NamedTuple):
    """What is asked of a sum.

    Attributes:
        rtol: largest relative error.
        first: a part with a larger error is opened before the errors are compared [m].
        scale: brings the errors of parts to the order of 1 at most [1/m].
    """

    rtol: float
    first: float
    scale: float


class SumTally(NamedTuple):
    """What is known of a sum.

    Attributes:
        done: sum over the triangles without a rule, as far as they are summed [m].
        spent: bound of the error of `done` [m].
        least: lower bound of the whole sum [m].
        doubt: sum of the error bounds of the parts in the queue [m].
    """

    done: float
    spent: float
    least: float
    doubt: float


@inlined_kernel
def budget_of(nodes: Floats, plate: PlacedPlate, rtol: float) -> Budget:
    """Return the budget of a sum over all of a body's `Clusters.nodes`."""
    ceiling = rtol * _least_of_root(nodes, plate)
    root = math.sqrt(math.sqrt(math.sqrt(rtol)))
    return Budget(rtol, ceiling * root / _FIRST_PARTS, 1.0 / ceiling if ceiling > 0.0 else 1.0)


@inlined_kernel
def is_met(budget: Budget, tally: SumTally) -> bool:
    """Return whether the error bounds are small enough."""
    return tally.doubt + tally.spent <= budget.rtol * tally.least


@inlined_kernel
def _least_of_root(nodes: Floats, plate: PlacedPlate) -> float:
    """Return a lower bound of the integral over all triangles [m], by Jensen."""
    x, y, z = place(plate.T_plate_body, nodes[0, CENTROID], nodes[0, CENTROID + 1], nodes[0, CENTROID + 2])
    u, v = beyond_borders(x, y, plate.half_x, plate.half_y)
    square = u * u + v * v + z * z + nodes[0, MEAN2]
    return nodes[0, AREA] / math.sqrt(square) if square > 0.0 else 0.0
