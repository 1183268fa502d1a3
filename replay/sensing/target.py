"""What sensors sense: the triangles of a shape in its link's frame, with the tree over them."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from replay.errors import InvalidValue
from replay.geometry.tree import Tree, triangle_tree
from replay.numerics.arrays import Floats


@dataclass(frozen=True, eq=False)
class Target:
    """A shape as sensors see it.

    Attributes:
        name: "link/shape".
        link: index of the link that carries the shape.
        triangles: (n, 3, 3) corners in the link's frame [m], n >= 1, counter-clockwise seen from outside.
        tree: over the triangles, in the link's frame.
        closing: (m, 3, 3) the caps [m] of a body that has an inside, none if it is closed; None: it has no inside. See
            `geometry.closing`.
        earth: capacitance [F] between the link and earth through what is not modelled; inf: the link is grounded.
    """

    name: str
    link: int
    triangles: Floats
    tree: Tree
    closing: Floats | None = None
    earth: float = math.inf


def make_target(
    name: str, link: int, triangles: ArrayLike, *, closing: Floats | None = None, earth: float = math.inf
) -> Target:
    """Return the target of a shape.

    Args:
        name: "link/shape".
        link: index of the link that carries the shape, 0 or more.
        triangles: (n, 3, 3) corners in the link's frame [m], finite, n >= 1.
        closing, earth: see `Target`.

    Raises:
        InvalidValue: wrong shape, no triangles, a coordinate that is not finite, a negative link.
    """
    corners = np.ascontiguousarray(triangles, dtype=np.float64)
    if corners.ndim != 3 or corners.shape[1:] != (3, 3) or len(corners) == 0:
        raise InvalidValue(f"{name}.triangles", f"array of shape {corners.shape}", "must have shape (n, 3, 3), n >= 1")
    if not np.isfinite(corners).all():
        raise InvalidValue(f"{name}.triangles", "an array with NaN or infinity", "must be finite")
    if link < 0:
        raise InvalidValue(f"{name}.link", link, "must be the index of a link, 0 or more")
    return Target(name, link, corners, triangle_tree(corners), closing, earth)
