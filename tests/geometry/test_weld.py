"""Corners that rounding has parted."""

import numpy as np
import pytest

from replay.geometry import primitives
from replay.geometry.containment import contains
from replay.geometry.mesh import solid_from_triangles


@pytest.mark.parametrize("step", [1e-17, 1e-15, 1e-12, 1e-9, 4e-7])
@pytest.mark.parametrize("size", [1e-3, 1.0, 1e4])
def test_corners_parted_by_rounding_are_one(step: float, size: float) -> None:
    # 20 of 90 open public meshes were open only by it, and a ball in the middle of a cube was not seen
    cube = primitives.cube(1.0).triangles + 0.5
    rng = np.random.default_rng(8)
    parted = size * (cube + step * rng.choice([0.0, 0.0, 1.0], cube.shape))
    solid = solid_from_triangles(parted)
    assert solid.watertight and solid.volume == pytest.approx(size**3, rel=1e-5)
    assert contains(solid.triangles, size * np.array([[0.5, 0.5, 0.5], [1.5, 0.5, 0.5]])).tolist() == [True, False]
    if not np.array_equal(parted, size * cube):
        assert "were taken for it, which closed" in solid.notes[0]


def test_features_are_not_welded_away() -> None:
    cube = primitives.cube(1.0).triangles
    sheets = np.concatenate([cube[:2], cube[:2] + np.array([0.0, 0.0, 1e-7])])  # two walls of a thin gap
    crumb = np.concatenate([cube[2:], 1e-7 * cube[2:] + np.array([2.0, 0.0, 0.0])])  # an open body of 0.1 um
    plate = primitives.cuboid((1.0, 1.0, 1e-7)).triangles[1:]
    strip = np.array([[[x, 0, 0], [x + 1e-7, 0, 0], [x, 1e-7, 0]] for x in 1e-7 * np.arange(50.0)])
    for mesh in (sheets, crumb, plate, np.concatenate([cube[:2], strip])):
        solid = solid_from_triangles(mesh)
        np.testing.assert_array_equal(np.sort(solid.triangles.ravel()), np.sort(mesh.ravel()))
        assert not any("taken for" in note for note in solid.notes)
    apart = np.concatenate([cube[:2], cube[:2] + np.array([1.0 + 1e-5, 0.0, 0.0])])  # 1e-5 is no rounding
    assert "8 edges are open" in solid_from_triangles(apart).notes[0]
