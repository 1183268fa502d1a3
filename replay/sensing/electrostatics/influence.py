"""How much potential the charge of one panel makes on another: the mean of 1/r over both.

With R the distance of the centroids and D the larger diameter,

    R > 10 D        1/R,
    R > 2.5 D       the mean over 3 (triangle) or 4 (parallelogram) points of each,
    else            the mean, over Gauss points of the smaller panel, of the potential of the larger in closed form,

    int dA/r = sum_i P f_i - |d| sum_i [atan2(P s+, R0^2 + |d| R+) - atan2(P s-, R0^2 + |d| R-)]   (Wilton 1984),

of edge i, with f_i the integral of 1/r along it, as for the regions of the capacitive sensor's own model
(`numerics.inverse_distance`). The rule is symmetric, and so is each matrix.

Accuracy: 3e-3 of a panel's value on itself, 6e-3 of panels of one size that touch, 3e-5 of others (test_influence).
"""

from __future__ import annotations

import math

import numpy as np
from numba import float64

from replay.numerics.arrays import Floats
from replay.numerics.inverse_distance import mean_over_segment
from replay.numerics.jit import entry, kernel, leaf_kernel
from replay.numerics.triples import Triple, along, cross, dot, minus, norm
from replay.sensing.electrostatics.panels import PANELS_TYPE, Panels

FAR = 10.0
_MIDDLE = 2.5
_MUCH_SMALLER = 0.3
"""Share of the larger diameter below which the smaller panel needs few points."""

_G2 = 0.5 / math.sqrt(3.0)
_G3 = 0.5 * math.sqrt(0.6)


def _product(nodes: list[float], weights: list[float]) -> Floats:
    return np.array(
        [(a, b, p * q) for a, p in zip(nodes, weights, strict=True) for b, q in zip(nodes, weights, strict=True)]
    )


def _seven() -> Floats:
    """Return the seven-point rule of degree 5 (Radon 1948)."""
    root = math.sqrt(15.0)
    rows = [(1.0 / 3.0, 1.0 / 3.0, 9.0 / 40.0)]
    for sign in (1.0, -1.0):
        a, weight = (6.0 + sign * root) / 21.0, (155.0 + sign * root) / 1200.0
        rows += [(a, a, weight), (1.0 - 2.0 * a, a, weight), (a, 1.0 - 2.0 * a, weight)]
    return np.array(rows)


_TRIANGLE_3 = np.array([(1 / 6, 1 / 6, 1 / 3), (2 / 3, 1 / 6, 1 / 3), (1 / 6, 2 / 3, 1 / 3)])
_TRIANGLE_7 = _seven()
_FOUR_4 = _product([0.5 - _G2, 0.5 + _G2], [0.5, 0.5])
_FOUR_9 = _product([0.5 - _G3, 0.5, 0.5 + _G3], [5 / 18, 8 / 18, 5 / 18])
"""Rules on a panel: rows (a, b, weight) at origin + a u + b v."""


@leaf_kernel
def _edge(p: Triple, q: Triple, n: Triple, height: float) -> float:
    """Return what the edge from p to q adds to the closed form; n is the unit normal, `height` that of the origin."""
    edge = minus(q, p)
    length = norm(edge)
    t = (edge[0] / length, edge[1] / length, edge[2] / length)
    P = dot(p, cross(t, n))
    if abs(P) < 1e-12 * length:
        return 0.0
    total = P * length * mean_over_segment(p, q)
    d = abs(height)
    if d > 0.0:
        squared = P * P + d * d
        total -= d * math.atan2(P * dot(q, t), squared + d * norm(q))
        total += d * math.atan2(P * dot(p, t), squared + d * norm(p))
    return total


@leaf_kernel
def potential_at(point: Triple, panels: Panels, j: int) -> float:
    """Return the mean of 1/r [1/m] from a point over panel j."""
    origin, u, v = panels.origin, panels.u, panels.v
    side, other = (u[j, 0], u[j, 1], u[j, 2]), (v[j, 0], v[j, 1], v[j, 2])
    a = (origin[j, 0] - point[0], origin[j, 1] - point[1], origin[j, 2] - point[2])
    n = cross(side, other)
    size = norm(n)
    n = (n[0] / size, n[1] / size, n[2] / size)
    height = dot(a, n)
    b, d = along(a, 1.0, side), along(a, 1.0, other)
    total = _edge(a, b, n, height) + _edge(d, a, n, height)
    if panels.four[j]:
        c = along(b, 1.0, other)
        total += _edge(b, c, n, height) + _edge(c, d, n, height)
    else:
        total += _edge(b, d, n, height)
    return total / panels.area[j]  # type: ignore[no-any-return]


@leaf_kernel
def point_on(panels: Panels, i: int, a: float, b: float) -> Triple:
    """Return the point origin + a u + b v of panel i."""
    origin, u, v = panels.origin, panels.u, panels.v
    return (
        origin[i, 0] + a * u[i, 0] + b * v[i, 0],
        origin[i, 1] + a * u[i, 1] + b * v[i, 1],
        origin[i, 2] + a * u[i, 2] + b * v[i, 2],
    )


@leaf_kernel
def _near(small: Panels, i: int, large: Panels, j: int) -> float:
    few = small.diameter[i] < _MUCH_SMALLER * large.diameter[j]
    count = (4 if few else 9) if small.four[i] else (3 if few else 7)
    total = 0.0
    for k in range(count):
        if small.four[i]:
            a, b, weight = (
                (_FOUR_4[k, 0], _FOUR_4[k, 1], _FOUR_4[k, 2]) if few else (_FOUR_9[k, 0], _FOUR_9[k, 1], _FOUR_9[k, 2])
            )
        else:
            a, b, weight = (
                (_TRIANGLE_3[k, 0], _TRIANGLE_3[k, 1], _TRIANGLE_3[k, 2])
                if few
                else (_TRIANGLE_7[k, 0], _TRIANGLE_7[k, 1], _TRIANGLE_7[k, 2])
            )
        total += weight * potential_at(point_on(small, i, a, b), large, j)
    return total


@leaf_kernel
def _middle(first: Panels, i: int, second: Panels, j: int) -> float:
    m, n = 4 if first.four[i] else 3, 4 if second.four[j] else 3
    total = 0.0
    for k in range(m):
        a, b = (_FOUR_4[k, 0], _FOUR_4[k, 1]) if m == 4 else (_TRIANGLE_3[k, 0], _TRIANGLE_3[k, 1])
        x, y, z = point_on(first, i, a, b)
        for l in range(n):
            a, b = (_FOUR_4[l, 0], _FOUR_4[l, 1]) if n == 4 else (_TRIANGLE_3[l, 0], _TRIANGLE_3[l, 1])
            X, Y, Z = point_on(second, j, a, b)
            total += 1.0 / math.sqrt((x - X) * (x - X) + (y - Y) * (y - Y) + (z - Z) * (z - Z))
    return total / (m * n)


@leaf_kernel
def pair_mean(first: Panels, i: int, second: Panels, j: int) -> float:
    """Return the mean of 1/r [1/m] over panel i of `first` and j of `second`."""
    x = first.centroid[i, 0] - second.centroid[j, 0]
    y = first.centroid[i, 1] - second.centroid[j, 1]
    z = first.centroid[i, 2] - second.centroid[j, 2]
    squared = x * x + y * y + z * z
    D = max(first.diameter[i], second.diameter[j])
    if squared > FAR * FAR * D * D:
        return 1.0 / math.sqrt(squared)
    if squared > _MIDDLE * _MIDDLE * D * D:
        return _middle(first, i, second, j)
    if first.diameter[i] <= second.diameter[j]:
        return _near(first, i, second, j)
    return _near(second, j, first, i)


@entry(PANELS_TYPE, float64[:, ::1])
@kernel
def fill_influences(panels: Panels, into: Floats) -> None:
    """Write the influences (n, n) [1/m] of n panels on each other: the upper triangle, diagonal included."""
    n = len(panels.area)
    for i in range(n):
        for j in range(i, n):
            into[i, j] = pair_mean(panels, i, panels, j)


@entry(PANELS_TYPE, PANELS_TYPE, float64[:, ::1])
@kernel
def mean_potentials(panels: Panels, sources: Panels, charges: Floats) -> Floats:
    """Return the mean potentials (k, n) [charge/m] on panels of source panels with charges (k, m)."""
    k, n = len(charges), len(panels.area)
    result = np.zeros((k, n))
    for i in range(n):
        for j in range(len(sources.area)):
            value = pair_mean(panels, i, sources, j)
            for c in range(k):
                result[c, i] += charges[c, j] * value
    return result


@leaf_kernel
def over_points(x: float, y: float, z: float, sources: Panels, j: int) -> float:
    """Return the mean of 1/r from a point over the points that stand for panel j."""
    n = 4 if sources.four[j] else 3
    total = 0.0
    for k in range(n):
        a, b = (_FOUR_4[k, 0], _FOUR_4[k, 1]) if n == 4 else (_TRIANGLE_3[k, 0], _TRIANGLE_3[k, 1])
        X, Y, Z = point_on(sources, j, a, b)
        total += 1.0 / math.sqrt((x - X) * (x - X) + (y - Y) * (y - Y) + (z - Z) * (z - Z))
    return total / n


@entry(float64[:, ::1], PANELS_TYPE, float64[:, ::1])
@kernel
def point_potentials(points: Floats, sources: Panels, charges: Floats) -> Floats:
    """Return the potentials (k, n) [charge/m] at points (n, 3) [m] of source panels with charges (k, m)."""
    k, n = len(charges), len(points)
    result = np.zeros((k, n))
    centroid, diameter = sources.centroid, sources.diameter
    for i in range(n):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        for j in range(len(sources.area)):
            X, Y, Z = centroid[j, 0] - x, centroid[j, 1] - y, centroid[j, 2] - z
            squared = X * X + Y * Y + Z * Z
            if squared > FAR * FAR * diameter[j] * diameter[j]:
                value = 1.0 / math.sqrt(squared)
            else:
                value = potential_at((x, y, z), sources, j)
            for c in range(k):
                result[c, i] += charges[c, j] * value
    return result
