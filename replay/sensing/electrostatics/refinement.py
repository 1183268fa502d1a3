"""Panels no larger than their distance to other conductors asks for."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from replay.numerics.arrays import Floats
from replay.sensing.electrostatics.panels import Panels, chosen, halved, joined

if TYPE_CHECKING:
    from scipy.spatial import cKDTree


_MOST_ROUNDS = 60
"""Each round halves what is too large: far more than any size asks for."""


def point_sample(panels: Panels, spacing: float) -> Floats:
    """Return points (n, 3) [m] on panels, no farther from each other than about `spacing` [m]."""
    pieces = bounded(panels, np.full(len(panels.area), 1.5 * spacing))
    return pieces.centroid


def bounded(panels: Panels, largest: Floats) -> Panels:
    """Return panels halved until their diameters are at most `largest` (n,) [m]."""
    done = []
    for _ in range(_MOST_ROUNDS):
        small = panels.diameter <= largest
        done.append(chosen(panels, small))
        if small.all():
            break
        panels = halved(chosen(panels, ~small))
        largest = np.repeat(largest[~small], 2)
    return joined(done)


def near_tree(points: Floats) -> cKDTree:
    """Return the tree that distances are looked up in."""
    from scipy.spatial import cKDTree

    # points on flat plates have equal coordinates, with which the balanced tree takes quadratic time
    return cKDTree(points, balanced_tree=False)


def refined(panels: Panels, others: cKDTree, *, slope: float, smallest: float) -> Panels:
    """Return panels halved until each diameter is at most max(smallest, slope x distance to the other conductors).

    Args:
        panels: of one conductor.
        others: see `near_tree`: a sample of the others' points.
        slope: diameter over distance, > 0.
        smallest: [m], > 0.
    """
    done = []
    for _ in range(_MOST_ROUNDS):
        distance = others.query(panels.centroid)[0]
        small = panels.diameter <= np.maximum(smallest, slope * distance)
        done.append(chosen(panels, small))
        if small.all():
            break
        panels = halved(chosen(panels, ~small))
    return joined(done)
