"""Whether a plate is inside a body, or lies flush on one and faces into it (METHODS 4).

Asked of plates that no triangle saturates. Then, just before the plate, the body's surface is met at single points at
most, so all of that layer is inside the body or none of it. If only faces count that face the plate's centre, and it
is outside, others are too: on the way in from there is a face that faces it. So three points about the centre tell;
not the centre itself, which the tip of a body may touch, or which a wall that does not face it may go through. They lie
before the plate by more than what rounding takes for touching it, so a body that the plate's back lies flush on does
not hold them, and one that its front lies flush on does.
"""

from __future__ import annotations

import numpy as np
from numba import float64
from numpy.typing import NDArray

from replay.geometry.containment import inside
from replay.geometry.tree import TREE_TYPE, Tree
from replay.numerics.jit import entry, kernel

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

_POINTS = 1e-3 * np.array([[0.37, 0.21], [-0.29, 0.31], [0.05, -0.43]])
"""About the plate's centre, in its half sizes."""

_BEFORE = 16.0
"""How far before the plate, in what rounding takes for touching."""


@entry(float64[:, :, ::1], TREE_TYPE, float64[:, :, ::1], float64[:, :, :, ::1], float64[:, ::1], float64[::1])
@kernel
def plates_inside(
    triangles: Floats, tree: Tree, closing: Floats, T_plate_body: Floats, half_sizes: Floats, rounding: Floats
) -> Flags:
    """Return which plates (n, p) are inside a body that has an inside.

    Args:
        triangles, tree, closing: of the body, in its link's frame.
        T_plate_body: (n, p, 4, 4) poses of the link.
        half_sizes: (p, 2) [m].
        rounding: (n,) [m], corners no farther than this from a plate's plane are on it.
    """
    n, plates = T_plate_body.shape[0], T_plate_body.shape[1]
    found = np.empty((n, plates), np.bool_)
    point = np.empty(3)
    for frame in range(n):
        for plate in range(plates):
            T = T_plate_body[frame, plate]
            held = False
            for k in range(len(_POINTS)):
                x = half_sizes[plate, 0] * _POINTS[k, 0] - T[0, 3]
                y = half_sizes[plate, 1] * _POINTS[k, 1] - T[1, 3]
                z = _BEFORE * rounding[frame] - T[2, 3]
                for axis in range(3):
                    point[axis] = T[0, axis] * x + T[1, axis] * y + T[2, axis] * z
                if not held and inside(point, triangles, tree, closing) == 1:
                    held = True
            found[frame, plate] = held
    return found
