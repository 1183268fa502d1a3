"""A surface as corners and triangles."""

import numpy as np
import pytest

from replay.geometry.solid import Solid, signed_volume
from replay.numerics import transforms

CORNERS = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 3.0]])
FACES = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]
TETRAHEDRON = CORNERS[FACES]


def test_a_tetrahedron_has_four_vertices_in_order_and_a_sixth_of_its_box():
    solid = Solid(TETRAHEDRON)
    np.testing.assert_array_equal(solid.vertices, CORNERS[[0, 3, 2, 1]])
    assert solid.volume == pytest.approx(1.0, rel=1e-15)
    assert signed_volume(TETRAHEDRON[:, ::-1]) == pytest.approx(-1.0, rel=1e-15)


def test_a_zero_has_no_sign():
    """The same corner is 0.0 in one triangle and -0.0 in another, as after a turn."""
    signed = TETRAHEDRON.copy()
    signed[::2][signed[::2] == 0.0] = -0.0
    found = Solid(signed).vertices
    np.testing.assert_array_equal(found, Solid(TETRAHEDRON).vertices)
    assert not np.signbit(found).any()


@pytest.mark.parametrize("origin", [0.0, 1.0, 1e6, 1e12])
def test_a_volume_does_not_depend_on_the_origin(origin):
    """In the coordinates' own digits: those of the corners are multiples of 2^-12, and exact."""
    moved = TETRAHEDRON + np.array([origin, -origin, 0.5 * origin])
    assert signed_volume(moved) == pytest.approx(1.0, rel=1e-15)


def test_all_of_it_moves():
    solid = Solid(TETRAHEDRON[:3], pieces=(CORNERS,), watertight=False, closing=TETRAHEDRON[3:])
    T = transforms.from_axis_angle(np.array([0.0, 0.0, 1.0]), np.array(np.pi / 2))
    T[:3, 3] = 1.0, 2.0, 3.0
    moved = solid.transformed(T)
    for was, now in ((solid.triangles, moved.triangles), (solid.closing, moved.closing), (CORNERS, moved.pieces[0])):
        expected = np.stack([1.0 - was[..., 1], 2.0 + was[..., 0], 3.0 + was[..., 2]], axis=-1)
        np.testing.assert_allclose(now, expected, rtol=0, atol=1e-15)
    assert not moved.watertight and moved.has_inside and moved.is_convex
