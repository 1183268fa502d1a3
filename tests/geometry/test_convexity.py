"""Convex or not is what holding every corner against every plane says."""

from fractions import Fraction

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from replay.geometry.convexity import _winds_once, convex_piece
from replay.geometry.facets import ROUNDING
from replay.geometry.hull import extreme_points
from replay.geometry.primitives import capsule, cuboid, cylinder, ellipsoid, sphere
from replay.geometry.winding import corner_indices

RNG = np.random.default_rng(24)


def hull_of(points):
    """Return the hull of points as a surface."""
    hull = ConvexHull(points)
    faces = hull.simplices
    a, b, c = np.moveaxis(points[faces], 1, 0)
    inward = np.sum(np.cross(b - a, c - a) * hull.equations[:, :3], axis=1) < 0.0
    faces[inward] = faces[inward][:, ::-1]
    return points[faces]


def on_sphere(count):
    points = RNG.normal(size=(count, 3))
    return points / np.linalg.norm(points, axis=1)[:, None]


def bipyramid(ring):
    """Return the surface of two tips over a closed ring of points around the z axis."""
    following, tip = np.roll(ring, -1, axis=0), np.broadcast_to([0.0, 0.0, 1.0], ring.shape)
    return np.concatenate([np.stack([ring, following, tip], axis=1), np.stack([following, ring, -tip], axis=1)])


def wound_twice(swing):
    """Return a surface convex across every edge that winds about its axis twice, its corners all different."""
    turn = np.arange(22) * (4.0 * np.pi / 22)
    radius = 1.0 + swing * np.sin(0.5 * turn + 0.2)
    return bipyramid(np.stack([radius * np.cos(turn), radius * np.sin(turn), np.zeros(22)], axis=1))


def dented(triangles, depth):
    points, faces = corner_indices(triangles)
    points[len(points) // 3] *= 1.0 - depth
    return points[faces]


ROUND = sphere(1.0, 0.01).triangles
TURNED = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
SURFACES = {
    "sphere": ROUND,
    "far away": (ROUND @ TURNED + 1000.0).astype(np.float32).astype(np.float64),
    "tiny": 1e-9 * ROUND,
    "needle": ROUND * (1e-4, 1e-4, 1.0),
    "hull": hull_of(RNG.normal(size=(60, 3))),
    "random on a sphere": hull_of(on_sphere(700)),
    "ellipsoid": ellipsoid([1.0, 0.7, 0.2], 0.01).triangles @ TURNED,
    "box": cuboid([1.0, 2.0, 3.0]).triangles @ TURNED,
    "single precision": (cuboid([1.0, 2.0, 3.0]).triangles @ TURNED).astype(np.float32).astype(np.float64),
    "cylinder": cylinder(1.0, 2.0, 0.01).triangles @ TURNED,
    "capsule": capsule(1.0, 2.0, 0.05).triangles @ TURNED,
    "two": np.concatenate([ROUND, ROUND + 5.0]),
    "nested": np.concatenate([ROUND, 0.5 * ROUND]),
    "cavity": np.concatenate([ROUND, 0.5 * ROUND[:, ::-1]]),
    "twice, nearly": np.concatenate([ROUND, (1.0 + 1e-8) * ROUND]),
    "overlapping": np.concatenate([ROUND, ROUND + np.array([0.2, 0.0, 0.0])]),
    "inside out": ROUND[:, ::-1],
    "wound twice": wound_twice(0.2),
    "wound twice, nearly alike": wound_twice(1e-8),
    **{f"dent of {depth}": dented(ROUND, depth) for depth in (2.0**-52, 1e-12, 1e-9, 2e-7, 1e-5, 1e-3, 0.1)},
    **{f"flat dent of {d}": dented(hull_of(RNG.uniform(-1, 1, (300, 3))), d) for d in (1e-9, 2e-7, 1e-6, 1e-3)},
}


@pytest.mark.parametrize("name", SURFACES)
def test_every_corner_is_held_against_every_plane(name):
    points, faces = corner_indices(SURFACES[name])
    slack = ROUNDING * np.abs(points).max()
    a, b, c = np.moveaxis(points[faces], 1, 0)
    normals = np.cross(b - a, c - a)
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    highest = max(float((points @ n - p @ n).max()) for n, p in zip(normals, a, strict=True))
    assert abs(highest - slack) > 1e-3 * slack, "not near the limit, where rounding decides"
    found = convex_piece(points, faces)
    assert (found is not None) == (highest <= slack)
    if found is not None:
        assert np.array_equal(found.corners, extreme_points(points))


@pytest.mark.parametrize("name", ["sphere", "far away", "tiny", "hull", "random on a sphere", "ellipsoid"])
def test_smooth_bodies_need_no_hull(name):
    found = convex_piece(*corner_indices(SURFACES[name]))
    assert found is not None and found.strictly


@pytest.mark.parametrize("swing", [0.2, 1e-8])
def test_convex_across_every_edge_is_not_enough(swing):
    points, faces = corner_indices(wound_twice(swing))
    assert len(points) == 24 and not _winds_once(points, faces)
    exact = [[Fraction(x) for x in point] for point in points.tolist()]
    edges = {(f[k], f[k - 2]): f[k - 1] for f in faces.tolist() for k in range(3)}
    for (start, end), third in edges.items():
        a, b, c, d = (exact[k] for k in (start, end, third, edges[end, start]))
        u, v, w = ([x - y for x, y in zip(p, a, strict=True)] for p in (b, c, d))
        normal = [u[i - 2] * v[i - 1] - u[i - 1] * v[i - 2] for i in range(3)]
        assert sum(x * y for x, y in zip(normal, w, strict=True)) < 0, "convex across each edge, exactly"
    turn = np.arange(11) * (2.0 * np.pi / 11)
    assert _winds_once(*corner_indices(bipyramid(np.stack([np.cos(turn), np.sin(turn), 0.0 * turn], axis=1))))
