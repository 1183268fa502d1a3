"""Primitive shapes: closed, outward, where they should be, and as close to the true surface as promised."""

import math
from collections import Counter
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from replay.errors import InvalidValue
from replay.geometry import primitives
from replay.geometry.convex import convex_sets, from_pieces
from replay.geometry.solid import Solid, signed_volume
from replay.numerics import transforms
from tests.amounts import cases

E = 1e-3
SHAPES: dict[str, Callable[[], Solid]] = {
    "cuboid": lambda: primitives.cuboid((0.5, 0.4, 1.9)),
    "cube": lambda: primitives.cube(0.3),
    "sphere": lambda: primitives.sphere(0.2, E),
    "coarse sphere": lambda: primitives.sphere(0.2, 1.0),
    "cylinder": lambda: primitives.cylinder(0.2, 1.5, E),
    "cone": lambda: primitives.cone(0.2, 1.5, E),
    "capsule": lambda: primitives.capsule(0.2, 1.5, E),
    "coarse capsule": lambda: primitives.capsule(0.2, 1e-6, 1.0),
    "ellipsoid": lambda: primitives.ellipsoid((0.2, 0.3, 0.05), E),
    "coarse ellipsoid": lambda: primitives.ellipsoid((0.2, 0.3, 1e-4), 1.0),
    "arc": lambda: primitives.arc(0.8, 2.5, 0.2, 0.1, E),
    "short arc": lambda: primitives.arc(0.8, 0.01, 0.2, 0.1, 1.0),
    "ring": lambda: primitives.arc(0.8, 2 * math.pi, 0.2, 0.1, E),
}


def hull_volume(points: np.ndarray) -> float:
    from scipy.spatial import ConvexHull

    return float(ConvexHull(points).volume)


@pytest.mark.parametrize("name", SHAPES)
def test_closed_outward_and_equal_to_its_pieces(name: str) -> None:
    solid = SHAPES[name]()
    edges = Counter()
    for a, b, c in (solid.triangles + 0.0).tolist():
        edges.update([(tuple(a), tuple(b)), (tuple(b), tuple(c)), (tuple(c), tuple(a))])
    assert all(count == 1 and edges[(b, a)] == 1 for (a, b), count in edges.items())
    assert solid.watertight
    assert solid.volume > 0
    assert solid.volume == pytest.approx(sum(hull_volume(piece) for piece in solid.pieces), rel=1e-12)
    corners = {tuple(p) for p in (np.concatenate(solid.pieces) + 0.0).tolist()}
    assert corners <= {tuple(p) for p in solid.vertices.tolist()}
    assert solid.is_convex == (name not in ("arc", "ring"))
    a, b, c = np.moveaxis(solid.triangles, 1, 0)
    assert np.linalg.norm(np.cross(b - a, c - a), axis=1).min() > 0


def test_volumes_tend_to_the_true_ones() -> None:
    assert primitives.cuboid((0.5, 0.4, 1.9)).volume == pytest.approx(0.5 * 0.4 * 1.9, rel=1e-15)
    e = 1e-5
    assert primitives.sphere(0.2, e).volume == pytest.approx(4 / 3 * math.pi * 0.2**3, rel=3 * e / 0.2)
    assert primitives.cylinder(0.2, 1.5, e).volume == pytest.approx(math.pi * 0.2**2 * 1.5, rel=2 * e / 0.2)
    assert primitives.cone(0.2, 1.5, e).volume == pytest.approx(math.pi * 0.2**2 * 0.5, rel=2 * e / 0.2)
    capsule = math.pi * 0.2**2 * 1.5 + 4 / 3 * math.pi * 0.2**3
    assert primitives.capsule(0.2, 1.5, e).volume == pytest.approx(capsule, rel=3 * e / 0.2)
    ellipsoid = 4 / 3 * math.pi * 0.2 * 0.1 * 0.3
    assert primitives.ellipsoid((0.2, 0.1, 0.3), e).volume == pytest.approx(ellipsoid, rel=3 * e / 0.1)
    ring = primitives.arc(0.8, 2 * math.pi, 0.2, 0.1, e)
    assert ring.volume == pytest.approx(2 * math.pi * 0.8 * 0.1 * 0.2, rel=2 * e / 0.8)
    assert primitives.arc(0.8, math.pi, 0.2, 0.1, e).volume == pytest.approx(0.5 * ring.volume, rel=2 * e / 0.8)


lengths = st.floats(-3, 3).map(lambda x: 10.0**x)


def inside_points(solid: Solid) -> np.ndarray:
    weights = np.random.default_rng(0).dirichlet(np.ones(3), size=6)
    weights = np.concatenate([weights, np.eye(3), 0.5 - 0.5 * np.eye(3), np.full((1, 3), 1 / 3)])
    return np.einsum("wk,nkd->nwd", weights, solid.triangles).reshape(-1, 3)


@settings(max_examples=cases(30), deadline=None)
@given(lengths, st.floats(-3, 0).map(lambda x: 10.0**x), st.floats(0.1, 3.0), st.floats(0.01, 2 * math.pi))
def test_chord_error(radius: float, fraction: float, aspect: float, span: float) -> None:
    limit = fraction * radius
    size = radius * (1 + aspect)
    slack = 1e-14 * size

    sphere = primitives.sphere(radius, limit)
    depth = radius - np.linalg.norm(inside_points(sphere), axis=1)
    assert -slack <= depth.min() and depth.max() <= sphere.chord_error + slack
    assert sphere.chord_error <= limit

    capsule = primitives.capsule(radius, aspect * radius, limit)
    points = inside_points(capsule)
    above = np.maximum(np.abs(points[:, 2]) - 0.5 * aspect * radius, 0.0)
    depth = radius - np.hypot(np.hypot(points[:, 0], points[:, 1]), above)
    assert -slack <= depth.min() and depth.max() <= capsule.chord_error + slack
    assert capsule.chord_error <= limit

    radii = radius * np.array([1.0, aspect, 0.5 * aspect]) / max(1.0, aspect)
    ellipsoid = primitives.ellipsoid(radii, limit)
    points = inside_points(ellipsoid)
    reach = np.linalg.norm(points / radii, axis=1)
    assert reach.max() <= 1.0 + 1e-14
    a, b, c = np.moveaxis(ellipsoid.triangles, 1, 0)
    normals = np.cross(b - a, c - a)
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    lifted = points + ellipsoid.chord_error * np.repeat(normals, len(points) // len(normals), axis=0)
    assert (np.linalg.norm(lifted / radii, axis=1) >= 1.0 - 1e-13).all()  # the surface is not further than this
    assert ellipsoid.chord_error <= limit

    cylinder = primitives.cylinder(radius, aspect * radius, limit)
    points = inside_points(cylinder)
    depth = np.minimum(radius - np.hypot(points[:, 0], points[:, 1]), 0.5 * aspect * radius - np.abs(points[:, 2]))
    assert -slack <= depth.min() and depth.max() <= cylinder.chord_error + slack
    assert cylinder.chord_error <= limit

    cone = primitives.cone(radius, aspect * radius, limit)
    points = inside_points(cone)
    slope = math.hypot(1.0, aspect)
    side = ((0.5 * aspect * radius - points[:, 2]) - aspect * np.hypot(points[:, 0], points[:, 1])) / slope
    depth = np.minimum(side, points[:, 2] + 0.5 * aspect * radius)
    assert -slack <= depth.min() and depth.max() <= cone.chord_error + slack
    assert cone.chord_error <= limit

    thickness = 0.4 * radius
    arc = primitives.arc(radius, span, aspect * radius, thickness, limit)
    points = inside_points(arc)
    across = np.hypot(points[:, 0], points[:, 1])
    assert across.max() <= 1.2 * radius + slack
    assert across.min() >= 0.8 * radius - arc.chord_error - slack
    assert np.abs(points[:, 2]).max() <= 0.5 * aspect * radius + slack
    assert np.abs(np.arctan2(points[:, 1], points[:, 0])).max() <= 0.5 * span + 1e-13
    assert arc.chord_error <= limit


def test_placement() -> None:
    plane = primitives.plane((2.0, 3.0))
    assert not plane.watertight and plane.is_convex
    np.testing.assert_array_equal(plane.triangles.min(axis=(0, 1)), [-1, -1.5, 0])
    for a, b, c in plane.triangles:
        assert np.cross(b - a, c - a)[2] > 0
    cone = primitives.cone(1.0, 2.0, E)
    assert cone.triangles[..., 2].max() == 1.0 and cone.triangles[..., 2].min() == -1.0
    top = cone.vertices[cone.vertices[:, 2] == 1.0]
    np.testing.assert_array_equal(top, [[0, 0, 1]])
    arc = primitives.arc(1.0, 1.0, 0.2, 0.1, E)
    np.testing.assert_allclose(arc.triangles[..., 1].max(), -arc.triangles[..., 1].min(), rtol=1e-15)
    assert arc.triangles[..., 0].min() > 0


def test_transformed() -> None:
    T = transforms.from_rpy(np.array([0.3, -0.2, 1.0]))
    T[:3, 3] = [1.0, 2.0, 3.0]
    arc = primitives.arc(0.8, 2.5, 0.2, 0.1, E)
    moved = arc.transformed(T)
    assert moved.volume == pytest.approx(arc.volume, rel=1e-12)
    assert moved.chord_error == arc.chord_error
    np.testing.assert_array_equal(moved.pieces[0], transforms.apply(T, arc.pieces[0]))
    assert moved.triangles.flags.c_contiguous and moved.pieces[0].flags.c_contiguous
    assert signed_volume(moved.triangles[:, ::-1]) == pytest.approx(-arc.volume, rel=1e-12)


@pytest.mark.parametrize(
    "call",
    [
        lambda: primitives.cuboid((1.0, 2.0)),
        lambda: primitives.cuboid((1.0, 2.0, 0.0)),
        lambda: primitives.cube(-1.0),
        lambda: primitives.plane((1.0, math.inf)),
        lambda: primitives.sphere(math.nan, E),
        lambda: primitives.sphere(1.0, 0.0),
        lambda: primitives.sphere(1.0, 1e-9),
        lambda: primitives.cylinder(1.0, 1.0, 1e-15),
        lambda: primitives.cone(1.0, -1.0, E),
        lambda: primitives.capsule(1.0, 0.0, E),
        lambda: primitives.capsule(1.0, 1.0, 1e-9),
        lambda: primitives.ellipsoid((1.0, 2.0), E),
        lambda: primitives.ellipsoid((1.0, -2.0, 1.0), E),
        lambda: primitives.ellipsoid((1.0, 2.0, 1.0), 1e-9),
        lambda: primitives.arc(1.0, 7.0, 0.1, 0.1, E),
        lambda: primitives.arc(1.0, 1.0, 0.1, 2.0, E),
    ],
)
def test_bad_sizes(call: Callable[[], Solid]) -> None:
    with pytest.raises(InvalidValue):
        call()


@pytest.mark.parametrize("name", SHAPES)
def test_convex_sets_cover_the_solid(name: str) -> None:
    solid = SHAPES[name]()
    for pieces in ("exact", "convex", "hull"):
        sets = convex_sets(solid, pieces=pieces)
        count = 1 if pieces == "hull" else len(solid.pieces)
        assert len(sets.first) == count + 1 and sets.first[-1] == len(sets.vertices)
        assert not sets.surface
        for k in range(count):
            vertices = sets.vertices[sets.first[k] : sets.first[k + 1]]
            expected = solid.vertices if pieces == "hull" else solid.pieces[k]
            for direction in np.random.default_rng(k).normal(size=(30, 3)):
                best = np.max(vertices @ direction)
                assert best == pytest.approx(np.max(expected @ direction), rel=1e-14)


@pytest.mark.parametrize(
    "size", [(1.0, 1.0, 1.0), (3.0, 1e-3, 0.2), (1e-9, 2.0, 1.0), (1e150, 1e130, 1e150), (1.0, 2.0)]
)
@pytest.mark.parametrize("turned", [False, True])
def test_corners_that_are_said_to_be_extreme_are(size, turned):
    solid = primitives.cuboid(size) if len(size) == 3 else primitives.plane(size)
    if turned:
        solid = solid.transformed(transforms.from_quaternion(np.array([0.1, 0.7, -0.3, 0.4])))
    assert solid.strictly_convex
    said, found = convex_sets(solid), from_pieces(solid.pieces)
    np.testing.assert_array_equal(said.vertices, found.vertices)
    np.testing.assert_array_equal(said.first, found.first)
