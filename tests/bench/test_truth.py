"""What benchmarks hold to be true, against closed forms and the tests' own references."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from replay.bench import hard_pairs
from replay.bench.inputs import box, ellipsoid, rotations
from replay.bench.truth import placed, proven_distance, signed_distance
from replay.numerics import transforms
from tests.amounts import cases
from tests.collision import reference


def wide(points):
    return np.asarray(points, dtype=np.longdouble)


@pytest.mark.parametrize(
    ("way", "expected"),
    [
        ((3.0, 0.0, 0.0), 1.5),
        ((0.0, -4.0, 0.0), 1.5),
        ((3.0, 4.0, 0.0), math.hypot(1.5, 1.5)),
        ((3.0, 4.0, 6.0), math.sqrt(1.5**2 + 1.5**2 + 2.5**2)),
        ((1.0, 0.0, 0.0), -0.5),
        ((1.25, 2.0, 3.0), -0.25),
        ((0.0, 0.0, 0.0), -1.5),
        ((1.5, 0.0, 0.0), 0.0),
    ],
)
def test_boxes_along_the_axes_have_closed_forms(way, expected):
    a, b = wide(box((1.0, 2.0, 3.0))), wide(box((2.0, 3.0, 4.0)))
    assert signed_distance(a, b + wide(way)) == pytest.approx(expected, abs=1e-17)
    assert signed_distance(b + wide(way), a) == pytest.approx(expected, abs=1e-17)
    T = rotations(np.random.default_rng(1), 1)[0]
    turned = signed_distance(placed(a, T), placed(b + wide(way), T))
    assert turned == pytest.approx(expected, abs=1e-14)


@pytest.mark.parametrize("counts", list(itertools.combinations_with_replacement((3, 4, 6), 2)))
def test_small_bodies_agree_with_the_reference_of_the_tests(counts):
    rng = np.random.default_rng(counts)
    for _ in range(10):
        a, b = (wide(rng.normal(size=(count, 3)) + rng.normal(size=3)) for count in counts)
        assert signed_distance(a, b) == pytest.approx(float(reference.signed_distance(a, b)), abs=1e-16)


def test_a_point_and_a_segment_or_a_triangle_have_closed_forms():
    point = wide([[0.0, 0.0, 2.0]])
    assert signed_distance(point, wide([[3.0, 0, 2]])) == 3.0
    assert signed_distance(point, wide([[-1.0, 0, 0], [1, 0, 0]])) == 2.0
    assert signed_distance(point, wide([[1.0, 0, 0], [4, 0, 0]])) == pytest.approx(math.sqrt(5.0), rel=1e-15)
    assert signed_distance(point, wide([[-1.0, -1, 0], [2, -1, 0], [-1, 2, 0]])) == 2.0
    crossed = wide([[-1.0, 0, 0], [1, 0, 0]]), wide([[0.0, -1, 0.5], [0, 1, 0.5]])
    assert signed_distance(*crossed) == 0.5


def test_proven_bounds_hold_the_distance_of_bodies_of_many_vertices():
    rng = np.random.default_rng(3)
    for k in range(cases(20)):
        a, b = ellipsoid(40, (0.3, 0.5, 0.2)), ellipsoid(60, (0.4, 0.1, 0.6))
        T = rotations(rng, 1)[0]
        T[:3, 3] = rng.normal(size=3) * (2.0 if k % 2 else 0.1)
        low, high = proven_distance(a, b, T)
        assert 0.0 <= low <= high + 1e-15 and high - low < 1e-12
        if k % 2 and low > 0.0:
            few = placed(a, np.eye(4)), placed(b, T)
            along = wide(few[1].mean(axis=0) - few[0].mean(axis=0))
            gap = (few[1] @ along).min() - (few[0] @ along).max()
            assert low >= gap / np.linalg.norm(along.astype(float)) - 1e-12
            assert high <= np.sqrt(((few[0][:, None] - few[1][None]) ** 2).sum(-1)).min() + 1e-12


@pytest.fixture(scope="module")
def pairs():
    return hard_pairs.hard_pairs(18)


def test_every_family_has_as_many_pairs_as_asked_for_and_they_are_the_same_each_time(pairs):
    found = dict(hard_pairs.by_family(pairs))
    assert [*found] == [*hard_pairs.FAMILIES] and all(len(several) == 18 for several in found.values())
    again = hard_pairs.hard_pairs(18)
    for one, other in zip(pairs, again, strict=True):
        np.testing.assert_array_equal(one.T_world_b, other.T_world_b)
        assert (one.distance, one.meets, one.size) == (other.distance, other.meets, other.size)
    other = hard_pairs.hard_pairs(1, seed=4)
    assert not np.array_equal(other[0].T_world_b, pairs[0].T_world_b)
    assert [*dict(hard_pairs.by_family(pairs[:1]))] == [pairs[0].family]


def test_answers_are_those_of_the_reference_of_the_tests(pairs):
    for pair in pairs:
        origin = pair.T_world_a[:3, 3].astype(np.longdouble)
        a = reference.placed(pair.a.vertices, pair.T_world_a, origin)
        b = reference.placed(pair.b.vertices, pair.T_world_b, origin)
        signed = float(reference.signed_distance(a, b))
        assert pair.distance == pytest.approx(max(signed, 0.0), abs=1e-15 * pair.size)
        if abs(signed) > 2e-12 * pair.size:
            assert pair.meets == (signed < 0.0)
        elif abs(signed) < 0.5e-12 * pair.size:
            assert pair.meets is None
        extent = np.abs(pair.a.vertices).max() + np.abs(pair.b.vertices).max()
        assert pair.size == pytest.approx(extent + np.abs(pair.T_world_b - pair.T_world_a)[:3, 3].max())
        for T in (pair.T_world_a, pair.T_world_b):
            np.testing.assert_allclose(T[:3, :3] @ T[:3, :3].T, np.eye(3), rtol=0, atol=1e-14)


def test_families_are_as_hard_as_they_are_called(pairs):
    found = dict(hard_pairs.by_family(pairs))
    for family in ("face to face 1e-1..1e-16", "edge to edge 1e-1..1e-16", "corner to face 1e-1..1e-16"):
        as_far = [abs(p.distance / 10.0 ** -(1 + k) - 1.0) < 1e-3 for k, p in enumerate(found[family][::2])]
        assert sum(as_far) >= 2  # the others pass each other beside the face
        for k, pair in enumerate(found[family][::2]):
            assert pair.distance >= 10.0 ** -(1 + k) * (1.0 - 1e-3) - 1e-14 and pair.meets in (False, None)
        deep = [pair for pair in found[family][1::2] if pair.meets in (True, None)]
        assert len(deep) >= 2 and all(pair.distance == 0.0 for pair in deep)  # and these
    assert all(pair.meets is None and pair.distance == 0.0 for pair in found["touching exactly"])
    assert all(pair.meets for pair in found["concentric"])
    for family in ("slivers", "needles", "scale 1e-9..1e6", "offset to 1e8 m", "sizes 1e2..1e6 apart"):
        assert {pair.meets for pair in found[family]} >= {True, False}
    for pair in found["slivers"]:
        for body in (pair.a, pair.b):
            volume = abs(np.linalg.det(body.vertices[1:] - body.vertices[0])) / 6
            assert len(body.vertices) == 4 and 0.0 < volume < 0.05 * np.ptp(body.vertices, axis=0).max() ** 3
    for pair in found["needles"]:
        for body in (pair.a, pair.b):
            extent = sorted(np.ptp(body.vertices, axis=0))
            assert extent[2] == 1.0 and 1e-7 <= extent[0] <= extent[1] <= 1e-3
    reaches = [np.abs(pair.T_world_a[:3, 3]).max() for pair in found["offset to 1e8 m"]]
    assert 1e6 < max(reaches) < 1e10 and min(reaches) < 100.0
    sizes = [np.abs(pair.a.vertices).max() for pair in found["scale 1e-9..1e6"]]
    assert min(sizes) < 1e-8 and max(sizes) > 1e5
    ratios = [np.ptp(p.a.vertices).max() / np.ptp(p.b.vertices).max() for p in found["sizes 1e2..1e6 apart"]]
    assert min(ratios) > 10.0 and max(ratios) > 1e4
    for pair in found["nearly parallel faces"]:
        turn = transforms.compose(transforms.invert(pair.T_world_a), pair.T_world_b)
        assert 0.0 < abs(turn[1, 2]) < 2e-3 and abs(turn[0, 0] - 1.0) < 1e-12
