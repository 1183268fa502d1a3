"""The axes of boxes: of few points all are turned, which is the same as turning their hull."""

import numpy as np
import pytest

from replay.geometry import obb_fit
from replay.geometry.hull import convex_hull
from replay.geometry.principal_axes import covariance_of_points


@pytest.mark.parametrize("seed", range(8))
def test_points_inside_turn_no_box(seed: int) -> None:
    rng = np.random.default_rng(seed)
    prism = np.concatenate(
        [[[x, y, z] for x in (-0.2, 0.2) for y in (-0.2, 0.2) for z in (-1.0, 1.0)], np.zeros((8, 3))]
    )
    points = prism @ np.linalg.qr(rng.normal(size=(3, 3)))[0]
    points[8:] = rng.dirichlet(np.ones(8), 8) @ points[:8]
    assert len(points) <= obb_fit._FEW
    hull = convex_hull(points)
    assert hull is not None and len(hull.vertices) == 8

    def never() -> None:
        raise AssertionError("no hull is asked for")

    covariance = covariance_of_points(points[:8])
    of_all, of_hull = (obb_fit.box_axes(p, never, covariance) for p in (points, points[hull.vertices]))
    np.testing.assert_array_equal(of_all, of_hull)
