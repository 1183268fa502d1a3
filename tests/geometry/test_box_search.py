"""The search for the smallest box, at bodies whose smallest box is known, from every start."""

from __future__ import annotations

import numpy as np
import pytest

from replay.geometry import primitives
from replay.geometry.box_search import box_volume, smallest_box
from replay.numerics import transforms
from tests.amounts import cases

OCTAHEDRON = np.concatenate([np.eye(3), -np.eye(3)])
TETRAHEDRON = np.array([[1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])


def turned(rng):
    return transforms.from_quaternion(rng.normal(size=4))[:3, :3]


def test_the_volume_along_axes_is_the_product_of_the_widths_along_them():
    rng = np.random.default_rng(1)
    for count in (1, 2, 3, 50):
        points, axes = rng.normal(size=(count, 3)) * (1.0, 5.0, 0.2) + (7.0, -3.0, 2.0), turned(rng)
        assert box_volume(points, axes) == pytest.approx(float(np.prod(np.ptp(points @ axes.T, axis=0))), rel=1e-12)


@pytest.mark.parametrize(
    ("points", "volume"),
    [
        (primitives.cuboid((1.0, 2.0, 3.0)).vertices / 3.0, 6.0 / 27.0),
        (OCTAHEDRON, 64.0 / 27.0),
        (TETRAHEDRON, 8.0),
    ],
    ids=["cuboid", "octahedron", "tetrahedron"],
)
def test_the_smallest_box_is_found_from_any_axes(points, volume):
    """Without trials and with them, and with a start that is the best one."""
    rng = np.random.default_rng(2)
    for _ in range(cases(20)):
        motion = turned(rng)
        moved = np.ascontiguousarray(points @ motion.T)
        first, starts = turned(rng), np.array([turned(rng) for _ in range(8)])
        trials = np.array([turned(rng)[0] for _ in range(10)])
        for kept, some in ((1, trials), (3, trials), (1, np.zeros((0, 3)))):
            axes = smallest_box(moved, first, some, starts, kept, 0.0)
            np.testing.assert_allclose(axes @ axes.T, np.eye(3), rtol=0, atol=1e-12)
            assert volume * (1 - 1e-9) <= box_volume(moved, axes) <= volume * (1 + 2e-3)


def test_a_box_is_never_larger_than_the_first_and_one_that_cannot_be_beaten_is_kept():
    rng = np.random.default_rng(3)
    none = np.zeros((0, 3))
    for _ in range(cases(50)):
        points, axes = rng.normal(size=(20, 3)), turned(rng)
        volume = box_volume(points, axes)
        found = smallest_box(points, axes, none, np.zeros((0, 3, 3)), 1, 0.0)
        assert box_volume(points, found) <= volume * (1 + 1e-12)
        np.testing.assert_array_equal(smallest_box(points, axes, none, np.zeros((0, 3, 3)), 1, volume), axes)
