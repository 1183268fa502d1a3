"""How often surfaces wind about points: whole numbers for closed ones, known solid angles for parts."""

import math

import numpy as np
import pytest

from replay.geometry.primitives import cuboid
from replay.geometry.solid_angle import winding_number

BOX = cuboid((2.0, 2.0, 2.0)).triangles


@pytest.mark.parametrize("shift", [0.0, 3.0, -7.0])
def test_closed_surfaces_wind_once_about_what_is_inside(shift):
    rng = np.random.default_rng(4)
    for point in rng.uniform(-1.9, 1.9, (40, 3)):
        inside = bool((np.abs(point) < 1.0).all())
        if np.abs(np.abs(point) - 1.0).min() < 1e-3:
            continue
        assert winding_number(point + shift, BOX + shift) == pytest.approx(float(inside), abs=1e-12)
        assert winding_number(point + shift, BOX[:, ::-1] + shift) == pytest.approx(-float(inside), abs=1e-12)
        assert winding_number(point, np.concatenate([BOX, 1.5 * BOX])) == pytest.approx(
            float(inside) + (np.abs(point) < 1.5).all(), abs=1e-12
        )


def test_a_face_of_a_cube_is_a_sixth_of_all_directions_from_its_middle():
    for axis in range(3):
        for side in (-1.0, 1.0):
            face = BOX[(BOX[:, :, axis] == side).all(axis=1)]
            assert len(face) == 2
            assert winding_number(np.zeros(3), face) == pytest.approx(1.0 / 6.0, rel=1e-14)
            # from straight above at height h: 4 atan(1 / (h sqrt(h^2 + 2))) of 4 pi, seen from outside
            point = np.zeros(3)
            point[axis] = 3.0 * side
            expected = -4.0 * math.atan(1.0 / (2.0 * math.sqrt(6.0))) / (4.0 * math.pi)
            assert winding_number(point, face) == pytest.approx(expected, rel=1e-13)


def test_an_octant_is_an_eighth():
    for signs in np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).T.reshape(-1, 3):
        triangle = np.diag(signs.astype(float))[None]
        assert winding_number(np.zeros(3), triangle) == pytest.approx(np.prod(signs) / 8.0, rel=1e-15)
    assert winding_number(np.zeros(3), np.empty((0, 3, 3))) == 0.0
