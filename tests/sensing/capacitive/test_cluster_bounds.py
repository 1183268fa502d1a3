"""What lies over a border, and what is above z = 0: the bounds hold for what is drawn at random, and are not idle."""

import numpy as np

from replay.geometry.tree import triangle_tree
from replay.numerics import transforms
from replay.sensing.capacitive import plate_integral
from replay.sensing.capacitive.tree.cluster_bounds import _over_borders
from replay.sensing.capacitive.tree.clusters import _largest_variance, make_clusters
from replay.sensing.capacitive.tree.tree_sum import COUNTS, sum_tree


def test_the_largest_variance_is_bounded_and_at_most_2_percent_above():
    rng = np.random.default_rng(3)
    points = rng.normal(size=(500, 9, 3)) * 10.0 ** rng.uniform(-3.0, 2.0, (500, 1, 3))
    points[:100, :, 2] = -points[:100, :, 1]  # flat, and crosswise: entries of both signs
    matrices = np.einsum("nki,nkj->nij", points, points)
    written = matrices[:, [0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    true = np.linalg.eigvalsh(matrices)[:, -1]
    bound = _largest_variance(written)
    assert (bound >= true * (1.0 - 1e-13)).all() and (bound <= 1.02 * true).all()
    assert _largest_variance(np.zeros((1, 6))) == 0.0


def test_the_depth_over_borders_is_at_most_its_bound():
    rng = np.random.default_rng(4)
    sharpest = 0.0
    for _ in range(2_000):
        places = rng.normal(size=rng.integers(2, 6)) * 10.0 ** rng.uniform(-3.0, 1.0)
        shares = rng.dirichlet(np.ones(len(places)))
        places -= (shares * places).sum()
        position, half = rng.normal(), 10.0 ** rng.uniform(-2.0, 1.0)
        blur = rng.choice([1e-12, 1e-3])
        sigma = np.sqrt((shares * places**2).sum())
        more, less = _over_borders(position, half, places.max(), -places.min(), sigma, blur)
        x = position + rng.uniform(-blur, blur) + places
        outside = (shares * (np.maximum(x - half, 0.0) ** 2 + np.maximum(-x - half, 0.0) ** 2)).sum()
        between = (shares * np.maximum(half - np.sign(position) * x, 0.0) ** 2).sum()
        found, bound = (outside, less) if abs(position) <= half else (between, more)
        assert found <= bound * (1.0 + 1e-9)
        sharpest = max(sharpest, found / bound if blur < 1e-6 and bound > 0.0 else 0.0)
    assert sharpest > 0.99


def test_a_triangle_across_the_plate_s_plane_is_summed_within_its_bound():
    rng = np.random.default_rng(8)
    half, T = np.array([[0.3, 0.2]]), transforms.identity()[None, None]
    seen = 0
    for _ in range(150):
        size = 10.0 ** rng.uniform(-2.5, -0.3)
        triangle = (size * rng.normal(size=(3, 3)) + [*(rng.choice([-1.0, 1.0], 2) * rng.uniform(0.0, 2.0, 2)), 0.0])[
            None
        ]
        exact = plate_integral(triangle, half[0])[0]
        if triangle[0, :, 2].min() >= 0.0 or triangle[0, :, 2].max() <= 0.0 or np.isinf(exact):
            continue
        clusters = make_clusters(triangle, triangle_tree(triangle))
        for rtol in (1e-1, 1e-3, 1e-5, 1e-7, 1e-9):
            value, _, bound = sum_tree(clusters, T, np.zeros(1), half, False, False, rtol, np.zeros(COUNTS, np.int64))
            assert abs(value[0, 0] - exact) <= bound[0, 0] + 1e-13 * exact
            assert bound[0, 0] <= rtol * exact * (1.0 + rtol)
        seen += 1
    assert seen > 60
