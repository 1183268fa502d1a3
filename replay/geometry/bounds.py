"""Bounding volumes of points: sphere, axis-aligned box, oriented box. Each contains its points after rounding."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from replay.errors import InvalidValue
from replay.geometry.hull import convex_hull, to_unit_box
from replay.geometry.obb_fit import box_axes
from replay.geometry.overlap import aabbs_meet, obbs_meet, spheres_meet
from replay.geometry.principal_axes import covariance_of_points, covariance_of_triangles
from replay.geometry.smallest_ball import smallest_ball_centre
from replay.numerics.arguments import as_floats
from replay.numerics.arrays import Floats
from replay.numerics.constants import EPSILON
from replay.numerics.extents import extents
from replay.numerics.kept import kept
from replay.numerics.rows import distinct_rows

__all__ = [
    "Aabb",
    "Obb",
    "Sphere",
    "aabbs_meet",
    "fit_aabb",
    "fit_obb",
    "fit_sphere",
    "obbs_meet",
    "principal_obb",
    "spheres_meet",
]


_ULPS = 8.0
"""Volumes are this many roundings of their extent larger than the points' computed distances ask for.

A difference and a dot product of three terms are off by at most 2 eps of the extent; once here, once for who checks.
"""

_FLAT = 1e-14
"""Boxes thinner than this, as a share of their extent, are compared as if they were as thick."""

_LARGEST = 1e300


@dataclass(frozen=True, eq=False)
class Sphere:
    """The points within `radius` [m] of `center` (3,) [m]."""

    center: Floats
    radius: float


@dataclass(frozen=True, eq=False)
class Aabb:
    """The points x with |x - center| <= half_widths on each axis; both (3,) [m]."""

    center: Floats
    half_widths: Floats


@dataclass(frozen=True, eq=False)
class Obb:
    """The points x with |axes[i] . (x - center)| <= half_widths[i].

    Attributes:
        center: (3,) [m].
        half_widths: (3,) [m], largest first.
        axes: (3, 3), rows are unit axes, right-handed.
    """

    center: Floats
    half_widths: Floats
    axes: Floats


def fit_sphere(points: Floats) -> Sphere:
    """Return the smallest sphere around points (n, 3) [m], n >= 1.

    Raises:
        InvalidValue: wrong shape, no points, values that are not finite or beyond 1e300.

    Accuracy: radius within 1e-14 relative of the smallest (test_smallest_sphere); a sphere around points far from the
    origin is larger by the rounding of its centre.
    """
    points = _checked("points", points)
    local, origin, scale = to_unit_box(points)
    center = origin + scale * smallest_ball_centre(local)
    x, y, z = ((points - center) / scale).T
    reach = float(np.sqrt(np.max(x * x + y * y + z * z)))
    return Sphere(center, scale * reach * (1.0 + _ULPS * EPSILON))


def fit_aabb(points: Floats) -> Aabb:
    """Return the smallest axis-aligned box around points (n, 3) [m], n >= 1; errors as `fit_sphere`."""
    points = _checked("points", points)
    lower, upper = extents(points)
    center = 0.5 * lower + 0.5 * upper
    half_widths = np.maximum(upper - center, center - lower)
    return Aabb(center, half_widths * (1.0 + _ULPS * EPSILON))


@kept
def principal_obb(
    points: Floats,
    *,
    triangles: NDArray[np.generic] | None = None,
    method: Literal["triangles", "vertices"] = "triangles",
) -> Obb:
    """Return the box around points along the principal axes of their covariance, which the level "bounds" means.

    Where eigenvalues nearly repeat (cube, cylinder, sphere) and the axes are not determined by the covariance, they are
    those of the smallest box found; see `obb_fit`. Of 2000 random sets it is larger than the box along the coordinate
    axes for 201, up to 1.65 times; see `fit_obb`, whose arguments and errors it has.
    """
    if method not in ("triangles", "vertices"):
        raise InvalidValue("method", method, "must be triangles or vertices")
    points = _checked("points", points)
    surface = None if triangles is None else _corners(points, triangles)
    local, origin, scale = to_unit_box(points)
    if len(local) > 3 and method == "triangles":
        local = distinct_rows(local).rows
    hull = cache(lambda: convex_hull(local) if len(local) > 3 else None)  # most boxes need none
    faces = None
    if method == "triangles":
        if surface is not None:  # in its own unit box: the axes do not depend on the scale
            faces = to_unit_box(surface.reshape(-1, 3))[0].reshape(-1, 3, 3)
        elif (around := hull()) is not None:
            faces = np.ascontiguousarray(local[around.faces])
    area, covariance = (0.0, np.zeros((3, 3))) if faces is None else covariance_of_triangles(faces)
    if not area > 0.0:
        covariance = covariance_of_points(local)
    return _tight(points, local, origin, scale, box_axes(local, hull, covariance))


def fit_obb(
    points: Floats,
    *,
    triangles: NDArray[np.generic] | None = None,
    method: Literal["triangles", "vertices"] = "triangles",
) -> Obb:
    """Return an oriented box around points: `principal_obb`, or the box along the coordinate axes where it is smaller.

    Args:
        points: (n, 3) [m], n >= 1.
        triangles: the surface that weights the covariance, as indices (t, 3) into points or as coordinates (t, 3, 3)
            [m]; without it, that of the points' convex hull.
        method: "triangles": covariance of the surface; "vertices": covariance of the points, wherever they are dense.

    Raises:
        InvalidValue: as `fit_sphere`; indices out of range; another method.

    Accuracy: half widths exceed those the axes ask for by 1e-14 of the extent at most; the box is never larger than
        that of `fit_aabb`, beyond rounding (test_obb_is_never_larger); the volume of boxes around cube, cylinder,
        sphere, octahedron and tetrahedron is within 1 % of the smallest known (test_obb).
    """
    box = principal_obb(points, triangles=triangles, method=method)
    local, origin, scale = to_unit_box(_checked("points", points))
    if _volume(local, np.eye(3)) < _volume(local, box.axes) * (1.0 - _ULPS * EPSILON):
        return _tight(_checked("points", points), local, origin, scale, np.eye(3))
    return box


def _volume(local: Floats, axes: Floats) -> float:
    """Return the volume of the box along axes around points of extent 1; flat boxes are compared by their area."""
    reach = _along(local[:, None], axes.T)
    return float(np.prod(np.maximum(reach.max(axis=0) - reach.min(axis=0), _FLAT)))


def _tight(points: Floats, local: Floats, origin: Floats, scale: float, axes: Floats) -> Obb:
    """Return the box around the points along axes, sorted and signed in one way, containing them after rounding."""
    reach = _along(local[:, None], axes.T)
    order = np.argsort(reach.min(axis=0) - reach.max(axis=0), kind="stable")
    first, second = (_signed(axes[k]) for k in order[:2])
    second = second - float(_along(second, first)) * first
    second = second / np.sqrt(_along(second, second))
    x, y = first, second
    third = np.array([x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]])
    axes = np.stack([first, second, third / np.sqrt(_along(third, third))])
    reach = _along(local[:, None], axes.T)
    middle = np.zeros(3)
    for axis, low, high in zip(axes, reach.min(axis=0), reach.max(axis=0), strict=True):
        middle += (0.5 * low + 0.5 * high) * axis
    center = origin + scale * middle
    relative = (points - center) / scale
    slack = _ULPS * EPSILON * 2.0 * float(np.max(np.abs(relative)))
    half_widths = np.abs(_along(relative[:, None], axes.T)).max(axis=0) + slack
    return Obb(center, scale * half_widths, axes)


def _along(points: Floats, axis: Floats) -> Floats:
    """Return points . axis, the same on every machine; for several axes side by side their columns (3, k)."""
    return np.asarray(points[..., 0] * axis[0] + points[..., 1] * axis[1] + points[..., 2] * axis[2])


def _signed(axis: Floats) -> Floats:
    """Return a unit axis or its opposite: the one whose largest component is positive."""
    axis = axis / np.sqrt(_along(axis, axis))
    return np.asarray(axis if axis[np.argmax(np.abs(axis))] > 0.0 else -axis)


def _checked(name: str, points: Floats) -> Floats:
    points = as_floats(name, points, (None, 3))
    if len(points) == 0:
        raise InvalidValue(name, "no points", "must have shape (n, 3) with n >= 1")
    if not np.max(np.abs(points)) <= _LARGEST:
        raise InvalidValue(name, "coordinates", f"must be finite and at most {_LARGEST} m")
    return points


def _corners(points: Floats, triangles: NDArray[np.generic]) -> Floats:
    try:
        triangles = np.asarray(triangles)
    except ValueError:
        raise InvalidValue("triangles", triangles, "must be an array of shape (t, 3) or (t, 3, 3)") from None
    if triangles.ndim == 3 and triangles.shape[1:] == (3, 3):
        return _checked("triangles", as_floats("triangles", triangles, (None, 3, 3)).reshape(-1, 3)).reshape(-1, 3, 3)
    if triangles.ndim != 2 or triangles.shape[1] != 3 or len(triangles) == 0:
        raise InvalidValue("triangles", triangles.shape, "must have shape (t, 3) (indices) or (t, 3, 3) (coordinates)")
    if not np.issubdtype(triangles.dtype, np.integer):
        raise InvalidValue("triangles", triangles.dtype, "indices (t, 3) must be integers")
    indices = triangles.astype(np.int64)
    if indices.min() < 0 or indices.max() >= len(points):
        raise InvalidValue("triangles", int(indices.max()), f"indices must be in 0..{len(points) - 1}")
    return points[indices]
