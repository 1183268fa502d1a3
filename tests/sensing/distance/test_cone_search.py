"""The exact kernel against a search that knows membership only, in every family of hard cases."""

import numpy as np
import pytest

from replay.numerics.jit import kernel
from replay.sensing.distance.cone import CONIC_BORDER, EDGE_BORDER, Cone, half_angle
from replay.sensing.distance.triangle import closest_on_triangle
from tests.sensing.distance.cone_families import FAMILIES
from tests.sensing.distance.cone_search import search_all

ERROR = 1e-11  # of the farthest corner
GRAZING = 1e-12  # of the farthest corner: nearer to only touching the cone than this, either answer is right
ON_CONE = 1e-12


@kernel
def exact_all(triangles, axes, half_angles):
    n = len(axes)
    distances, points, cases = np.empty(n), np.empty((n, 3)), np.empty(n, dtype=np.int64)
    for i in range(n):
        t = triangles[i]
        cone = Cone(axes[i, 0], axes[i, 1], axes[i, 2], half_angles[i, 0], half_angles[i, 1], 0.0)
        a, b, c = (t[0, 0], t[0, 1], t[0, 2]), (t[1, 0], t[1, 1], t[1, 2]), (t[2, 0], t[2, 1], t[2, 2])
        distances[i], point, cases[i] = closest_on_triangle(a, b, c, cone)
        for k in range(3):
            points[i, k] = point[k]
    return distances, points, cases


def check(family: str, seed: int, count: int) -> None:
    triangles, axes, apertures = FAMILIES[family](np.random.default_rng(seed), count)
    half_angles = np.array([half_angle(aperture) for aperture in apertures])
    distances, points, cases = exact_all(triangles, axes, half_angles)
    expected, largest_membership = search_all(triangles, axes, apertures)
    scale = np.max(np.linalg.norm(triangles, axis=2), axis=1)

    hit, expected_hit = np.isfinite(distances), np.isfinite(expected)
    clear = np.abs(largest_membership) > GRAZING * scale
    np.testing.assert_array_equal(hit[clear], expected_hit[clear])
    both = hit & expected_hit
    assert np.mean(both) > 0.02  # the sample means something
    np.testing.assert_array_less(np.abs(distances[both] - expected[both]), ERROR * scale[both])

    # Both equations of the cone, and the point is where the distance says
    hits = np.flatnonzero(hit)
    length = np.linalg.norm(points[hits], axis=1)
    np.testing.assert_allclose(length, distances[hits], rtol=1e-14, atol=1e-300)
    edge = np.flatnonzero(np.isin(cases, (CONIC_BORDER, EDGE_BORDER)))
    p, v, h = points[edge] / distances[edge, None], axes[edge], half_angles[edge]
    along = np.sum(p * v, axis=1)
    across = np.linalg.norm(np.cross(v, p), axis=1)
    np.testing.assert_allclose(along * np.abs(along), h[:, 0] * np.abs(h[:, 0]), rtol=0, atol=ON_CONE)
    np.testing.assert_allclose(across**2 * h[:, 0] ** 2, h[:, 1] ** 2 * along**2, rtol=0, atol=ON_CONE)


@pytest.mark.parametrize("family", FAMILIES)
def test_agrees_with_the_search(family):
    check(family, seed=20151, count=80)


@pytest.mark.soak
@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.parametrize("seed", range(6))
def test_agrees_with_the_search_often(family, seed):
    check(family, seed=seed, count=1000)
