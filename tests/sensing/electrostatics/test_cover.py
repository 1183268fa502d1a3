"""Why sensors have no dielectric cover: the effective gap, a plate moved out by t (1 - 1/eps), is not within 5 %.

The reference has rings of finite volumes around an axis, in a grounded box: a thin disk at 1 V, a layer of permittivity
eps and thickness t on it, and a grounded body at some gap in front of the layer.
"""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse import linalg

Floats = NDArray[np.float64]

BOX = 0.5
STEP, GROWTH, LARGEST = 5e-4, 1.25, 0.02
THICK = 0.03
"""Of the body [m]."""


def lines(marks: list[float]) -> Floats:
    """Return coordinates that hold all marks and are STEP apart beside them, farther in between."""
    marks = sorted(set(marks))
    found = [np.array(marks[:1])]
    for a, b in itertools.pairwise(marks):
        steps, h = [0.0], min(STEP, (b - a) / 4)
        while steps[-1] + h < (b - a) / 2:
            steps.append(steps[-1] + h)
            h = min(GROWTH * h, LARGEST)
        left = a + np.array(steps)
        found += [left[1:], (a + b - left)[::-1]]
    return np.concatenate(found)


def capacitances(radius: float, body: float, gap: float, *, plate: float, cover: float, t: float, eps: float) -> Floats:
    """Return a disk's capacitance alone and with a body [m], over eps0; it is at `plate`, the layer from 0 to t."""
    front = t + gap
    r = lines([0.0, radius, cover, body, BOX])
    z = lines([-BOX, 0.0, plate, t, front, front + THICK, BOX])
    middle, height = 0.5 * (r[1:] + r[:-1]), np.diff(z)
    layer = np.ones((len(r) - 1, len(z) - 1))
    layer[np.ix_(middle < cover, (0.5 * (z[1:] + z[:-1]) > 0.0) & (0.5 * (z[1:] + z[:-1]) < t))] = eps
    out = np.zeros((len(r) - 1, len(z)))
    side = layer * (2.0 * np.pi * middle / np.diff(r))[:, None] * (0.5 * height)
    out[:, :-1] += side
    out[:, 1:] += side
    up = np.zeros((len(r), len(z) - 1))
    up[:-1] += layer * (np.pi * (middle**2 - r[:-1] ** 2))[:, None] / height
    up[1:] += layer * (np.pi * (r[1:] ** 2 - middle**2))[:, None] / height
    index = np.arange(len(r) * len(z)).reshape(len(r), len(z))
    a, b = (
        np.concatenate([index[:-1].ravel(), index[:, :-1].ravel()]),
        np.concatenate([index[1:].ravel(), index[:, 1:].ravel()]),
    )
    g = np.concatenate([out.ravel(), up.ravel()])
    rows, columns = np.concatenate([a, b, a, b]), np.concatenate([a, b, b, a])
    matrix = sparse.coo_matrix((np.concatenate([g, g, -g, -g]), (rows, columns))).tocsr()
    x, y = np.meshgrid(r, z, indexing="ij")
    disk = ((x <= radius + 1e-9) & (np.abs(y - plate) < 1e-9)).ravel()
    box = ((x > BOX - 1e-9) | (np.abs(y) > BOX - 1e-9)).ravel()
    target = ((x <= body + 1e-9) & (y > front - 1e-9) & (y < front + THICK + 1e-9)).ravel()
    found = []
    for grounded in (box, box | target):
        free = ~(disk | grounded)
        volts = disk.astype(float)
        volts[free] = linalg.spsolve(matrix[free][:, free].tocsc(), -matrix[free] @ disk.astype(float))
        found.append(float(volts @ (matrix @ volts)))
    return np.array(found)


def rule(radius: float, body: float, gap: float, *, cover: float, t: float, eps: float) -> float:
    """Return by how much the effective gap is off, as a share of what the body adds."""
    true = capacitances(radius, body, gap, plate=0.0, cover=cover, t=t, eps=eps)
    moved = capacitances(radius, body, gap, plate=t * (1.0 - 1.0 / eps), cover=cover, t=t, eps=1.0)
    return float(np.diff(moved)[0] / np.diff(true)[0] - 1.0)


def test_the_reference_is_the_closed_form_of_a_disk() -> None:
    """8 eps0 a of a thin disk by itself; the box adds some per cent."""
    alone, _ = capacitances(0.02, 0.05, 0.05, plate=0.0, cover=0.06, t=2e-3, eps=1.0)
    assert 8 * 0.02 < alone < 1.06 * 8 * 0.02


def test_the_effective_gap_holds_between_wide_plates() -> None:
    assert abs(rule(0.1, 0.1, 3e-3, cover=0.1, t=2e-3, eps=3.0)) < 0.01


@pytest.mark.parametrize(("t", "gap", "least"), [(1e-3, 5e-3, 0.07), (2e-3, 5e-2, 0.15)])
def test_it_does_not_hold_where_the_cover_reaches_beyond_the_plate(t: float, gap: float, least: float) -> None:
    assert rule(0.02, 0.05, gap, cover=0.06, t=t, eps=3.0) < -least
