"""All bodies of a scene as flat arrays, so that one kernel call serves every pair and frame of a block."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, NamedTuple

import numpy as np
from numba import boolean, float64, int64
from numpy.typing import NDArray

from replay.collision.pairs import CollisionBody
from replay.collision.support import SETS_TYPE, Sets, make_sets
from replay.errors import InvalidValue
from replay.geometry.bounds import fit_aabb, fit_sphere, principal_obb
from replay.geometry.convex import ConvexSets, convex_sets
from replay.geometry.tree import TREE_TYPE, Tree
from replay.numerics.arrays import Flags, Floats, Integers
from replay.numerics.jit import record
from replay.numerics.rows import distinct_rows

Bounds = Literal["obb", "obb_vertices", "aabb", "sphere"]
Pieces = Literal["exact", "convex", "hull"]

SPHERE, AABB, OBB = 0, 1, 2
"""Kinds of bounding volumes, as kernels see them."""

_INFLATION = 1.0 + 2.0**-48
"""Covers the rounding of centres, half widths and radii that are computed here from exact boxes."""


class Volumes(NamedTuple):
    """The bounding volumes of B bodies, each in its link's frame.

    `half` are the half widths along the rows of `axes` for boxes. `radius` is that of the sphere about `center` which
    holds the body and, however its link turns, its volume; for kind SPHERE it is the volume.
    """

    kind: int
    center: Floats  # (B, 3) [m]
    half: Floats  # (B, 3) [m]
    axes: Floats  # (B, 3, 3)
    radius: Floats  # (B,) [m]


VOLUMES_TYPE = record(Volumes, int64, float64[:, ::1], float64[:, ::1], float64[:, :, ::1], float64[::1])


class Bodies(NamedTuple):
    """B bodies as unions of convex sets under box trees, concatenated; tree entries count from each body's own start.

    The convex sets of body k are `set_first[k]:set_first[k + 1]`, its tree nodes `node_first[k]:node_first[k + 1]`,
    `probes[probe_first[k]:probe_first[k + 1]]` holds a point of each of its connected parts, and `closing` its caps.
    """

    sets: Sets
    set_first: Integers  # (B + 1,)
    tree: Tree
    node_first: Integers  # (B + 1,)
    node_center: Floats  # (m, 3) [m]
    node_half: Floats  # (m, 3) [m]
    surface: Flags  # (B,), see `geometry.ConvexSets`
    reach: Floats  # (B,) [m], largest distance of a vertex from the link's origin
    probes: Floats  # (p, 3) [m]
    probe_first: Integers  # (B + 1,)
    closing: Floats  # (c, 3, 3) [m], the caps of surfaces that are open but have an inside
    closing_first: Integers  # (B + 1,)


BODIES_TYPE = record(
    Bodies,
    SETS_TYPE,
    int64[::1],
    TREE_TYPE,
    int64[::1],
    float64[:, ::1],
    float64[:, ::1],
    boolean[::1],
    float64[::1],
    float64[:, ::1],
    int64[::1],
    float64[:, :, ::1],
    int64[::1],
)


def collect(bodies: Sequence[CollisionBody], *, pieces: Pieces) -> Bodies:
    """Return bodies as arrays; see `geometry.convex_sets` for `pieces`."""
    several = [convex_sets(body.solid, pieces=pieces) for body in bodies]
    probes = [_probes(sets) for sets in several]
    vertices = [sets.vertices for sets in several]
    vertex_first = _starts(vertices)
    lower = np.concatenate([sets.tree.lower for sets in several])
    upper = np.concatenate([sets.tree.upper for sets in several])
    center = 0.5 * lower + 0.5 * upper
    extent = np.maximum(np.abs(lower), np.abs(upper))
    half = np.maximum(upper - center, center - lower) * _INFLATION + 2.0**-52 * extent
    return Bodies(
        sets=make_sets(
            np.concatenate(vertices),
            _joined([sets.first for sets in several], vertex_first),
        ),
        set_first=_starts([sets.first[1:] for sets in several]),
        tree=Tree(lower, upper, *(np.concatenate([sets.tree[k] for sets in several]) for k in range(2, 6))),
        node_first=_starts([sets.tree.second for sets in several]),
        node_center=center,
        node_half=half,
        surface=np.array([sets.surface for sets in several]),
        reach=np.array([float(np.sqrt(np.sum(points**2, axis=1).max())) for points in vertices]),
        probes=np.concatenate(probes),
        probe_first=_starts(probes),
        closing=np.concatenate([sets.closing for sets in several]),
        closing_first=_starts([sets.closing for sets in several]),
    )


def fit_volumes(bodies: Sequence[CollisionBody], arrays: Bodies, *, bounds: Bounds, pieces: Pieces) -> Volumes:
    """Return the bounding volumes of bodies: around the shape as it is collided.

    Raises:
        InvalidValue: unknown `bounds`.
    """
    n = len(bodies)
    center, half, radius = np.zeros((n, 3)), np.zeros((n, 3)), np.zeros(n)
    axes = np.broadcast_to(np.identity(3), (n, 3, 3)).copy()
    for k, body in enumerate(bodies):
        begin, end = (arrays.sets.first[arrays.set_first[j]] for j in (k, k + 1))
        points = distinct_rows(arrays.sets.vertices[begin:end]).rows
        if bounds == "sphere":
            sphere = fit_sphere(points)
            center[k], radius[k] = sphere.center, sphere.radius
            continue
        if bounds == "aabb":
            aabb = fit_aabb(points)
            center[k], half[k] = aabb.center, aabb.half_widths
            # turned by R it has half widths |R| w, none of which exceeds |w|
            radius[k] = np.sqrt(3.0 * np.sum(half[k] ** 2)) * _INFLATION
            continue
        if bounds == "obb":
            obb = principal_obb(points, triangles=body.solid.triangles if pieces == "exact" else None)
        elif bounds == "obb_vertices":
            obb = principal_obb(points, method="vertices")
        else:
            raise InvalidValue("bounds", bounds, "must be one of obb, obb_vertices, aabb, sphere")
        center[k], half[k], axes[k] = obb.center, obb.half_widths, obb.axes
        radius[k] = np.sqrt(np.sum(half[k] ** 2)) * _INFLATION
    kind = {"sphere": SPHERE, "aabb": AABB}.get(bounds, OBB)
    return Volumes(kind, center, half, axes, radius)


def _probes(sets: ConvexSets) -> Floats:
    """Return a point of each connected part: of each piece, or of each shell of a surface (shells share no corner)."""
    if not sets.surface:
        return sets.vertices[sets.first[:-1]]
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    distinct, _, kind = distinct_rows(sets.vertices)
    corners = kind.reshape(-1, 3)
    rows, columns = np.concatenate([corners[:, :2], corners[:, 1:]]).T
    graph = coo_array((np.ones(len(rows)), (rows, columns)), shape=(len(distinct), len(distinct)))
    _, label = connected_components(graph, directed=False)
    _, first = np.unique(label, return_index=True)
    return distinct[first]


def _starts(parts: Sequence[NDArray[np.generic]]) -> Integers:
    return np.concatenate([[0], np.cumsum([len(part) for part in parts])]).astype(np.int64)


def _joined(firsts: Sequence[Integers], offsets: Integers) -> Integers:
    """Return running starts of several bodies as one, the closing entry of each but the last left out."""
    parts = [first[:-1] + offset for first, offset in zip(firsts, offsets, strict=False)]
    return np.concatenate([*parts, offsets[-1:]]).astype(np.int64)
