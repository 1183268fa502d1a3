"""Charges on panels as a tree of clusters: what potential they make at a point, for the price of a few hundred panels.

A cluster farther away than seven of its diameters is its charge and its dipole about its centre,

    phi = Q / R + p . R / R^3,    p = sum q_j (x_j - centre);

a single panel so far away is a point, one farther than one and a half three or four points, and a nearer one has its
closed form. Charges of several electrodes, or of several meshes of them, go through the tree together.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numba import float64, int64

from replay.numerics.arrays import Floats, Integers
from replay.numerics.jit import leaf_kernel, record
from replay.sensing.electrostatics.influence import over_points, potential_at
from replay.sensing.electrostatics.panels import PANELS_TYPE, Panels, joined

_FAR, _MIDDLE = 7.0, 1.5


class ChargeTree(NamedTuple):
    """Nodes in the order in which they are visited: what is below a node comes right after it."""

    panels: Panels
    centre: Floats  # (n, 3) [m]
    diameter: Floats  # (n,) [m], of a ball around the centre with all panels
    after: Integers  # (n,) the first node that is not below
    panel: Integers  # (n,) -1 for a cluster
    moments: Floats  # (n, 4, k) charge, and dipole along x, y, z, of each column of charges


CHARGE_TREE_TYPE = record(
    ChargeTree, PANELS_TYPE, float64[:, ::1], float64[::1], int64[::1], int64[::1], float64[:, :, ::1]
)


def charge_tree(parts: Sequence[tuple[Panels, Floats]]) -> ChargeTree:
    """Return the tree over the panels of meshes with charges (k, n) each."""
    panels = joined([each for each, _ in parts])
    charges = np.concatenate([each for _, each in parts], axis=1)
    k, total = charges.shape
    size = 2 * total - 1
    centre, diameter = np.zeros((size, 3)), np.zeros(size)
    after, panel = np.zeros(size, np.int64), np.full(size, -1)
    moments = np.zeros((size, 4, k))
    waiting, at = [np.arange(total)], 0
    while waiting:
        own = waiting.pop()
        after[at] = at + 2 * len(own) - 1
        if len(own) == 1:
            panel[at] = own[0]
            centre[at], diameter[at] = panels.centroid[own[0]], panels.diameter[own[0]]
            moments[at, 0] = charges[:, own[0]]
        else:
            centre[at] = np.average(panels.centroid[own], axis=0, weights=panels.area[own])
            offset = panels.centroid[own] - centre[at]
            away = np.sqrt((offset * offset).sum(axis=1))
            diameter[at] = 2.0 * np.max(away + 0.5 * panels.diameter[own])
            moments[at, 0] = charges[:, own].sum(axis=1)
            for axis in range(3):
                moments[at, 1 + axis] = (charges[:, own] * offset[:, axis]).sum(axis=1)
            order = np.argsort(offset[:, np.argmax(np.ptp(offset, axis=0))], kind="stable")
            half = len(own) // 2
            waiting += [own[np.sort(order[half:])], own[np.sort(order[:half])]]
        at += 1
    return ChargeTree(panels, centre, diameter, after, panel, moments)


@leaf_kernel
def _add_cluster(total: Floats, charge: Floats, px: Floats, py: Floats, pz: Floats, R: Floats) -> None:
    """Add charges and dipoles; R is the way from the centre to the point, and 1/R and 1/R^3."""
    x, y, z, inverse, cubed = R[0], R[1], R[2], R[3], R[4]
    for c in range(len(total)):
        total[c] += charge[c] * inverse + (px[c] * x + py[c] * y + pz[c] * z) * cubed


@leaf_kernel
def _add_panel(total: Floats, charge: Floats, value: float) -> None:
    for c in range(len(total)):
        total[c] += charge[c] * value


@leaf_kernel
def add_potentials(total: Floats, x: float, y: float, z: float, tree: ChargeTree, R: Floats) -> None:
    """Add the potentials [charge/m] at a point to `total` (k,); R (5,) is scratch memory."""
    node = 0
    while node < len(tree.after):
        X, Y, Z = x - tree.centre[node, 0], y - tree.centre[node, 1], z - tree.centre[node, 2]
        square, D, j = X * X + Y * Y + Z * Z, tree.diameter[node], tree.panel[node]
        moments = tree.moments[node]
        if square > _FAR * _FAR * D * D:
            inverse = 1.0 / math.sqrt(square)
            R[0], R[1], R[2], R[3], R[4] = X, Y, Z, inverse, inverse * inverse * inverse
            _add_cluster(total, moments[0], moments[1], moments[2], moments[3], R)
        elif j < 0:
            node += 1
            continue
        elif square > _MIDDLE * _MIDDLE * D * D:
            _add_panel(total, moments[0], over_points(x, y, z, tree.panels, j))
        else:
            _add_panel(total, moments[0], potential_at((x, y, z), tree.panels, j))
        node = tree.after[node]
