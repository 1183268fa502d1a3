"""The primitive shapes as solids. Curved ones are tessellated with every corner on the true surface.

A chord over the angle 2 a of a circle of radius r leaves the circle by its sagitta r (1 - cos a) = 2 r sin^2(a / 2) at
most, which fixes the number of segments: the tessellation is never further from the true surface than `chord_error`.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

import numpy as np

from replay.errors import InvalidValue
from replay.geometry.solid import Solid
from replay.numerics.arrays import Floats, Integers
from replay.numerics.constants import FULL_TURN
from replay.numerics.kept import kept
from replay.numerics.rows import distinct_rows

FEWEST_SEGMENTS = 8
"""Segments of a full circle, however coarse the chord error asked for."""

_MOST_TRIANGLES = 2_000_000


def cuboid(size: Sequence[float]) -> Solid:
    """Return a box of edge lengths size (3,) [m] along x, y, z, centred on the origin.

    Raises:
        InvalidValue: a length that is not finite and positive (of every function here).
    """
    x, y, z = (0.5 * _positive(f"size[{k}]", value) for k, value in enumerate(_numbers("size", size, 3)))
    corners = np.array([[sx * x, sy * y, sz * z] for sz in (-1, 1) for sy in (-1, 1) for sx in (-1, 1)])
    # corner k has x by bit 0, y by bit 1, z by bit 2 of k
    quads = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    return Solid(_quads(corners[np.array(quads)]), pieces=(corners,), strictly_convex=True)


def cube(edge: float) -> Solid:
    """Return a cube of the given edge [m], centred on the origin."""
    _positive("edge", edge)
    return cuboid((edge, edge, edge))


def plane(size: Sequence[float]) -> Solid:
    """Return a rectangle of edge lengths size (2,) [m] in the xy plane, centred, normal +z, without volume."""
    x, y = (0.5 * _positive(f"size[{k}]", value) for k, value in enumerate(_numbers("size", size, 2)))
    corners = np.array([[-x, -y, 0.0], [x, -y, 0.0], [x, y, 0.0], [-x, y, 0.0]])
    return Solid(_quads(corners[None]), pieces=(corners,), strictly_convex=True, watertight=False)


@kept
def sphere(radius: float, chord_error: float) -> Solid:
    """Return a sphere [m] about the origin as an icosahedron whose faces are split and pushed out to the sphere.

    The fewest splits are taken that keep every triangle's plane within chord_error [m] of the sphere.
    """
    _positive("radius", radius)
    _positive("chord_error", chord_error)
    relative = min(chord_error / radius, 1.0)
    splits = max(1, int(0.5 * math.sqrt(1.0 / relative)))  # needed: 0.54 / sqrt(relative) when many
    _check_count("chord_error", chord_error, 20 * splits * splits)
    while _deepest(_sphere_face(_ICOSAHEDRON[0], splits)) > relative:
        splits += 1
    _check_count("chord_error", chord_error, 20 * splits * splits)
    triangles = radius * _unit_sphere(splits)
    error = radius * _deepest(_sphere_face(_ICOSAHEDRON[0], splits))
    return Solid(triangles, pieces=(_distinct(triangles),), chord_error=error)


@kept
def cylinder(radius: float, height: float, chord_error: float) -> Solid:
    """Return a cylinder [m] along z, centred on the origin."""
    _positive("height", height)
    rim, error = _circle(radius, chord_error)
    bottom = np.column_stack([rim, np.full(len(rim), -0.5 * height)])
    top = np.column_stack([rim, np.full(len(rim), 0.5 * height)])
    next_bottom, next_top = np.roll(bottom, -1, axis=0), np.roll(top, -1, axis=0)
    sides = _quads(np.stack([bottom, next_bottom, next_top, top], axis=1))
    low, high = np.zeros((len(rim), 3)), np.zeros((len(rim), 3))
    low[:, 2], high[:, 2] = -0.5 * height, 0.5 * height
    caps = [np.stack([low, next_bottom, bottom], axis=1), np.stack([high, top, next_top], axis=1)]
    return Solid(np.concatenate([sides, *caps]), pieces=(np.concatenate([bottom, top]),), chord_error=error)


@kept
def cone(radius: float, height: float, chord_error: float) -> Solid:
    """Return a cone [m] along z, base at z = -height / 2, apex at z = +height / 2."""
    _positive("height", height)
    rim, error = _circle(radius, chord_error)
    base = np.column_stack([rim, np.full(len(rim), -0.5 * height)])
    following = np.roll(base, -1, axis=0)
    apex, centre = np.zeros((len(rim), 3)), np.zeros((len(rim), 3))
    apex[:, 2], centre[:, 2] = 0.5 * height, -0.5 * height
    triangles = np.concatenate([np.stack([base, following, apex], axis=1), np.stack([centre, following, base], axis=1)])
    return Solid(triangles, pieces=(np.concatenate([base, apex[:1]]),), chord_error=error)


@kept
def capsule(radius: float, height: float, chord_error: float) -> Solid:
    """Return a cylinder [m] along z between two half spheres, centred on the origin; height is the cylinder's part.

    The half spheres have rings of corners, of which the fewest are taken that keep every facet's plane within
    chord_error [m] of the sphere. Rings are parallel, so that what lies between two of them is plane facets, and what
    all triangles enclose is the hull of their corners.
    """
    _positive("radius", radius)
    _positive("height", height)
    count = _segments(radius, FULL_TURN, chord_error)
    _check_count("chord_error", chord_error, 2.0 * count * count)  # a facet is twice as deep as a chord
    while radius * _deepest(cap := _half_sphere(count)) > chord_error:
        count += 1
    top = radius * cap
    bottom = top[:, ::-1] * (1.0, 1.0, -1.0)
    rim, _ = _polygon(radius, count)
    low, high = (np.column_stack([rim, np.full(count, z)]) for z in (-0.5 * height, 0.5 * height))
    sides = _quads(np.stack([low, np.roll(low, -1, axis=0), np.roll(high, -1, axis=0), high], axis=1))
    raised = np.array([0.0, 0.0, 0.5 * height])
    triangles = np.concatenate([top + raised, sides, bottom - raised])
    return Solid(triangles, pieces=(_distinct(triangles),), chord_error=radius * _deepest(cap))


@kept
def ellipsoid(radii: Sequence[float], chord_error: float) -> Solid:
    """Return an ellipsoid of half axes radii (3,) [m] about the origin: a sphere's triangles, stretched.

    Stretching by S = diag(radii) takes a facet of unit normal n at distance 1 - d from the centre of the unit sphere to
    one whose plane is d / |S^-1 n| below the parallel plane that touches the ellipsoid. The fewest splits of a
    `sphere` are taken that keep this within chord_error [m] for every facet.
    """
    scale = np.array([_positive(f"radii[{k}]", value) for k, value in enumerate(_numbers("radii", radii, 3))])
    _positive("chord_error", chord_error)
    relative = min(chord_error / float(np.max(scale)), 1.0)
    splits = max(1, int(0.5 * math.sqrt(1.0 / relative)))
    _check_count("chord_error", chord_error, 20 * splits * splits)
    while (error := _deepest(unit := _unit_sphere(splits), scale)) > chord_error:
        splits += 1
    triangles = unit * scale
    return Solid(triangles, pieces=(_distinct(triangles),), chord_error=error)


@kept
def arc(radius: float, span: float, width: float, thickness: float, chord_error: float) -> Solid:
    """Return a curved bar in the xy plane, symmetric about +x: a C-arm's arc, or with span 2 pi a ring.

    Args:
        radius: of the mid-line [m]; the bar reaches from radius - thickness / 2 to radius + thickness / 2.
        span: angle covered [rad], in (0, 2 pi].
        width: along z [m].
        thickness: radial [m], below 2 radius.
        chord_error: [m], of the outer surface; the inner one is closer.

    The triangles are the outer surface; the pieces are wedges between neighbouring segment borders, whose union is
    exactly what the triangles enclose.
    """
    for name, value in (("radius", radius), ("span", span), ("width", width), ("thickness", thickness)):
        _positive(name, value)
    if thickness >= 2.0 * radius:
        raise InvalidValue("thickness", thickness, f"must be below twice the radius, {2.0 * radius} m")
    if span > FULL_TURN * (1.0 + 1e-12):
        raise InvalidValue("span", span, "must be at most 2 pi rad")
    full = span >= FULL_TURN * (1.0 - 1e-12)
    outer = radius + 0.5 * thickness
    inner = radius - 0.5 * thickness
    count = _segments(outer, span, chord_error)
    angles = [-0.5 * span + span * k / count for k in range(count if full else count + 1)]
    ray = np.array([[math.cos(angle), math.sin(angle)] for angle in angles])
    z = 0.5 * width
    # borders of the segments: (border, corner, xyz), corners inner low, outer low, outer high, inner high
    borders = np.stack(
        [
            np.column_stack([r * ray, np.full(len(ray), h)])
            for r, h in ((inner, -z), (outer, -z), (outer, z), (inner, z))
        ],
        axis=1,
    )
    begin = borders[:count]
    end = np.roll(borders, -1, axis=0)[:count]
    sides = [
        np.stack([begin[:, a], end[:, a], end[:, b], begin[:, b]], axis=1) for a, b in ((1, 2), (2, 3), (3, 0), (0, 1))
    ]
    if not full:
        sides += [borders[:1], borders[-1:, ::-1]]
    pieces = tuple(np.concatenate([begin[k], end[k]]) for k in range(count))
    return Solid(_quads(np.concatenate(sides)), pieces=pieces, chord_error=_sagitta(outer, 0.5 * span / count))


def _sagitta(radius: float, half_angle: float) -> float:
    return 2.0 * radius * math.sin(0.5 * half_angle) ** 2


def _segments(radius: float, span: float, chord_error: float) -> int:
    """Return the fewest equal segments of an arc whose sagitta is at most chord_error."""
    _positive("chord_error", chord_error)
    half_angle = 2.0 * math.asin(math.sqrt(min(0.5 * chord_error / radius, 0.5)))
    fewest = max(1, math.ceil(FEWEST_SEGMENTS * span / FULL_TURN - 1e-9))
    needed = 0.5 * span / half_angle
    _check_count("chord_error", chord_error, 8.0 * needed)
    count = max(fewest, math.ceil(needed))
    return count if _sagitta(radius, 0.5 * span / count) <= chord_error else count + 1


def _circle(radius: float, chord_error: float) -> tuple[Floats, float]:
    """Return the corners (n, 2) of the polygon, counter-clockwise, and its sagitta."""
    _positive("radius", radius)
    return _polygon(radius, _segments(radius, FULL_TURN, chord_error))


def _polygon(radius: float, count: int) -> tuple[Floats, float]:
    """Return the corners (count, 2) of a regular polygon, counter-clockwise, and its sagitta."""
    angles = [FULL_TURN * k / count for k in range(count)]
    rim = np.array([[radius * math.cos(angle), radius * math.sin(angle)] for angle in angles])
    return rim, _sagitta(radius, math.pi / count)


def _half_sphere(count: int) -> Floats:
    """Return the upper half (n, 3, 3) of the unit sphere: rings of `count` corners, a quarter as many from the pole."""
    rings = -(-count // 4)
    rim, _ = _polygon(1.0, count)
    angles = [0.25 * FULL_TURN * k / rings for k in range(1, rings)]  # from the pole
    heights = [*((math.sin(angle), math.cos(angle)) for angle in angles), (1.0, 0.0)]
    circles = [np.column_stack([wide * rim, np.full(count, high)]) for wide, high in heights]
    pole = np.zeros((count, 3))
    pole[:, 2] = 1.0
    fan = np.stack([pole, circles[0], np.roll(circles[0], -1, axis=0)], axis=1)
    bands = [
        _quads(np.stack([below, np.roll(below, -1, axis=0), np.roll(above, -1, axis=0), above], axis=1))
        for above, below in itertools.pairwise(circles)
    ]
    return np.concatenate([fan, *bands])


def _icosahedron() -> Floats:
    """Return the 20 faces (20, 3, 3) of the icosahedron with corners on the unit sphere, seen from outside."""
    golden = 0.5 * (1.0 + math.sqrt(5.0))
    corners = [(0.0, a, b * golden) for a in (-1.0, 1.0) for b in (-1.0, 1.0)]
    points = np.array([np.roll(corner, shift) for shift in range(3) for corner in corners])
    points /= math.sqrt(1.0 + golden * golden)
    faces = []
    for a in range(12):
        for b in range(a + 1, 12):
            for c in range(b + 1, 12):
                p, q, r = points[a], points[b], points[c]
                if max(np.sum((p - q) ** 2), np.sum((q - r) ** 2), np.sum((r - p) ** 2)) < 1.2:  # edge^2 is 1.106
                    outward = float(np.sum(np.cross(q - p, r - p) * p)) > 0.0
                    faces.append((p, q, r) if outward else (p, r, q))
    return np.array(faces)


_ICOSAHEDRON = _icosahedron()


def _sphere_face(face: Floats, splits: int) -> Floats:
    """Return one face of the icosahedron as splits^2 triangles (n, 3, 3) with corners on the unit sphere.

    A point is i A + j B + k C, i + j + k = splits, pushed out. On an edge one term is zero, so both faces round alike
    and the seams close exactly.
    """

    def corner(i: Integers, j: Integers) -> Floats:
        k = splits - i - j
        raw = i[:, None] * face[0] + j[:, None] * face[1] + k[:, None] * face[2]
        length: Floats = np.sqrt(raw[:, 0] ** 2 + raw[:, 1] ** 2 + raw[:, 2] ** 2)
        pushed: Floats = raw / length[:, None]
        return pushed

    i, j = (index.ravel() for index in np.meshgrid(np.arange(splits), np.arange(splits), indexing="ij"))
    up, down = i + j < splits, i + j < splits - 1
    upward = np.stack([corner(i[up] + 1, j[up]), corner(i[up], j[up] + 1), corner(i[up], j[up])], axis=1)
    i, j = i[down], j[down]
    downward = np.stack([corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)], axis=1)
    return np.concatenate([upward, downward])


def _unit_sphere(splits: int) -> Floats:
    return np.concatenate([_sphere_face(face, splits) for face in _ICOSAHEDRON])


def _deepest(triangles: Floats, scale: Floats | None = None) -> float:
    """Return the largest depth of triangles inscribed in the unit sphere below it, or once both are stretched."""
    a, b, c = np.moveaxis(triangles, 1, 0)
    normal = np.cross(b - a, c - a)
    depth = 1.0 - np.sum(normal * a, axis=1) / np.sqrt(np.sum(normal * normal, axis=1))
    if scale is not None:
        depth = depth * np.sqrt(np.sum(normal * normal, axis=1) / np.sum((normal / scale) ** 2, axis=1))
    return float(np.max(depth))


def _quads(corners: Floats) -> Floats:
    """Return quadrilaterals (n, 4, 3) as triangles (2 n, 3, 3)."""
    return np.ascontiguousarray(corners[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3, 3))


def _distinct(triangles: Floats) -> Floats:
    return distinct_rows(triangles.reshape(-1, 3) + 0.0).rows


def _numbers(name: str, values: Sequence[float], count: int) -> Sequence[float]:
    if len(values) != count:
        raise InvalidValue(name, list(values), f"must be {count} lengths [m]")
    return values


def _positive(name: str, value: float) -> float:
    if not 0.0 < value < math.inf:
        raise InvalidValue(name, value, "must be finite and positive")
    return value


def _check_count(name: str, value: float, triangles: float) -> None:
    if triangles > _MOST_TRIANGLES:
        raise InvalidValue(name, value, f"needs more than {_MOST_TRIANGLES} triangles; allow a larger error")
