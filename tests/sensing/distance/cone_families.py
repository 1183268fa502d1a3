"""Random cones and triangles in the families of the hard cases: where the formulas of a cone sensor go wrong."""

import math

import numpy as np


def _unit(rng, n):
    vectors = rng.normal(size=(n, 3))
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def _generic(rng, n):
    triangles = rng.normal(size=(n, 3, 3)) * np.exp(rng.uniform(-1.0, 1.5, size=(n, 1, 1)))
    return triangles, _unit(rng, n), 2.0 * rng.uniform(0.02, 1.1, size=n)


def _inner(rng, triangles, low=0.0):
    weights = rng.dirichlet((1.0, 1.0, 1.0), size=len(triangles))
    weights = low / 3.0 + (1.0 - low) * weights
    return np.sum(weights[:, :, None] * triangles, axis=1)


def _normals(triangles):
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)


def _towards(points):
    return points / np.linalg.norm(points, axis=1, keepdims=True)


def _tilted(rng, directions, angles):
    """Unit vectors at given angles from given directions."""
    sideways = np.cross(directions, _unit(rng, len(directions)))
    sideways = _towards(sideways)
    return _towards(np.cos(angles)[:, None] * directions + np.sin(angles)[:, None] * sideways)


def random(rng, n):
    return _generic(rng, n)


def parallel(rng, n):
    triangles, axes, apertures = _generic(rng, n)
    axes = _towards(np.cross(_normals(triangles), axes))
    return triangles, axes, apertures


def behind_s(rng, n):
    """The axis leaves the plane slowly: its intersection with it lies behind the apex."""
    triangles, axes, apertures = parallel(rng, n)
    normals = _normals(triangles)
    normals *= np.sign(np.sum(normals * triangles[:, 0], axis=1))[:, None]
    angle = 10.0 ** rng.uniform(-9.0, -0.5, size=n)
    return triangles, _towards(np.cos(angle)[:, None] * axes - np.sin(angle)[:, None] * normals), apertures


def narrow(rng, n):
    triangles, _, _ = _generic(rng, n)
    apertures = 10.0 ** rng.uniform(-10.0, -1.5, size=n)
    return triangles, _towards(_inner(rng, triangles, 0.05)), apertures


def needle_at_edge(rng, n):
    """Needles whose axis passes an edge at a few half angles."""
    triangles, _, _ = _generic(rng, n)
    apertures = 10.0 ** rng.uniform(-9.0, -2.0, size=n)
    t = rng.uniform(0.1, 0.9, size=(n, 1))
    target = _towards(triangles[:, 0] + t * (triangles[:, 1] - triangles[:, 0]))
    return triangles, _tilted(rng, target, apertures * rng.uniform(0.0, 1.5, size=n)), apertures


def wide(rng, n):
    triangles, axes, _ = _generic(rng, n)
    apertures = math.pi - 10.0 ** rng.uniform(-9.0, -1.0, size=n) * rng.integers(0, 2, size=n)
    return triangles, axes, apertures


def wide_edge_plane(rng, n):
    """Near a half space, the plane of apex and edge nearly orthogonal to the axis (the search errs by 1e-16 / gap)."""
    triangles, _, _ = _generic(rng, n)
    gap = 10.0 ** rng.uniform(-4.0, -1.0, size=n)
    normals = _towards(np.cross(triangles[:, 0], triangles[:, 1]))
    return triangles, _tilted(rng, normals, gap * rng.uniform(0.0, 3.0, size=n)), math.pi - 2.0 * gap


def apex(rng, n):
    """The apex on the triangle, to rounding."""
    triangles, axes, apertures = _generic(rng, n)
    return triangles - _inner(rng, triangles)[:, None], axes, apertures


def near_apex(rng, n):
    """The apex off the triangle by 1e-13 to 1e-3 of its size."""
    triangles, axes, apertures = apex(rng, n)
    lift = 10.0 ** rng.uniform(-13.0, -3.0, size=n) * rng.choice([-1.0, 1.0], size=n)
    return triangles + (lift[:, None] * _normals(triangles))[:, None], axes, apertures


def sliver(rng, n):
    triangles, axes, apertures = _generic(rng, n)
    t = rng.uniform(0.0, 1.0, size=(n, 1))
    width = 10.0 ** rng.uniform(-15.0, -1.5, size=(n, 1))
    triangles[:, 2] = triangles[:, 0] + t * (triangles[:, 1] - triangles[:, 0]) + width * triangles[:, 2]
    aimed = _tilted(rng, _towards(_inner(rng, triangles)), 0.6 * apertures * rng.uniform(size=n))
    return triangles, np.where(rng.uniform(size=(n, 1)) < 0.5, axes, aimed), apertures


def spike(rng, n):
    """Slivers with one very short edge."""
    triangles, axes, apertures = _generic(rng, n)
    width = 10.0 ** rng.uniform(-15.0, -1.5, size=(n, 1))
    triangles[:, 2] = triangles[:, 1] + width * triangles[:, 2]
    aimed = _tilted(rng, _towards(_inner(rng, triangles)), 0.6 * apertures * rng.uniform(size=n))
    return triangles, np.where(rng.uniform(size=(n, 1)) < 0.5, axes, aimed), apertures


def sliver_conic(rng, n):
    """Slivers of every width that hold the border point of their plane."""
    triangles, _, apertures = _generic(rng, n)
    normals = _normals(triangles)
    normals *= np.sign(np.sum(normals * triangles[:, 0], axis=1))[:, None]
    t = rng.uniform(0.2, 0.8, size=(n, 1))
    width = 10.0 ** rng.uniform(-12.0, -1.0, size=(n, 1))
    triangles[:, 2] += (1.0 - width) * (triangles[:, 0] + t * (triangles[:, 1] - triangles[:, 0]) - triangles[:, 2])
    border = _towards(_inner(rng, triangles, 0.3))
    away = border - np.sum(border * normals, axis=1)[:, None] * normals
    away = _towards(away - np.sum(away * border, axis=1)[:, None] * border)
    half = 0.5 * apertures[:, None]
    return triangles, _towards(np.cos(half) * border + np.sin(half) * away), apertures


def tangent_edge(rng, n):
    """Only one edge reaches into the cone, by 1e-7 to 1e-2 of it: the answer is known to 1e-16 / sqrt(that)."""
    triangles, _, apertures = _generic(rng, n)
    a, b = triangles[:, 0], triangles[:, 1]
    m = _towards(np.cross(a, b))
    t = rng.uniform(0.1, 0.9, size=(n, 1))
    along = _towards(a + t * (b - a))
    h = 0.5 * apertures
    sine = np.sin(h) * (1.0 - 10.0 ** rng.uniform(-7.0, -2.0, size=n))
    axes = np.sqrt(1.0 - sine * sine)[:, None] * along + sine[:, None] * m
    triangles[:, 2] -= 2.0 * np.maximum(np.sum(triangles[:, 2] * m, axis=1), 0.0)[:, None] * m
    return triangles, _towards(axes), apertures


def degenerate(rng, n):
    triangles, axes, apertures = _generic(rng, n)
    kind = rng.integers(0, 4, size=n)
    triangles[kind == 0, 1] = triangles[kind == 0, 2]
    triangles[kind == 1, 1] = triangles[kind == 1, 0]
    triangles[kind == 2] = triangles[kind == 2, :1]
    triangles[kind == 3, 2] = 0.5 * (triangles[kind == 3, 0] + triangles[kind == 3, 1])
    return triangles, axes, apertures


def foot_border(rng, n):
    """The foot of the perpendicular exactly on the border, inside the triangle or not."""
    triangles, _, apertures = _generic(rng, n)
    normals = _normals(triangles)
    normals *= np.sign(np.sum(normals * triangles[:, 0], axis=1))[:, None]
    foot = np.sum(normals * triangles[:, 0], axis=1)[:, None] * normals
    moved = triangles + (foot - _inner(rng, triangles))[:, None]
    triangles = np.where(rng.uniform(size=(n, 1, 1)) < 0.5, moved, triangles)
    return triangles, _tilted(rng, normals, 0.5 * apertures), apertures


def corner_border(rng, n):
    """A corner exactly on the border."""
    triangles, _, apertures = _generic(rng, n)
    return triangles, _tilted(rng, _towards(triangles[:, 0]), 0.5 * apertures), apertures


def edge_foot_border(rng, n):
    """The foot on an edge exactly on the border."""
    triangles, _, apertures = _generic(rng, n)
    a, b = triangles[:, 0], triangles[:, 1]
    e = b - a
    foot = a - (np.sum(a * e, axis=1) / np.sum(e * e, axis=1))[:, None] * e
    return triangles, _tilted(rng, _towards(foot), 0.5 * apertures), apertures


def coplanar_apex(rng, n):
    triangles, axes, apertures = _generic(rng, n)
    weights = rng.normal(size=(n, 3))
    weights[:, 2] = 1.0 - weights[:, 0] - weights[:, 1]
    origin = np.sum(weights[:, :, None] * triangles, axis=1)
    return triangles - origin[:, None], axes, apertures


def radial_edge(rng, n):
    triangles, axes, apertures = _generic(rng, n)
    triangles[:, 1] = triangles[:, 0] * np.exp(rng.uniform(-1.5, 1.5, size=(n, 1)))
    aimed = _tilted(rng, _towards(triangles[:, 0]), apertures * rng.uniform(size=n))
    return triangles, np.where(rng.uniform(size=(n, 1)) < 0.5, axes, aimed), apertures


def big(rng, n):
    triangles, axes, apertures = _generic(rng, n)
    return triangles * 10.0 ** rng.uniform(-6.0, 6.0, size=(n, 1, 1)), axes, apertures


def far_and_small(rng, n):
    """Triangles of a fine mesh, far away, about the border."""
    triangles, _, apertures = _generic(rng, n)
    size = 10.0 ** rng.uniform(-6.0, -1.0, size=n)
    triangles *= (size / np.max(np.linalg.norm(triangles, axis=2), axis=1))[:, None, None]
    axes = _unit(rng, n)
    return triangles + _tilted(rng, axes, 0.5 * apertures + 0.5 * rng.normal(size=n) * size)[:, None], axes, apertures


def reflex(rng, n):
    """Apertures above 180 deg: the sensed volume is not convex."""
    triangles, axes, _ = _generic(rng, n)
    apertures = rng.uniform(math.pi, 2.0 * math.pi, size=n)
    behind = -_tilted(rng, _towards(_inner(rng, triangles)), 0.7 * (math.pi - 0.5 * apertures))
    return triangles, np.where(rng.uniform(size=(n, 1)) < 0.3, axes, behind), apertures


FAMILIES = {
    function.__name__: function
    for function in (
        random,
        parallel,
        behind_s,
        narrow,
        needle_at_edge,
        wide,
        wide_edge_plane,
        apex,
        near_apex,
        sliver,
        spike,
        sliver_conic,
        tangent_edge,
        degenerate,
        foot_border,
        corner_border,
        edge_foot_border,
        coplanar_apex,
        radial_edge,
        big,
        far_and_small,
        reflex,
    )
}
