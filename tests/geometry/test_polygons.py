"""Polygons to triangles: they cover it once, in its sense, by its own corners and edges."""

from __future__ import annotations

import itertools
import math
from collections import Counter

import numpy as np
import pytest

from replay.geometry.polygons import triangulate
from replay.numerics import transforms

STAR = [
    (math.cos(math.pi * k / 5) * (1.0, 0.4)[k % 2], math.sin(math.pi * k / 5) * (1.0, 0.4)[k % 2]) for k in range(10)
]
POLYGONS = {
    "triangle": [(0, 0), (1, 0), (0, 1)],
    "square": [(0, 0), (1, 0), (1, 1), (0, 1)],
    "arrow": [(0, 0), (2, 1), (0, 2), (0.5, 1)],
    "arrow from its notch": [(0.5, 1), (0, 0), (2, 1), (0, 2)],
    "corners on an edge": [(0, 0), (1, 0), (2, 0), (3, 0), (3, 1), (0, 1)],
    "fold on an edge": [(0, 0), (1, 0), (2, 0), (2, 2), (1, 0.5), (0, 2)],
    "star": STAR,
    "comb": [(0, 0), (5, 0), (5, 2), (4, 2), (4, 1), (3, 1), (3, 2), (2, 2), (2, 1), (1, 1), (1, 2), (0, 2)],
}
WAYS = [(0, 0, 0, 1), (1, 0, 0, 0), (0.3, -0.5, 0.2, 0.7), (0.5, 0.5, 0.5, 0.5)]


def area(points, faces):
    """The sum of the area vectors, and of the areas."""
    normals = 0.5 * np.cross(points[faces[:, 1]] - points[faces[:, 0]], points[faces[:, 2]] - points[faces[:, 0]])
    return normals.sum(axis=0), float(np.linalg.norm(normals, axis=1).sum())


@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e6])
@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("name", POLYGONS)
def test_triangles_cover_a_polygon_once_in_its_own_sense(name, way, scale):
    flat = np.array([(x, y, 0.0) for x, y in POLYGONS[name]])
    T = transforms.from_quaternion(np.array(way, dtype=float))
    T[:3, 3] = (3.0, -2.0, 1.0)
    points = scale * transforms.apply(T, flat)
    x, y = flat[:, 0], flat[:, 1]
    true = 0.5 * float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))
    count = len(points)
    for turn in range(count):
        for sense in (1, -1):
            polygon = np.roll(np.arange(count), turn)[::sense]
            faces = triangulate(points, polygon, [count])
            assert len(faces) == count - 2
            vector, total = area(points, faces)
            np.testing.assert_allclose(vector, sense * true * scale**2 * T[:3, 2], rtol=0, atol=1e-9 * scale**2)
            assert total == pytest.approx(abs(true) * scale**2, rel=1e-9)
            walked = Counter((int(a), int(b)) for face in faces for a, b in zip(face, np.roll(face, -1), strict=True))
            border = {(int(a), int(b)) for a, b in zip(polygon, np.roll(polygon, -1), strict=True)}
            assert {side for side in walked if (side[1], side[0]) not in walked} == border
            assert max(walked.values()) == 1


@pytest.mark.parametrize("name", ["square", "arrow", "star", "comb"])
def test_a_face_that_is_there_twice_has_the_same_diagonals(name):
    """Once from each side, or in the same sense, from any corner: else the wall between two bodies would be two."""
    points = np.array([(x, y, 0.0) for x, y in POLYGONS[name]])
    count = len(points)
    for turn, sense in itertools.product(range(count), (1, -1)):
        again = np.roll(np.arange(count), turn)[::sense]
        faces = triangulate(points, [*range(count), *again], [count, count])
        first, second = faces[: count - 2], faces[count - 2 :]
        assert {frozenset(face) for face in first.tolist()} == {frozenset(face) for face in second.tolist()}
        np.testing.assert_allclose(area(points, second)[0], sense * area(points, first)[0], rtol=0, atol=1e-12)


def test_corners_that_are_the_same_place_are_the_same_corner_of_a_face_that_is_there_twice():
    square = np.array([(0.0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)])
    faces = triangulate(np.concatenate([square, square]), [0, 1, 2, 3, 7, 6, 5, 4], [4, 4])
    assert {frozenset(face) for face in faces[:2].tolist()} == {
        frozenset(f % 4 for f in face) for face in faces[2:].tolist()
    }
    assert set(faces[2:].ravel().tolist()) == {4, 5, 6, 7}


def test_polygons_are_split_in_their_order_and_triangles_alone_are_left_as_they_are():
    points = np.array([(x, y, 0.0) for x, y in POLYGONS["comb"]])
    faces = triangulate(points, [0, 1, 2, 0, 1, 2, 11, 5, 4, 3], [3, 4, 3])
    assert faces[[0, 3]].tolist() == [[0, 1, 2], [5, 4, 3]]
    assert triangulate(points, [9, 1, 2, 2, 1, 0], [3, 3]).tolist() == [[9, 1, 2], [2, 1, 0]]
    assert triangulate(points, [], []).shape == (0, 3)


def test_a_polygon_without_extent_is_left_to_who_checks_triangles():
    faces = triangulate(np.zeros((5, 3)), [0, 1, 2, 3, 4], [5])
    assert len(faces) >= 1 and set(faces.ravel().tolist()) <= set(range(5))


def test_a_polygon_that_crosses_itself_is_split_or_told():
    rng = np.random.default_rng(1)
    told = 0
    for _ in range(200):
        count = int(rng.integers(5, 9))
        points = np.column_stack([rng.normal(size=(count, 2)), np.zeros(count)])
        try:
            faces = triangulate(points, [*range(count)], [count])
        except ValueError as error:
            told += 1
            assert f"a polygon of {count} corners crosses itself" in str(error)
        else:
            assert faces.min() >= 0 and faces.max() < count and len(faces) <= 3 * count
    assert told < 200
