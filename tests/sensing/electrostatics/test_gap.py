"""The least distance of surfaces beside a dense search."""

from __future__ import annotations

import numpy as np
import pytest

from replay.geometry.tree import triangle_tree
from replay.sensing.electrostatics.gap import least_gap
from replay.sensing.electrostatics.panels import triangles_as_panels
from replay.sensing.electrostatics.refinement import point_sample
from tests.sensing.electrostatics.made_cases import box, icosphere, rectangle, shifted


def found(surface: np.ndarray, triangles: np.ndarray, within: float = np.inf) -> tuple[float, np.ndarray, np.ndarray]:
    gap = least_gap(np.ascontiguousarray(surface), triangles, triangle_tree(triangles), within)
    return gap.distance, np.array(gap.first), np.array(gap.second)


@pytest.mark.parametrize("seed", range(12))
def test_random_triangles(seed: int) -> None:
    random = np.random.default_rng(seed)
    a, b = random.normal(size=(2, 3, 3, 3))
    b += random.choice([0.0, 3.0, 10.0])
    distance, p, q = found(a, b)
    points = [point_sample(triangles_as_panels(each), 0.25) for each in (a, b)]
    dense = np.sqrt(min(np.min(np.sum((points[1] - point) ** 2, axis=1)) for point in points[0]))
    assert distance <= dense + 1e-12 and dense <= distance + 0.4
    assert np.linalg.norm(p - q) == pytest.approx(distance, abs=1e-12)


def test_a_ball_over_a_plate_beside_it_and_through_it() -> None:
    ball, plate = icosphere(0.1, 3), rectangle(0.3, 0.3)
    top = ball[:, :, 2].min()
    for height in (0.2, 0.101, 0.1003):
        assert found(plate, shifted(ball, 0.0, 0.0, height))[0] == pytest.approx(height + top, rel=1e-9)
    assert found(plate, shifted(ball, 0.05, 0.0, 0.02))[0] == 0.0
    assert found(box(1.0, 1.0, 1.0), ball)[0] == pytest.approx(0.4, rel=1e-2)


def test_beyond_what_is_asked_for_nothing_is_found() -> None:
    assert found(rectangle(1.0, 1.0), rectangle(1.0, 1.0, 0.5), 0.4)[0] == np.inf
