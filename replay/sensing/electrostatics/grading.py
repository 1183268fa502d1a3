"""Grids of panels that are fine where charge gathers: at the edges of a face, and under the outline of a plate near it.

An edge of length L with n divisions has nodes at L/2 (1 - (1 - t)^p) from each end, t = 0, 2/n, ... 1, with exponent p
of that end.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from replay.numerics.arrays import Floats
from replay.sensing.electrostatics.faces import OPEN, SMOOTH, Faces
from replay.sensing.electrostatics.panels import Panels, chosen, joined, make_panels


def nodes(divisions: int, low: float, high: float) -> Floats:
    """Return the nodes 0 .. 1 (divisions + 1,) of an edge with exponents `low` at 0 and `high` at 1."""
    t = np.linspace(-1.0, 1.0, divisions + 1)
    p = np.where(t < 0.0, low, high)
    x = np.sign(t) * (1.0 - (1.0 - np.abs(t)) ** p)
    x[0], x[-1] = -1.0, 1.0
    return np.asarray(0.5 * (x + 1.0))


def grid(origin: Floats, u: Floats, v: Floats, along_u: Floats, along_v: Floats) -> Panels:
    """Return the panels of a parallelogram between nodes (n,) in 0 .. 1 along each edge."""
    a, b = np.meshgrid(along_u[:-1], along_v[:-1], indexing="ij")
    da, db = np.meshgrid(np.diff(along_u), np.diff(along_v), indexing="ij")
    start = origin + a.reshape(-1, 1) * u + b.reshape(-1, 1) * v
    return make_panels(start, da.reshape(-1, 1) * u, db.reshape(-1, 1) * v, np.ones(a.size, np.bool_))


def graded(faces: Faces, cells: float) -> Panels:
    """Return the panels of a surface: parallelograms as grids, triangles as they are.

    Args:
        faces: of one conductor.
        cells: divisions of its longest edge; shorter edges have fewer, as many as their length says. Each edge of a
            plate, which ends at all its edges, has as many.
    """
    panels, four = faces.panels, faces.panels.four
    lengths = np.stack([np.linalg.norm(panels.u, axis=1), np.linalg.norm(panels.v, axis=1)], axis=1)
    longest = float(lengths[four].max(initial=0.0))
    parts = [chosen(panels, ~four)] if not four.all() else []
    for i in np.flatnonzero(four):
        even = bool(np.all(faces.edges[i] == OPEN))
        counts = [math.ceil(cells * (1.0 if even else length / longest) - 1e-9) for length in lengths[i]]
        low_v, high_v, low_u, high_u = faces.edges[i]
        along_u = nodes(_fewest(counts[0], low_u, high_u), low_u, high_u)
        along_v = nodes(_fewest(counts[1], low_v, high_v), low_v, high_v)
        parts.append(grid(panels.origin[i], panels.u[i], panels.v[i], along_u, along_v))
    return joined(parts)


def _fewest(count: int, low: float, high: float) -> int:
    """Return a number of divisions: two at least between edges that are not both smooth."""
    return max(count, 1 if low == high == SMOOTH else 2)


def cut_nodes(cuts: Sequence[float], length: float, cells: float, width: float, ends: tuple[float, float]) -> Floats:
    """Return nodes 0 .. 1 of an edge that is cut at outlines of plates and graded towards each of them.

    Args:
        cuts: where, in 0 .. 1, ends excluded.
        length: of the edge [m].
        cells: divisions of the whole edge, if it were not cut.
        width: of the cells next to an outline, about [m].
        ends: exponents at the ends.
    """
    places = [0.0, *sorted(cuts), 1.0]
    result = [np.zeros(1)]
    for k in range(len(places) - 1):
        low, high = places[k], places[k + 1]
        # n divisions with exponent p end with a cell of (2 / n)^p part / 2; with p = 2 that is the width for this n
        share = min(2.0 * width / ((high - low) * length), 1.0)
        count = max(2, math.ceil(cells * (high - low) - 1e-9), min(math.ceil(2.0 / math.sqrt(share)), math.ceil(cells)))
        exponent = min(max(math.log(share) / math.log(2.0 / count), SMOOTH), OPEN) if count > 2 else SMOOTH
        first = ends[0] if k == 0 else exponent
        last = ends[1] if k == len(places) - 2 else exponent
        result.append(low + (high - low) * nodes(count, first, last)[1:])
    return np.concatenate(result)
