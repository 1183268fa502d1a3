"""A body as a union of convex sets: what GJK and the collision pipeline read."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, NamedTuple

import numpy as np

from replay.errors import InvalidValue
from replay.geometry.closing import NO_CAPS
from replay.geometry.hull import extreme_points
from replay.geometry.solid import Solid
from replay.geometry.tree import Tree, boxes_of, build_tree
from replay.numerics.arrays import Floats, Integers
from replay.numerics.kept import kept
from replay.numerics.rows import distinct_rows


class ConvexSets(NamedTuple):
    """A body as the union of m convex sets (convex pieces, or the triangles of its surface), in its link's frame.

    Set k is the convex hull of `vertices[first[k]:first[k + 1]]`. `surface` says that the sets are the surface
    triangles of a body that has an inside, so that a body wholly inside another needs a point-in-solid test beside
    them; `closing` are the caps of one that is not watertight, see `Solid`.
    """

    vertices: Floats  # (v, 3) [m]
    first: Integers  # (m + 1,)
    tree: Tree  # over the sets' boxes
    surface: bool
    closing: Floats  # (c, 3, 3) [m]


@kept
def convex_sets(solid: Solid, *, pieces: Literal["exact", "convex", "hull"] = "exact") -> ConvexSets:
    """Return the convex sets that stand for a solid in collisions.

    Args:
        solid: the body.
        pieces: "exact": the solid's own convex pieces, or one set a triangle when it has none; "convex": its own
            pieces, or an approximate convex decomposition when it has none (see `decomposition.decompose`); "hull":
            the convex hull of the whole.

    Raises:
        InvalidValue: another value of `pieces`, or no triangles.
    """
    if pieces not in ("exact", "convex", "hull"):
        raise InvalidValue("pieces", pieces, "must be one of exact, convex, hull")
    if len(solid.triangles) == 0:
        raise InvalidValue("solid.triangles", solid.triangles.shape, "a body needs at least one triangle")
    if pieces == "hull":
        return from_pieces([solid.vertices])
    if solid.pieces:
        return from_pieces(solid.pieces, extreme=solid.strictly_convex)
    if pieces == "exact":
        return _from_triangles(solid)
    from replay.geometry.decomposition import decompose

    return from_pieces(decompose(solid).pieces)


def from_pieces(pieces: Sequence[Floats], *, extreme: bool = False) -> ConvexSets:
    """Return the sets of convex pieces given by vertices (k, 3) [m].

    Vertices inside a piece's hull are left out; none is looked for if all are known to be extreme.
    """
    vertices = [distinct_rows(np.asarray(piece, dtype=np.float64) + 0.0).rows for piece in pieces]
    if not extreme:
        vertices = [extreme_points(piece) for piece in vertices]
    first = np.concatenate([[0], np.cumsum([len(k) for k in vertices])]).astype(np.int64)
    lower = np.array([k.min(axis=0) for k in vertices])
    upper = np.array([k.max(axis=0) for k in vertices])
    return ConvexSets(
        vertices=np.concatenate(vertices),
        first=first,
        tree=build_tree(lower, upper, leaf_size=1),
        surface=False,
        closing=NO_CAPS,
    )


def _from_triangles(solid: Solid) -> ConvexSets:
    triangles = np.ascontiguousarray(solid.triangles)
    return ConvexSets(
        vertices=triangles.reshape(-1, 3),
        first=np.arange(0, 3 * len(triangles) + 1, 3, dtype=np.int64),
        tree=build_tree(*boxes_of(triangles), leaf_size=1),
        surface=solid.has_inside,
        closing=solid.closing,
    )
