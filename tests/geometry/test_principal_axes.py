"""Covariances against closed forms and other sums, eigenvectors against LAPACK."""

from __future__ import annotations

import numpy as np
import pytest

from replay.geometry import primitives
from replay.geometry.principal_axes import covariance_of_points, covariance_of_triangles, eigen
from replay.numerics import transforms
from tests.amounts import cases


def test_points_have_the_covariance_that_numpy_finds():
    rng = np.random.default_rng(1)
    for count in (1, 2, 7, 100):
        points = rng.normal(size=(count, 3)) @ rng.normal(size=(3, 3)) + (1.0, -20.0, 3.0)
        expected = np.cov(points.T, bias=True) if count > 1 else np.zeros((3, 3))
        np.testing.assert_allclose(covariance_of_points(points), expected, rtol=1e-11, atol=1e-14)


@pytest.mark.parametrize("turn", [(0, 0, 0, 1), (0.3, -0.5, 0.2, 0.7)])
def test_the_surface_of_a_cuboid_has_its_closed_form(turn):
    """Of sides a b c about the centre along x: faces across x at a^2/4, the others' own a^2/12."""
    a, b, c = sides = (1.0, 2.0, 3.0)
    faces = 2 * np.array([b * c, a * c, a * b])
    squares = np.array(sides) ** 2
    along = [(faces[i] * squares[i] / 4 + (faces.sum() - faces[i]) * squares[i] / 12) / faces.sum() for i in range(3)]
    T = transforms.from_quaternion(np.array(turn, dtype=float))
    T[:3, 3] = (100.0, -50.0, 7.0)
    area, covariance = covariance_of_triangles(primitives.cuboid(sides).transformed(T).triangles)
    assert area == pytest.approx(22.0, rel=1e-14)
    np.testing.assert_allclose(covariance, T[:3, :3] @ np.diag(along) @ T[:3, :3].T, rtol=0, atol=1e-12)


def test_it_does_not_matter_how_a_surface_is_cut_into_triangles():
    rng = np.random.default_rng(2)
    for _ in range(20):
        triangles = rng.normal(size=(5, 3, 3))
        share = rng.dirichlet((1, 1, 1), size=5)
        inner = np.einsum("ki,kij->kj", share, triangles)
        cut = np.concatenate([np.stack([triangles[:, i], triangles[:, (i + 1) % 3], inner], axis=1) for i in range(3)])
        whole, parts = covariance_of_triangles(triangles), covariance_of_triangles(np.ascontiguousarray(cut))
        assert parts[0] == pytest.approx(whole[0], rel=1e-12)
        np.testing.assert_allclose(parts[1], whole[1], rtol=1e-10, atol=1e-13)


def test_what_has_no_area_has_no_covariance():
    area, covariance = covariance_of_triangles(np.array([[[0.0, 0, 0], [1, 0, 0], [2, 0, 0]]]))
    assert area == 0.0 and not covariance.any()
    area, covariance = covariance_of_triangles(np.zeros((0, 3, 3)))
    assert area == 0.0 and not covariance.any()


@pytest.mark.parametrize("scale", [1e-12, 1.0, 1e12])
def test_eigenvectors_are_those_of_lapack_and_a_rotation(scale):
    rng = np.random.default_rng(3)
    for _ in range(cases(200)):
        root = rng.normal(size=(3, 3)) * 10.0 ** rng.uniform(-3, 0, size=3)
        matrix = scale * (root @ root.T)
        matrix = 0.5 * (matrix + matrix.T)
        values, vectors = eigen(matrix)
        largest = np.abs(values).max()
        np.testing.assert_allclose(values, np.linalg.eigvalsh(matrix), rtol=0, atol=1e-14 * largest)
        np.testing.assert_allclose(vectors @ matrix, values[:, None] * vectors, rtol=0, atol=1e-14 * largest)
        np.testing.assert_allclose(vectors @ vectors.T, np.eye(3), rtol=0, atol=1e-14)


@pytest.mark.parametrize(
    ("matrix", "values"),
    [
        (np.zeros((3, 3)), (0, 0, 0)),
        (np.eye(3), (1, 1, 1)),
        (np.diag([3.0, 1.0, 2.0]), (1, 2, 3)),
        (np.diag([1.0, 3.0, 1.0]), (1, 1, 3)),
        (np.array([[0.0, 1, 0], [1, 0, 0], [0, 0, 0]]), (-1, 0, 1)),
        (np.array([[2.0, 0, 1], [0, 5, 0], [1, 0, 2]]), (1, 3, 5)),
        (np.ones((3, 3)), (0, 0, 3)),
    ],
)
def test_values_are_in_order_also_where_they_repeat(matrix, values):
    found, vectors = eigen(np.array(matrix, dtype=float))
    np.testing.assert_allclose(found, values, rtol=0, atol=1e-15)
    np.testing.assert_allclose(vectors @ matrix @ vectors.T, np.diag(values), rtol=0, atol=1e-14)
    np.testing.assert_allclose(vectors @ vectors.T, np.eye(3), rtol=0, atol=1e-15)
