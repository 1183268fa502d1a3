"""Distances to boxes, triangles and surfaces: cases with known answers, and a search that knows points only."""

import itertools
import math

import numpy as np
import pytest

from replay.geometry.closest import (
    distance_to_surface,
    nearest_triangle,
    squared_distance_to_box,
    squared_distance_to_triangle,
)
from replay.geometry.tree import triangle_tree
from tests.amounts import cases

RIGHT = np.array([[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 3.0, 0.0]])


@pytest.mark.parametrize(
    ("point", "square"),
    [
        ((1.0, 1.0, 2.0), 4.0),  # before the face
        ((1.0, 1.0, -2.0), 4.0),
        ((1.0, 1.0, 0.0), 0.0),
        ((2.0, -3.0, 4.0), 25.0),  # each edge
        ((-3.0, 1.0, 4.0), 25.0),
        ((2.0 + 3.0, 1.5 + 4.0, 0.0), 25.0),
        ((2.0 + 3.0, 1.5 + 4.0, 12.0), 169.0),
        ((-1.0, -2.0, 2.0), 9.0),  # each corner
        ((6.0, -1.0, 2.0), 9.0),
        ((-1.0, 5.0, 2.0), 9.0),
    ],
)
def test_the_nearest_part_of_a_triangle_is_its_face_an_edge_or_a_corner(point, square):
    for order in itertools.permutations(range(3)):
        for shift in ([0.0, 0.0, 0.0], [8.0, -4.0, 2.0]):
            triangle = RIGHT[list(order)] + shift
            assert squared_distance_to_triangle(np.array(point) + shift, triangle) == pytest.approx(square, abs=1e-14)
            turned = np.roll(triangle, 1, axis=1)
            moved = np.roll(np.array(point) + shift, 1)
            assert squared_distance_to_triangle(moved, turned) == pytest.approx(square, abs=1e-14)


@pytest.mark.parametrize(
    ("flat", "square"),
    [
        ([[0, 0, 0], [2, 0, 0], [5, 0, 0]], 9.0),
        ([[5, 0, 0], [0, 0, 0], [2, 0, 0]], 9.0),
        ([[0, 0, 0], [0, 0, 0], [0, 0, 0]], 18.0),
        ([[1, 3, 1], [1, 3, 1], [9, 3, 1]], 1.0),
    ],
)
def test_a_triangle_without_area_is_its_edges(flat, square):
    assert squared_distance_to_triangle(np.array([3.0, 3.0, 0.0]), np.array(flat, dtype=float)) == square


def test_no_point_of_a_triangle_is_nearer_and_some_is_as_near():
    rng = np.random.default_rng(2)
    grid = [(i, j, 40 - i - j) for i in range(41) for j in range(41 - i)]
    weights = np.array(grid) / 40.0
    for _ in range(cases(300)):
        triangle, point = rng.normal(size=(3, 3)), 2.0 * rng.normal(size=3)
        found = math.sqrt(squared_distance_to_triangle(point, triangle))
        sampled = np.linalg.norm(weights @ triangle - point, axis=1).min()
        longest = max(np.linalg.norm(a - b) for a, b in itertools.combinations(triangle, 2))
        assert found <= sampled + 1e-14
        assert sampled <= found + longest / 40.0


@pytest.mark.parametrize(
    ("point", "square"),
    [
        ((0.5, 1.0, 1.5), 0.0),
        ((1.0, 2.0, 3.0), 0.0),
        ((-3.0, 1.0, 1.0), 9.0),
        ((4.0, 1.0, 1.0), 9.0),
        ((0.5, -2.0, 1.0), 4.0),
        ((0.5, 6.0, 1.0), 16.0),
        ((0.5, 1.0, -1.0), 1.0),
        ((0.5, 1.0, 8.0), 25.0),
        ((2.0, 4.0, 5.0), 9.0),
        ((-2.0, -1.0, -2.0), 9.0),
    ],
)
def test_a_box_is_as_far_as_its_gaps(point, square):
    lower, upper = np.zeros(3), np.array([1.0, 2.0, 3.0])
    assert squared_distance_to_box(np.array(point), lower, upper) == square


def test_the_tree_finds_the_nearest_of_all_triangles():
    rng = np.random.default_rng(3)
    for count in (1, 2, 7, 60):
        triangles = rng.normal(size=(count, 1, 3)) + 0.3 * rng.normal(size=(count, 3, 3))
        tree = triangle_tree(triangles)
        for _ in range(cases(100)):
            point = 1.5 * rng.normal(size=3)
            every = [squared_distance_to_triangle(point, triangle) for triangle in triangles]
            distance, index = nearest_triangle(point, triangles, tree)
            assert distance == math.sqrt(min(every)) == distance_to_surface(point, triangles, tree)
            assert index == np.argmin(every)
