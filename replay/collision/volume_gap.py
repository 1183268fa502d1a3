"""How far apart two bodies' bounding volumes are."""

from __future__ import annotations

from replay.collision.bodies import AABB, OBB, Volumes
from replay.collision.broad import sphere_gap
from replay.geometry.overlap import obbs_gap
from replay.numerics.arrays import Floats
from replay.numerics.jit import leaf_kernel


@leaf_kernel
def boxes_gap(volumes: Volumes, a: int, b: int, pose: Floats, turn: Floats, scratch: Floats) -> float:
    """Return a lower bound on the distance [m] of two bodies' volumes that do not meet; arguments of `volumes_meet`."""
    gap = sphere_gap(volumes, a, b, pose)
    if volumes.kind == OBB:
        box = obbs_gap(
            volumes.center[a],
            volumes.half[a],
            volumes.axes[a],
            volumes.center[b],
            volumes.half[b],
            volumes.axes[b],
            pose,
        )
        gap = max(gap, box)
    elif volumes.kind == AABB:  # `volumes_meet` left both boxes in the scratch
        for i in range(3):
            reach = scratch[5, i] + scratch[7, i]
            size = reach + abs(scratch[i, 3]) + abs(scratch[4, i]) + abs(scratch[6, i])
            gap = max(gap, abs(scratch[i, 3] + scratch[6, i] - scratch[4, i]) - reach - 2.0**-44 * size)
    return gap
