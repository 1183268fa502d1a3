"""Targets keep what they are given and refuse what has no surface."""

import numpy as np
import pytest

from replay.errors import InvalidValue
from replay.sensing.target import make_target


def test_target_carries_triangles_and_their_tree():
    triangles = np.random.default_rng(1).normal(size=(20, 3, 3))
    target = make_target("arm/cover", 2, triangles)
    assert (target.name, target.link) == ("arm/cover", 2)
    np.testing.assert_array_equal(target.triangles, triangles)
    np.testing.assert_array_equal(target.tree.upper[0], triangles.max(axis=(0, 1)))


@pytest.mark.parametrize(
    ("link", "triangles"),
    [(0, np.empty((0, 3, 3))), (0, np.zeros((3, 3))), (0, np.full((1, 3, 3), np.nan)), (-1, np.zeros((1, 3, 3)))],
)
def test_refuses_what_cannot_be_sensed(link, triangles):
    with pytest.raises(InvalidValue):
        make_target("arm/cover", link, triangles)
