"""Boxes in single precision around pieces of a surface: what they hold, and how small they are."""

from __future__ import annotations

import numpy as np
import pytest

from replay.geometry import primitives
from replay.geometry.principal_axes import covariance_of_triangles, eigen
from replay.geometry.surface_boxes import AXES, BOX, CENTRE, HALVES, SHORT, fit_boxes
from replay.geometry.tree import triangle_tree
from replay.numerics import transforms


def boxes_of(triangles, middle=(0.0, 0.0, 0.0), leaf=4):
    tree = triangle_tree(triangles, leaf_size=leaf)
    ordered = np.ascontiguousarray(triangles[tree.order])
    nodes = np.arange(len(tree.second))
    return tree, ordered, fit_boxes(tree, ordered, nodes, np.array(middle)).astype(np.float64)


def turned(triangles, far):
    T = transforms.from_quaternion(np.array([0.3, -0.5, 0.2, 0.7]))
    T[:3, 3] = far
    return np.ascontiguousarray(transforms.apply(T, triangles))


BODIES = {
    "ball": primitives.sphere(0.5, 0.02).triangles,
    "rod": primitives.cylinder(0.05, 2.0, 0.005).triangles,
    "cube": primitives.cube(1.0).triangles,
    "one triangle": np.array([[[0.0, 0, 0], [1, 0.1, 0], [0.2, 0.7, 0.4]]]),
    "a needle": np.array([[[0.0, 0, 0], [1, 1, 1], [2, 2, 2]]]),
    "a point": np.array([[[0.3, 0.2, 0.1]] * 3]),
}


@pytest.mark.parametrize("far", [(0.0, 0.0, 0.0), (300.0, -20.0, 5.0)])
@pytest.mark.parametrize("name", BODIES)
def test_a_box_holds_its_surface_and_is_hardly_larger_than_that(name, far):
    triangles = turned(BODIES[name], far)
    tree, ordered, boxes = boxes_of(triangles, far)
    assert boxes.shape == (len(tree.second), BOX)
    for node, box in enumerate(boxes):
        points = ordered[tree.begin[node] : tree.end[node]].reshape(-1, 3) - far
        axes, halves = box[AXES:HALVES].reshape(3, 3), box[HALVES:]
        along = (points - box[CENTRE:AXES]) @ axes.T
        assert (np.abs(along) <= halves).all() and (halves > 0.0).all()
        most = np.abs(along).max(axis=0)
        size = np.ptp(points, axis=0).max() + np.linalg.norm(far) * 1e-9
        assert (halves <= most + 1e-5 * (size + most.sum()) + 1e-30).all()
        np.testing.assert_allclose(axes @ axes.T, np.eye(3), rtol=0, atol=SHORT)


def test_a_box_lies_along_the_principal_axes_of_its_piece_unless_an_upright_one_is_as_small():
    triangles = turned(primitives.cuboid((0.2, 1.0, 3.0)).triangles, (0.0, 0.0, 0.0))
    tree, ordered, boxes = boxes_of(triangles)
    seen = 0
    for node, box in enumerate(boxes):
        piece = ordered[tree.begin[node] : tree.end[node]]
        axes, halves = box[AXES:HALVES].reshape(3, 3), box[HALVES:]
        vectors = eigen(covariance_of_triangles(np.ascontiguousarray(piece))[1])[1]
        extent = np.ptp(piece.reshape(-1, 3) @ vectors.T, axis=0)
        upright = np.ptp(piece.reshape(-1, 3), axis=0)

        def area(x):
            return x[0] * x[1] + x[1] * x[2] + x[2] * x[0]

        if area(extent) < area(upright) * (1 - 1e-6):
            seen += 1
            np.testing.assert_allclose(np.abs(np.sum(axes * vectors, axis=1)), 1.0, rtol=0, atol=1e-6)
            np.testing.assert_allclose(2 * halves, extent, rtol=1e-5, atol=1e-5)
        elif area(extent) > area(upright) * (1 + 1e-6):
            np.testing.assert_array_equal(axes, np.eye(3))
            np.testing.assert_allclose(2 * halves, upright, rtol=1e-5, atol=1e-5)
    assert seen > 1
    whole = boxes[0]
    np.testing.assert_allclose(2 * whole[HALVES:], (0.2, 1.0, 3.0), rtol=1e-4)
    np.testing.assert_allclose(whole[CENTRE:AXES], 0.0, rtol=0, atol=1e-6)
    upright = boxes_of(primitives.cuboid((0.2, 1.0, 3.0)).triangles)[2][0]
    np.testing.assert_array_equal(upright[AXES:HALVES], np.eye(3).ravel())
