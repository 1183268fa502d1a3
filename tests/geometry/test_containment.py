"""Point in solid: against the winding number, closed forms, and points on and beside edges and corners."""

from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from replay.errors import InvalidValue
from replay.geometry import primitives
from replay.geometry.closest import distance_to_surface
from replay.geometry.closing import NO_CAPS
from replay.geometry.containment import contains, inside
from replay.geometry.mesh import load_mesh
from replay.geometry.solid import Solid
from replay.geometry.solid_angle import winding_number
from replay.geometry.tree import triangle_tree
from replay.numerics import transforms
from tests.amounts import cases

PHANTOM = Path(find_spec("pyskindose").submodule_search_locations[0]) / "phantom_data/adult_male_reduced_1000t.stl"

SOLIDS = {
    "phantom": lambda: load_mesh(PHANTOM, scale=0.01),
    "ring": lambda: primitives.arc(0.8, 2 * np.pi, 0.2, 0.1, 1e-3),
    "cone": lambda: primitives.cone(0.2, 1.5, 1e-3),
    "needle": lambda: primitives.cylinder(1e-5, 1.0, 1e-7),
}


def near_and_far_points(solid: Solid, rng: np.random.Generator) -> np.ndarray:
    """Points in and around the box, and points just beside corners, edges and faces."""
    lower, upper = solid.triangles.min(axis=(0, 1)), solid.triangles.max(axis=(0, 1))
    spread = upper - lower
    anywhere = rng.uniform(lower - 0.1 * spread, upper + 0.1 * spread, size=(400, 3))
    some = solid.triangles[rng.integers(len(solid.triangles), size=120)]
    corners, edges = some[:, 0], 0.5 * (some[:, 0] + some[:, 1])
    faces = some.mean(axis=1)
    beside = np.concatenate([corners, edges, faces])
    steps = spread.max() * 10.0 ** rng.uniform(-12, -1, size=(len(beside), 1))
    direction = rng.normal(size=beside.shape)
    beside = beside + steps * direction / np.linalg.norm(direction, axis=1)[:, None]
    return np.concatenate([anywhere, beside])


def solid_angle_oracle(solid: Solid, points: np.ndarray) -> np.ndarray:
    """The winding number in extended precision."""
    p = solid.triangles.astype(np.longdouble)[None] - points.astype(np.longdouble)[:, None, None]
    a, b, c = p[:, :, 0], p[:, :, 1], p[:, :, 2]
    la, lb, lc = (np.sqrt(np.sum(x * x, axis=-1)) for x in (a, b, c))
    dot = lambda x, y: np.sum(x * y, axis=-1)  # noqa: E731
    volume = dot(a, np.cross(b, c))
    return np.sum(np.arctan2(volume, la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb), axis=1) / (
        2 * np.longdouble(np.pi)
    )


@pytest.mark.parametrize("name", SOLIDS)
@pytest.mark.parametrize("offset", [0.0, 1e3])
def test_against_winding_number(name: str, offset: float) -> None:
    solid = SOLIDS[name]()
    T = transforms.from_rpy(np.array([0.5, 0.2, -1.0]))
    T[:3, 3] = offset
    solid = solid.transformed(T) if offset else solid
    points = near_and_far_points(solid, np.random.default_rng(7))
    tree = triangle_tree(solid.triangles)
    distance = np.array([distance_to_surface(p, solid.triangles, tree) for p in points])
    clear = distance > 1e-13 * np.abs(solid.triangles).max()
    points = points[clear]
    expected = np.abs(solid_angle_oracle(solid, points)) > 0.5
    assert 0.02 < expected.mean() < 0.98 and clear.mean() > 0.8
    np.testing.assert_array_equal(contains(solid.triangles, points, tree=tree), expected)
    fast = np.array([winding_number(p, solid.triangles) for p in points[:50]])
    np.testing.assert_allclose(np.abs(fast), expected[:50], atol=1e-3)


def test_on_the_surface_is_inside() -> None:
    cube = primitives.cube(1.0)
    grid = np.array(np.meshgrid([-0.5, 0.0, 0.25, 0.5], [-0.5, 0.1, 0.5], [-0.5, 0.3, 0.5])).reshape(3, -1).T
    assert contains(cube.triangles, grid).all()
    beyond = grid * (1 + 1e-12)
    outside = np.abs(beyond).max(axis=1) > 0.5
    np.testing.assert_array_equal(contains(cube.triangles, beyond), ~outside)


def test_cavities_and_overlaps() -> None:
    outer, inner = primitives.cube(2.0).triangles, primitives.cube(1.0).triangles
    shell = np.concatenate([outer, inner[:, ::-1]])
    nested = np.concatenate([outer, inner])
    points = np.array([[0.0, 0.0, 0.0], [0.7, 0.1, 0.2], [1.5, 0.0, 0.0]])
    np.testing.assert_array_equal(contains(shell, points), [False, True, False])
    np.testing.assert_array_equal(contains(nested, points), [True, True, False])


@settings(max_examples=cases(50), deadline=None)
@given(st.integers(0, 2**32), st.floats(-6, 6))
def test_random_tetrahedra(seed: int, exponent: float) -> None:
    rng = np.random.default_rng(seed)
    corners = rng.normal(size=(4, 3)) * 10.0 ** rng.uniform(-3, 0, size=3) * 10.0**exponent
    if np.linalg.det(corners[1:] - corners[0]) < 0:
        corners[[0, 1]] = corners[[1, 0]]
    triangles = corners[np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])]
    weights = rng.dirichlet(np.ones(4), size=50) * 1.5 - 0.125
    assert contains(triangles, weights @ corners).tolist() == (weights.min(axis=1) >= 0).tolist()


def test_distance_to_surface() -> None:
    sphere = primitives.sphere(0.5, 1e-3)
    tree = triangle_tree(sphere.triangles)
    for p in np.random.default_rng(3).normal(size=(200, 3)):
        expected = abs(np.linalg.norm(p) - 0.5)
        assert abs(distance_to_surface(p, sphere.triangles, tree) - expected) <= 1e-3
    cube = primitives.cube(2.0)
    tree = triangle_tree(cube.triangles)
    for p, expected in (((3, 0.5, 0.2), 2.0), ((2, 2, 0.3), 2**0.5), ((2, 2, 2), 3**0.5), ((0.25, 0, 0), 0.75)):
        assert distance_to_surface(np.array(p, dtype=float), cube.triangles, tree) == pytest.approx(expected, rel=1e-15)


def test_bad_input() -> None:
    cube = primitives.cube(1.0)
    for points in (np.zeros(3), np.zeros((2, 2)), np.full((1, 3), np.nan)):
        with pytest.raises(InvalidValue):
            contains(cube.triangles, points)
    assert inside(np.full(3, np.nan), cube.triangles, triangle_tree(cube.triangles), NO_CAPS) == 0
