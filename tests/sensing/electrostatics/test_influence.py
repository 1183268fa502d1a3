"""Influences of panels against adaptive quadrature of exact potentials."""

from __future__ import annotations

import numpy as np
import pytest

from replay.numerics.inverse_distance import mean_over_triangle
from replay.sensing.electrostatics.influence import mean_potentials, point_potentials
from replay.sensing.electrostatics.panels import Panels, halved, make_panels


def panel(corner: tuple[float, ...], u: tuple[float, ...], v: tuple[float, ...], four: bool) -> Panels:
    return make_panels(np.array([corner]), np.array([u]), np.array([v]), np.array([four]))


def triangles(one: Panels) -> list[np.ndarray]:
    a, u, v = one.origin[0], one.u[0], one.v[0]
    return [np.stack([a, a + u, a + v]), *([np.stack([a + u, a + u + v, a + v])] if one.four[0] else [])]


def exact_potential(point: np.ndarray, one: Panels) -> float:
    parts = [tuple(map(tuple, corners - point)) for corners in triangles(one)]
    return float(np.mean([mean_over_triangle(*part) for part in parts]))


@pytest.mark.parametrize("four", [False, True])
def test_the_potential_at_a_point_is_that_of_the_regions_of_the_sensors_own_model(four: bool) -> None:
    one = panel((0.1, -0.2, 0.0), (1.0, 0.1, 0.2), (-0.3, 0.8, 0.1), four)
    points = np.random.default_rng(5).uniform(-2.0, 2.0, (60, 3))
    points[:3] = one.centroid + np.array([[0, 0, 0], [1e-3, 0, 0], [0, 0, 1e-9]])
    found = point_potentials(points, one, np.ones((1, 1)))[0]
    assert found == pytest.approx([exact_potential(point, one) for point in points], rel=1e-9)


@pytest.mark.parametrize("four", [False, True])
@pytest.mark.parametrize(
    ("shift", "bound"), [(0.0, 2.5e-3), (1.0, 6e-3), (1.6, 3e-5), (3.0, 2e-6), (12.0, 3e-6), (40.0, 3e-5)]
)
def test_the_mean_over_a_pair_is_that_over_many_small_pieces(four: bool, shift: float, bound: float) -> None:
    one = panel((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), True)
    other = panel((shift, 0.0, 0.0), (1.0, 0.0, 0.3), (0.0, 1.0, 0.0), four)
    pieces = other
    for _ in range(13):
        pieces = halved(pieces)
    exact = np.mean(point_potentials(pieces.centroid, one, np.ones((1, 1))))
    there, back = (mean_potentials(*pair, np.ones((1, 1)))[0, 0] for pair in ((other, one), (one, other)))
    assert there == pytest.approx(exact, rel=bound)
    assert there == pytest.approx(back, rel=1e-15)


def test_halves_cover_their_panel() -> None:
    for four in (False, True):
        one = panel((0.0, 0.0, 0.0), (3.0, 0.0, 0.0), (0.5, 1.0, 0.0), four)
        two = halved(one)
        assert two.area.sum() == pytest.approx(one.area[0], rel=1e-15)
        assert np.average(two.centroid, axis=0, weights=two.area) == pytest.approx(one.centroid[0], abs=1e-15)
        assert (two.diameter < one.diameter[0]).all()
