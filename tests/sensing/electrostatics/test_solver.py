"""Capacitances of conductors against closed forms and published digits."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from replay.sensing.electrostatics import cholesky
from replay.sensing.electrostatics.faces import faces_of
from replay.sensing.electrostatics.grading import graded, nodes
from replay.sensing.electrostatics.influence import fill_influences
from replay.sensing.electrostatics.panels import Panels, joined, moved, triangles_as_panels
from tests.sensing.electrostatics.made_cases import box, icosphere, rectangle


def matrix(*conductors: Panels) -> Any:
    """Return Maxwell's matrix of conductors [m], in units of 4 pi eps0."""
    panels = joined(conductors)
    number = np.repeat(np.arange(len(conductors)), [len(each.area) for each in conductors])
    influences = np.empty((len(number), len(number)))
    fill_influences(panels, influences)
    assert cholesky.factor(influences) == -1
    drives = np.ascontiguousarray((number == np.arange(len(conductors))[:, None]).astype(float))
    charges = drives.copy()
    cholesky.solve(influences, 0, charges)
    return charges @ drives.T


def extrapolated(coarse: Any, fine: Any, ratio: float, order: float) -> Any:
    return fine + (fine - coarse) / (ratio**order - 1.0)


def lifted(panels: Panels, z: float) -> Panels:
    T = np.eye(4)
    T[2, 3] = z
    return moved(panels, T)


def disk(rings: int, sectors: int) -> Panels:
    """Return a polygon of rings towards the rim whose area is that of the unit disk."""
    r = 2.0 * nodes(2 * rings, 1.0, 2.5)[rings:] - 1.0
    r *= np.sqrt(2 * np.pi / sectors / np.sin(2 * np.pi / sectors))
    angle = 2 * np.pi * np.arange(sectors + 1) / sectors
    spoke = np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)
    found = []
    for inner, outer in pairwise(r):
        a, b, c, d = inner * spoke[:-1], outer * spoke[:-1], outer * spoke[1:], inner * spoke[1:]
        found.append(np.stack([a, b, c], axis=1))
        if inner > 0.0:
            found.append(np.stack([a, c, d], axis=1))
    return triangles_as_panels(np.concatenate(found))


def two_spheres(distance: float) -> tuple[float, float]:
    """Return c11 and c12 of two spheres of radius 1 (Maxwell 1873, article 173, summed in bispherical form)."""
    beta = np.arccosh(0.5 * distance)
    n = np.arange(1, 100)
    return np.sinh(beta) * np.sum(1 / np.sinh((2 * n - 1) * beta)), -np.sinh(beta) * np.sum(1 / np.sinh(2 * n * beta))


def loves_disks(gap: float) -> float:
    """Return the mutual capacitance of coaxial unit disks (Love 1949), by Gauss quadrature of his equation."""
    x, w = np.polynomial.legendre.leggauss(400)
    kernel = gap / (gap * gap + (x[:, None] - x) ** 2) / np.pi
    f = np.linalg.solve(np.eye(len(x)) - kernel * w, np.ones(len(x)))
    return float(w @ f) / (2 * np.pi)


def test_a_cube() -> None:
    faces = faces_of(box(1.0, 1.0, 1.0))
    coarse, fine = (matrix(graded(faces, n))[0, 0] for n in (6, 12))
    assert fine == pytest.approx(0.6606782, rel=3e-4)
    assert extrapolated(coarse, fine, 2.0, 2.4) == pytest.approx(0.6606782, rel=6e-5)


def test_a_square_plate() -> None:
    faces = faces_of(rectangle(1.0, 1.0))
    coarse, fine = (matrix(graded(faces, n))[0, 0] for n in (12, 18))
    assert extrapolated(coarse, fine, 1.5, 2.3) == pytest.approx(0.36678947, rel=1e-4)


def test_a_sphere() -> None:
    coarse, fine = (matrix(triangles_as_panels(icosphere(1.0, k)))[0, 0] for k in (2, 3))
    assert extrapolated(coarse, fine, 2.0, 2.0) == pytest.approx(1.0, rel=1.7e-4)


def test_a_disk() -> None:
    coarse, fine = (matrix(disk(n, 4 * n))[0, 0] for n in (5, 10))
    assert extrapolated(coarse, fine, 2.0, 2.2) == pytest.approx(2.0 / np.pi, rel=1e-4)


@pytest.mark.parametrize("gap", [0.1, 0.5, 2.0, 10.0])
def test_loves_disks(gap: float) -> None:
    found = []
    for n in (6, 10):
        one = disk(n, 3 * n)
        c = matrix(one, lifted(one, gap))
        found.append((c[0, 0] * c[1, 1] - c[0, 1] ** 2) / (c[0, 0] + c[1, 1] + 2 * c[0, 1]))
    assert extrapolated(*found, 10 / 6, 2.2) == pytest.approx(loves_disks(gap), rel=1.5e-3)


@pytest.mark.parametrize("distance", [3.0, 10.0])
def test_two_spheres_and_a_sphere_over_a_plane(distance: float) -> None:
    """A sphere over an earthed plane is two with opposite charges: c11 - c12."""
    coarse, fine = (triangles_as_panels(icosphere(1.0, k)) for k in (1, 2))
    found = extrapolated(*(matrix(one, lifted(one, distance)) for one in (coarse, fine)), 2.0, 2.0)
    c11, c12 = two_spheres(distance)
    assert found[0, 0] == pytest.approx(c11, rel=3e-3)
    assert found[0, 1] == pytest.approx(c12, rel=6e-3)
    assert found[0, 0] - found[0, 1] == pytest.approx(c11 - c12, rel=4e-3)


def test_parallel_squares_far_apart_and_close() -> None:
    """Far: two charges at their distance. Close: the plate capacitor with a fringe at its edges (Kirchhoff 1877).

    Far, panels of 12 to 18 an edge come to 1.4e-4, of 15 to 23 to 1.2e-4: what is left is the rule for panels that
    touch.
    """
    faces = faces_of(rectangle(1.0, 1.0))
    for distance, bound in ((0.02, 1.5e-2), (20.0, 2e-4)):
        found = []
        for n in (12, 18):
            one = graded(faces, n)
            c = matrix(one, lifted(one, distance))
            found.append((c[0, 0] * c[1, 1] - c[0, 1] ** 2) / (c[0, 0] + c[1, 1] + 2 * c[0, 1]))
        value = extrapolated(*found, 1.5, 2.0)
        if distance > 1.0:
            expected = 0.5 / (1 / 0.36678947 - 1 / distance)
        else:
            fringe = distance / np.pi * (1.0 + np.log(2.0 * np.pi / distance))
            expected = (1.0 + fringe) ** 2 / (4 * np.pi * distance)
        assert value == pytest.approx(expected, rel=bound)
