"""The exact reading where scenes meet it exactly: needles at poles, touching planes, ranges that end on an edge."""

import itertools
import math

import numpy as np
import pytest

from replay.sensing.distance import closest_in_cone

DEG = math.pi / 180.0
TURNS = [
    turn
    for order in itertools.permutations(np.identity(3))
    for signs in itertools.product((-1.0, 1.0), repeat=3)
    if np.linalg.det(turn := np.array(order) * signs) > 0.0
]


def pole(count: int, radius: float) -> np.ndarray:
    """Return the needles about the south pole of a sphere whose corners there are the same but for last digits."""
    polar = np.array([math.pi * (count - 1) / count, math.pi])
    around = 2.0 * math.pi * np.arange(count + 1) / count
    ring, tip = (
        radius * np.stack([math.sin(p) * np.cos(around), math.sin(p) * np.sin(around), 0 * around + math.cos(p)], 1)
        for p in polar
    )
    return np.stack([ring[:-1], tip[:-1], tip[1:]], axis=1)


def test_a_needle_is_not_seen_beyond_its_tip():
    # the foot or the conic lay within rounding of the lines of both long edges, but far from the needle
    needles = np.concatenate([pole(count, radius) for count in (4, 8, 12) for radius in (0.1, 0.5)])
    rng = np.random.default_rng(5)
    hits = 0
    for corners, aperture in itertools.product(needles, (20 * DEG, 90 * DEG, math.pi, 270 * DEG)):
        direction = corners[0] - corners[1]
        apex = corners[1] + direction * rng.choice([-3.0, -0.5, 0.5, 2.0, 27.0]) + 0.1 * rng.integers(-1, 2, 3)
        axis = rng.choice([-1, 1]) * np.identity(3)[rng.integers(3)] if rng.random() < 0.5 else corners[0] - apex
        hit = closest_in_cone([corners], apex, axis, aperture)
        if hit.detected:
            hits += 1
            place = np.clip((hit.point - corners[1]) @ direction / (direction @ direction), 0.0, 1.0)
            assert np.linalg.norm(corners[1] + place * direction - hit.point) < 1e-14
    assert hits > 100


def test_a_plane_that_touches_the_cone_has_nothing_behind_the_apex():
    # the edge from (-1, -0.5, 1) to (1, 0.5, 0) lies in a plane that touches the cone about -x, on the far side of the
    # apex too
    corners = [[[1.0, 0.5, 0.0], [0.1, 0.1, 0.1], [-1.0, -0.5, 1.0]]]
    assert not closest_in_cone(corners, [0, 0, 0], [-1, 0, 0], 2.0 * math.atan(0.5)).detected


@pytest.mark.parametrize("reach", [0.05, 0.2, 0.7, 0.84, 1.0 / 3.0])
def test_a_range_that_ends_on_a_face_edge_or_corner_senses_it(reach):
    wall = [
        [[-0.3, -0.7, reach], [0.25, -0.7, reach], [0.25, 0.1, reach]],
        [[-0.3, -0.7, reach], [0.25, 0.1, reach], [-0.3, 0.1, reach]],
    ]
    edge = [[[-0.25, 0.0, reach], [0.1, 0.0, reach], [0.1, 0.0, reach + 0.5]]]
    slanted = [[[-0.3, 0.0, reach], [0.7, 0.0, reach], [0.1, 0.3, reach + 0.5]]]
    corner = [[[0.0, 0.0, reach], [0.3, 0.1, reach + 0.5], [-0.2, 0.1, reach + 0.4]]]
    for shape, turn in itertools.product((wall, edge, slanted, corner), TURNS):
        corners = np.array(shape) @ turn.T
        for order in itertools.permutations(range(3)):
            hit = closest_in_cone(corners[:, order], [0, 0, 0], turn[:, 2], 30 * DEG, range=reach)
            assert hit.detected
            assert hit.distance == reach
