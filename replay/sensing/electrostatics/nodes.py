"""A surface as a binary tree: clusters of panels above, halves of panels below, as deep as anybody asks.

Above the panels of the surface, each node is split across the direction in which its panels' centroids, and their
normals times 6 cm, spread most, so that clusters are compact and flat. A panel is split in halves when that is asked
for. The charge of a node is uniform over all its panels.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import boolean, float64, int64

from replay.numerics.arrays import Flags, Floats, Integers
from replay.numerics.jit import entry, kernel, leaf_kernel, record
from replay.numerics.triples import Triple, along, cross, dot, minus, norm
from replay.sensing.electrostatics.influence import pair_mean, point_on
from replay.sensing.electrostatics.panels import PANELS_TYPE, Panels

_NORMAL = 0.06
Rule = tuple[float, float, float]

WITHIN, ACROSS = (1.0, 2.0, 6.0), (0.85, 1.8, 5.0)
"""Distances, in diameters, up to which panels have the closed form, up to which they are cut in four and clusters are
taken apart, and beyond which one point of each stands for it, between them four: for nodes of one conductor, and of
others."""

_SIDE = [0.5 * (k + 0.5 + sign / math.sqrt(12.0)) for k in (0, 1) for sign in (-1.0, 1.0)]
_QUARTERS_FOUR = np.array([(s, t) for s in _SIDE for t in _SIDE])
_THIRD = np.array([(1 / 6, 1 / 6), (2 / 3, 1 / 6), (1 / 6, 2 / 3)])
_QUARTERS_TRIANGLE = np.concatenate(
    [0.5 * _THIRD, 0.5 * _THIRD + [0.5, 0.0], 0.5 * _THIRD + [0.0, 0.5], 0.5 - 0.5 * _THIRD]
)
"""Points (s, t) at origin + s u + t v, of one weight."""

_ROOM = 30_000
"""Halves that there is room for besides the panels of a surface."""


class Nodes(NamedTuple):
    """Nodes of a tree; those of a surface come first, halves after them as they are made."""

    panels: Panels  # what a node is, of a cluster only centroid, diameter and area
    alone: Flags  # (n,) whether it is a panel
    child: Integers  # (n,) the first of two children, which are neighbours; -1: none yet, or none
    points: Floats  # (n, 4, 3) [m] that stand for it
    weights: Floats  # (n, 4), their sum is 1
    shape: Integers  # (n,) of the body
    made: Integers  # (1,) of the nodes that there are


NODES_TYPE = record(
    Nodes,
    PANELS_TYPE,
    boolean[::1],
    int64[::1],
    float64[:, :, ::1],
    float64[:, ::1],
    int64[::1],
    int64[::1],
)


def make_nodes(surfaces: list[Panels]) -> Nodes:
    """Return the trees over the panels of each shape; the roots are the first nodes."""
    panels = Panels(*(np.concatenate(arrays) for arrays in zip(*surfaces, strict=True)))
    total = len(panels.area)
    shape_of = np.repeat(np.arange(len(surfaces)), [len(each.area) for each in surfaces])
    spots = np.concatenate([panels.centroid, _NORMAL * _normals(panels)], axis=1)
    nodes = _empty(2 * total - len(surfaces))
    members: list[Integers] = [np.flatnonzero(shape_of == s) for s in range(len(surfaces))]
    at = 0
    while at < len(members):
        own = members[at]
        if len(own) > 1:
            nodes.child[at] = len(members)
            members += _halves(spots[own], panels.area[own], own)
        at += 1
    for k, own in enumerate(members):
        nodes.shape[k] = shape_of[own[0]]
        _fill(nodes, k, panels, own)
    nodes.made[0] = len(members)
    return nodes


def _empty(size: int) -> Nodes:
    """Return nodes of which there are none yet."""
    origin, u, v, centroid = (np.zeros((size, 3)) for _ in range(4))
    panels = Panels(origin, u, v, np.zeros(size, np.bool_), centroid, np.zeros(size), np.zeros(size))
    points, weights = np.zeros((size, 4, 3)), np.zeros((size, 4))
    counts = np.zeros(size, np.int64), np.zeros(1, np.int64)
    return Nodes(panels, np.zeros(size, np.bool_), np.full(size, -1), points, weights, *counts)


def with_room(nodes: Nodes) -> Nodes:
    """Return a copy that halves can be added to."""
    n = int(nodes.made[0])
    result = _empty(n + _ROOM)
    for into, values in zip((*result.panels, *result[1:6]), (*nodes.panels, *nodes[1:6]), strict=True):
        into[:n] = values[:n]
    result.made[0] = n
    return result


def placed_apart(nodes: Nodes) -> Nodes:
    """Return nodes that are the same but for their places, which are for `place` to write."""
    origin, u, v, centroid = (np.zeros_like(nodes.panels.origin) for _ in range(4))
    panels = nodes.panels._replace(origin=origin, u=u, v=v, centroid=centroid)
    return nodes._replace(panels=panels, points=np.zeros_like(nodes.points))


def _normals(panels: Panels) -> Floats:
    normal = np.cross(panels.u, panels.v)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    largest = np.argmax(np.abs(normal), axis=1)
    return np.asarray(normal * np.sign(np.take_along_axis(normal, largest[:, None], axis=1)))


def _halves(spots: Floats, areas: Floats, own: Integers) -> list[Integers]:
    """Return two halves of about the same area."""
    offset = spots - np.average(spots, axis=0, weights=areas)
    axis = np.linalg.eigh((offset * areas[:, None]).T @ offset)[1][:, -1]
    order = np.argsort(np.round(offset @ axis, 12), kind="stable")
    filled = np.cumsum(areas[order])
    cut = int(np.clip(np.searchsorted(filled, 0.5 * filled[-1]) + 1, 1, len(own) - 1))
    return [own[np.sort(order[:cut])], own[np.sort(order[cut:])]]


def _fill(nodes: Nodes, k: int, panels: Panels, own: Integers) -> None:
    """Write node k of the panels `own`."""
    mine = nodes.panels
    if len(own) == 1:
        for into, values in zip(mine, panels, strict=True):
            into[k] = values[own[0]]
        nodes.alone[k] = True
        _spread(nodes, k)
        return
    areas = panels.area[own]
    mine.area[k] = areas.sum()
    mine.centroid[k] = np.average(panels.centroid[own], axis=0, weights=areas)
    away = np.linalg.norm(panels.centroid[own] - mine.centroid[k], axis=1)
    mine.diameter[k] = 2.0 * np.max(away + 0.5 * panels.diameter[own])
    groups = [own]
    while len(groups) < min(4, len(own)):
        groups.sort(key=lambda group: -len(group))
        wide = groups.pop(0)
        spread = panels.centroid[wide] - panels.centroid[wide].mean(axis=0)
        axis = np.linalg.eigh(spread.T @ spread)[1][:, -1]
        order = np.argsort(np.round(spread @ axis, 12), kind="stable")
        groups += [wide[order[: len(wide) // 2]], wide[order[len(wide) // 2 :]]]
    for j, group in enumerate(groups):
        share = panels.area[group]
        nodes.points[k, j] = np.average(panels.centroid[group], axis=0, weights=share)
        nodes.weights[k, j] = share.sum() / areas.sum()
    nodes.points[k, len(groups) :] = nodes.points[k, 0]


@kernel
def _spread(nodes: Nodes, k: int) -> None:
    """Write the points of a panel: four, or of a triangle three."""
    four = nodes.panels.four[k]
    for j in range(4):
        if four:
            a = 0.21132486540518713 if j < 2 else 0.7886751345948129
            b = 0.21132486540518713 if j % 2 == 0 else 0.7886751345948129
            nodes.weights[k, j] = 0.25
        else:
            a, b = 1.0 / 6.0 if j != 1 else 2.0 / 3.0, 1.0 / 6.0 if j != 2 else 2.0 / 3.0
            nodes.weights[k, j] = 1.0 / 3.0 if j < 3 else 0.0
        x, y, z = point_on(nodes.panels, k, a, b)
        nodes.points[k, j, 0], nodes.points[k, j, 1], nodes.points[k, j, 2] = x, y, z


@leaf_kernel
def _corner(rows: Floats, k: int) -> Triple:
    return (rows[k, 0], rows[k, 1], rows[k, 2])


@leaf_kernel
def _write(nodes: Nodes, k: int, origin: Triple, u: Triple, v: Triple, four: bool) -> None:
    """Write a half."""
    panels = nodes.panels
    share = 0.5 if four else 1.0 / 3.0
    for axis in range(3):
        panels.origin[k, axis], panels.u[k, axis], panels.v[k, axis] = origin[axis], u[axis], v[axis]
        panels.centroid[k, axis] = origin[axis] + share * (u[axis] + v[axis])
    panels.four[k] = four
    panels.diameter[k] = max(norm(u), norm(v), norm(minus(u, v)))
    if four:
        panels.diameter[k] = max(panels.diameter[k], norm(along(u, 1.0, v)))
    panels.area[k] = norm(cross(u, v)) * (1.0 if four else 0.5)
    nodes.alone[k] = True


@kernel
def children(nodes: Nodes, k: int) -> int:
    """Return the first of the two children of a node, a panel's made if need be; -1 if there is no room for them."""
    if nodes.child[k] >= 0:
        return int(nodes.child[k])
    first = int(nodes.made[0])
    if first + 2 > len(nodes.alone):
        return -1
    panels, four = nodes.panels, nodes.panels.four[k]
    o, u, v = _corner(panels.origin, k), _corner(panels.u, k), _corner(panels.v, k)
    across = minus(v, u)
    side_u, side_v, third = dot(u, u), dot(v, v), (-1.0 if four else dot(across, across))
    if third > side_u and third > side_v:
        o, u, v = along(o, 1.0, u), across, (-u[0], -u[1], -u[2])
    elif side_v > side_u:
        u, v = v, u
    half = (0.5 * u[0], 0.5 * u[1], 0.5 * u[2])
    _write(nodes, first, o, half, v, four)
    _write(nodes, first + 1, along(o, 1.0, half), half, v if four else minus(v, half), four)
    for j in (first, first + 1):
        nodes.shape[j] = nodes.shape[k]
        _spread(nodes, j)
    nodes.child[k] = first
    nodes.made[0] = first + 2
    return first


@entry(NODES_TYPE, int64)
@kernel
def first_child(nodes: Nodes, k: int) -> int:
    """Return the first of the two children of a node, see `children`."""
    return children(nodes, k)


@leaf_kernel
def _turn(vector: Floats, T: Floats, share: float, into: Floats) -> None:
    """Write a vector that is turned, and moved by a share of the pose's way."""
    x, y, z = vector[0], vector[1], vector[2]
    for axis in range(3):
        into[axis] = T[axis, 0] * x + T[axis, 1] * y + T[axis, 2] * z + share * T[axis, 3]


@entry(NODES_TYPE, int64[::1], float64[:, :, ::1], NODES_TYPE)
@kernel
def place(nodes: Nodes, which: Integers, T: Floats, into: Nodes) -> None:
    """Write where nodes and all clusters and panels that they are made of are, with a pose (shapes, 4, 4) of each."""
    stack = np.zeros(_ROOM, np.int64)
    for k in range(len(which)):
        stack[0] = which[k]
        size = 1
        while size > 0:
            size -= 1
            node = stack[size]
            M = T[nodes.shape[node]]
            _turn(nodes.panels.centroid[node], M, 1.0, into.panels.centroid[node])
            for j in range(4):
                _turn(nodes.points[node, j], M, 1.0, into.points[node, j])
            if nodes.alone[node]:
                _turn(nodes.panels.origin[node], M, 1.0, into.panels.origin[node])
                _turn(nodes.panels.u[node], M, 0.0, into.panels.u[node])
                _turn(nodes.panels.v[node], M, 0.0, into.panels.v[node])
            else:
                stack[size], stack[size + 1] = nodes.child[node], nodes.child[node] + 1
                size += 2


@leaf_kernel
def mean_of_points(a: Nodes, i: int, b: Nodes, j: int) -> float:
    """Return the mean of 1/r over four points of each of two nodes."""
    total = 0.0
    for k in range(4):
        if a.weights[i, k] > 0.0:
            x, y, z = a.points[i, k, 0], a.points[i, k, 1], a.points[i, k, 2]
            part = 0.0
            for m in range(4):
                X, Y, Z = x - b.points[j, m, 0], y - b.points[j, m, 1], z - b.points[j, m, 2]
                part += b.weights[j, m] / math.sqrt(X * X + Y * Y + Z * Z)
            total += a.weights[i, k] * part
    return total


@leaf_kernel
def _mean_of_quarters(a: Nodes, i: int, b: Nodes, j: int) -> float:
    """Return the mean of 1/r over a panel i that is cut in four, with three or four points each, and points of j."""
    four = a.panels.four[i]
    total = 0.0
    for m in range(4):
        if b.weights[j, m] > 0.0:
            q = (b.points[j, m, 0], b.points[j, m, 1], b.points[j, m, 2])
            part = 0.0
            for k in range(len(_QUARTERS_FOUR) if four else len(_QUARTERS_TRIANGLE)):
                s, t = (
                    (_QUARTERS_FOUR[k, 0], _QUARTERS_FOUR[k, 1])
                    if four
                    else (_QUARTERS_TRIANGLE[k, 0], _QUARTERS_TRIANGLE[k, 1])
                )
                x, y, z = point_on(a.panels, i, s, t)
                X, Y, Z = x - q[0], y - q[1], z - q[2]
                part += 1.0 / math.sqrt(X * X + Y * Y + Z * Z)
            total += b.weights[j, m] * part / (len(_QUARTERS_FOUR) if four else len(_QUARTERS_TRIANGLE))
    return total


@leaf_kernel
def node_mean(a: Nodes, i: int, b: Nodes, j: int, rule: Rule, stack: Integers, shares: Floats) -> float:
    """Return the mean of 1/r [1/m] over node i of `a` and j of `b`, clusters that are near taken apart.

    `stack` (n, 2) and `shares` (n,) are scratch memory.
    """
    closed, middle, far = rule
    stack[0, 0], stack[0, 1] = i, j
    shares[0] = 1.0
    size, total = 1, 0.0
    while size > 0:
        size -= 1
        p, q, share = stack[size, 0], stack[size, 1], shares[size]
        gap = minus(_corner(a.panels.centroid, p), _corner(b.panels.centroid, q))
        D = max(a.panels.diameter[p], b.panels.diameter[q])
        square = dot(gap, gap)
        if square > far * far * D * D:
            total += share / math.sqrt(square)
        elif square > middle * middle * D * D:
            total += share * mean_of_points(a, p, b, q)
        elif a.alone[p] and b.alone[q]:
            if square <= closed * closed * D * D:
                total += share * pair_mean(a.panels, p, b.panels, q)
            elif a.panels.diameter[p] >= b.panels.diameter[q]:
                total += share * _mean_of_quarters(a, p, b, q)
            else:
                total += share * _mean_of_quarters(b, q, a, p)
        elif size + 2 > len(shares):
            total += share / max(math.sqrt(square), 0.3 * D)
        elif not a.alone[p] and (b.alone[q] or a.panels.diameter[p] >= b.panels.diameter[q]):
            first = a.child[p]
            for c in (first, first + 1):
                stack[size, 0], stack[size, 1] = c, q
                shares[size] = share * a.panels.area[c] / a.panels.area[p]
                size += 1
        else:
            first = b.child[q]
            for c in (first, first + 1):
                stack[size, 0], stack[size, 1] = p, c
                shares[size] = share * b.panels.area[c] / b.panels.area[q]
                size += 1
    return total
