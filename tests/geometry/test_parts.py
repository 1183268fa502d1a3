"""Which triangles hang together where more than two meet at an edge."""

from __future__ import annotations

import math

import numpy as np
import pytest

from replay.geometry.parts import find_parts
from replay.numerics import transforms


def fan(degrees, forward, way):
    """Triangles at one edge, turned about it by angles from the first, wound along it or against it."""
    T = transforms.from_quaternion(np.array(way))
    T[:3, 3] = (3.0, -1.0, 0.5)
    angles = np.radians(degrees)
    thirds = np.stack([np.cos(angles), np.sin(angles), 0.3 * np.arange(len(angles))], axis=1)
    points = transforms.apply(T, np.concatenate([[[0.0, 0, 0], [0, 0, 2]], thirds]))
    return points, np.array([(0, 1, k + 2) if along else (1, 0, k + 2) for k, along in enumerate(forward)])


WAYS = [(0, 0, 0, 1), (1, 1, 1, 1), (0, 1, 0, 1), (0.3, -0.5, 0.2, 0.7), (-0.6, 0.1, 0.5, 0.2)]


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize(
    ("degrees", "forward", "pairs"),
    [
        ((0, 10, 180, 190), (1, 0, 1, 0), ({0, 1}, {2, 3})),
        ((0, 100, 110, 350), (1, 0, 1, 0), ({0, 3}, {1, 2})),  # the thin wedge lies across the direction of no turn
        ((0, 170, 350, 190), (1, 1, 0, 0), ({0, 2}, {1, 3})),
        ((30, 80, 200, 290), (1, 0, 1, 0), ({0, 1}, {2, 3})),
        ((0, 10, 20, 180), (1, 1, 0, 0), ({1, 2}, {0, 3})),  # those wound one way first, and then the thinnest wedge
        ((0, 60, 75, 180, 240, 250), (1, 0, 1, 0, 1, 0), ({1, 2}, {4, 5}, {0, 3})),
    ],
)
def test_at_an_edge_of_many_those_are_neighbours_that_bound_the_thinnest_wedge(degrees, forward, pairs, way):
    for order in (range(len(degrees)), range(len(degrees) - 1, -1, -1)):
        order = [*order]
        points, faces = fan(np.array(degrees)[order], np.array(forward)[order], way)
        found = find_parts(points, faces)
        parts = {
            frozenset(order[k] for k in np.flatnonzero(found.label == part)) for part in range(found.label.max() + 1)
        }
        assert parts == set(map(frozenset, pairs))
        assert not found.turned.any() and not found.one_sided.any() and not found.closed.any()


def test_two_triangles_that_lie_on_each_other_are_neighbours_last():
    points, faces = fan((0, 0, 90, 270), (1, 0, 1, 0), WAYS[3])
    label = find_parts(points, faces).label
    assert label[0] == label[3] and label[1] == label[2] and label[0] != label[1]


@pytest.mark.parametrize(("count", "parts"), [(16, 8), (18, 18)])
def test_of_more_triangles_at_an_edge_than_bodies_that_touch_have_none_are_neighbours(count, parts):
    points, faces = fan(np.arange(count) * 360 / count, [k % 2 == 0 for k in range(count)], WAYS[0])
    assert len(np.unique(find_parts(points, faces).label)) == parts


def test_of_a_part_that_is_wound_both_ways_the_fewer_are_turned_and_a_closed_one_is_told():
    points = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    for at in range(4):
        mixed = faces.copy()
        mixed[at] = mixed[at, ::-1]
        found = find_parts(points, mixed)
        assert found.turned.tolist() == [k == at for k in range(4)]
        assert found.closed.tolist() == [True] and found.one_sided.tolist() == [False]
    opened = find_parts(points, faces[:3])
    assert opened.label.tolist() == [0, 0, 0] and opened.closed.tolist() == [False] and not opened.turned.any()


def test_a_band_with_half_a_twist_is_one_sided_and_left_as_it_is_wound():
    points, faces = [], []
    count = 8
    for k in range(count):
        turn, half = 2 * math.pi * k / count, math.pi * k / count
        out = np.array([math.cos(turn), math.sin(turn), 0.0])
        side = math.cos(half) * np.array([0, 0, 1.0]) + math.sin(half) * out
        points += [3 * out + side, 3 * out - side]
        a, b = 2 * k, 2 * k + 1
        c, d = (a + 2, b + 2) if k < count - 1 else (1, 0)
        faces += [(a, b, c), (c, b, d)]
    found = find_parts(np.array(points), np.array(faces))
    assert found.one_sided.tolist() == [True] and found.closed.tolist() == [False] and not found.turned.any()
