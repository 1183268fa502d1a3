"""What touches a plate: infinite when more than a point is shared, else the closed form."""

import itertools
import math

import numpy as np
import pytest

from replay.sensing.capacitive import plate_integral
from replay.sensing.capacitive.contact import CLEAR, SATURATED, TOUCHING, contact
from tests.amounts import cases
from tests.sensing.capacitive import plate_reference

_CONTACTS = {
    # name: (corners in units of the half sizes, front is infinite, both is infinite)
    "coplanar on the plate": ([[-0.5, -0.5, 0], [0.5, -0.5, 0], [0, 0.5, 0]], False, True),
    "coplanar around the plate": ([[-9, -9, 0], [9, -9, 0], [0, 9, 0]], False, True),
    "coplanar beside": ([[2, 0, 0], [3, 1, 0], [3, -1, 0]], False, False),
    "coplanar, edge on the plate's edge": ([[1, 0.5, 0], [1, -0.5, 0], [3, 0, 0]], False, True),
    "coplanar, edge beyond the plate's edge": ([[1, 5, 0], [1, 2, 0], [3, 0, 0]], False, False),
    "coplanar, corner on the plate's edge": ([[1, 0.5, 0], [2, 1, 0], [2, -1, 0]], False, False),
    "coplanar, corner on corner": ([[1, 1, 0], [2, 1.5, 0], [2, 3, 0]], False, False),
    "coplanar, edge through the plate's corner": ([[2, 0, 0], [0, 2, 0], [3, 3, 0]], False, False),
    "slanted, edge on the plate's edge": ([[1, 0.5, 0], [1, -0.5, 0], [3, 0, 2]], True, True),
    "upright, edge on the plate's edge": ([[1, 0.5, 0], [1, -0.5, 0], [1, 0, 2]], True, True),
    "upright, edge beyond the plate's edge": ([[1, 5, 0], [1, 2, 0], [1, 0, 2]], False, False),
    "slanted, edge on the plate": ([[-0.5, 0, 0], [0.5, 0, 0], [0, 0.5, 1]], True, True),
    "slanted, edge through the plate's corner": ([[2, 0, 0], [0, 2, 0], [3, 3, 1]], False, False),
    "below, edge on the plate": ([[-0.5, 0, 0], [0.5, 0, 0], [0, 0.5, -1]], False, True),
    "corner on the plate": ([[0.2, 0.1, 0], [0.5, 0, 1], [0, 0.5, 1]], False, False),
    "corner on the plate's corner": ([[1, 1, 0], [2, 0, 1], [0, 2, 1]], False, False),
    "corner on the plate's edge": ([[1, 0.3, 0], [2, 0, 1], [0, 2, 1]], False, False),
    "crossing through the plate": ([[0, 0, -1], [0.3, 0, 1], [0, 0.3, 1]], True, True),
    "crossing along the plate, beside it": ([[-30, 2, -1], [-30, 2, 2], [40, 2.1, 0.5]], False, False),
    "crossing along the plate, through it": ([[-30, 0.1, -1], [-30, 0.1, 2], [40, -0.1, 0.5]], True, True),
    "crossing through the plate's border line": ([[1, 0.5, -1], [1, 0.5, 1], [1, -0.5, 1]], True, True),
    "crossing on the border line beside the edge": ([[1, 2, -1], [1, 2, 1], [1, 4, 1]], False, False),
    "crossing beside": ([[2, 0, -1], [2, 0.3, 1], [2.5, 0.3, 1]], False, False),
    "crossing at the plate's corner only": ([[2, 0, -1], [2, 0, 1], [0, 2, 0.0]], False, False),
    "crossing through a corner of its own": ([[0.2, 0.1, 0], [0.5, 0, 1], [0, 0.5, -1]], True, True),
    "no area, through the plate": ([[0, 0, -1], [0, 0, 1], [0, 0, 2]], False, False),
}


@pytest.mark.parametrize("name", _CONTACTS)
@pytest.mark.parametrize("method", ["exact", "midpoint"])
def test_the_integral_is_infinite_exactly_when_more_than_one_point_is_shared(name, method):
    corners, front, both = _CONTACTS[name]
    for half in ([0.05, 0.03], [0.1, 0.7], [1 / 3, 1e-3]):
        rng = np.random.default_rng(1)
        for _ in range(3):
            triangle = (np.array(corners, dtype=float) * [*half, 0.3])[rng.permutation(3)]
            for side, expected in (("front", front), ("both", both)):
                value = plate_integral([triangle], half, side=side, method=method)[0]
                assert math.isinf(value) == expected
                assert value >= 0.0


@pytest.mark.parametrize("order", list(itertools.permutations(range(3))))
def test_a_triangle_around_the_plate_saturates_it_in_either_winding(order):
    # no edge of it runs through the plate: only the turn about the plate's centre tells
    for corners in ([[-9, -9, 0], [9, -9, 0], [0, 9, 0]], [[-5, -3, 0], [4, -4, 0], [1, 7, 0]]):
        for half in ([0.05, 0.03], [1 / 3, 1e-3], [1e-4, 2.0]):
            triangle = np.array(corners, dtype=float)[list(order)] * [*half, 1.0]
            assert plate_integral([triangle], half, side="both")[0] == math.inf
            assert plate_integral([triangle], half, side="front")[0] == 0.0
            assert [contact(triangle, *half, both) for both in (True, False)] == [SATURATED, TOUCHING]
            beside = triangle + np.array([20.0 * half[0], 0.0, 0.0])
            assert [contact(beside, *half, both) for both in (True, False)] == [CLEAR, CLEAR]
            assert 0.0 < plate_integral([beside], half, side="both")[0] < math.inf


def test_finite_integrals_of_touching_triangles_have_their_closed_form():
    # a corner on the plate's edge, coplanar beside it: width w(u) = 2 u / 3, integral of w/u over 0..3 is 2
    triangle = [[0.05, 0.0, 0.0], [3.05, 1.0, 0.0], [3.05, -1.0, 0.0]]
    assert plate_integral([triangle], [0.05, 2.0], side="both")[0] == pytest.approx(2.0, rel=1e-14)
    # a corner on the plate, standing on it: width w(z) = z, integral of w/z over 0..1 is 1, area element 1
    triangle = [[0.0, 0.0, 0.0], [-0.5, 0.0, 1.0], [0.5, 0.0, 1.0]]
    assert plate_integral([triangle], [2.0, 2.0])[0] == pytest.approx(1.0, rel=1e-15)


@pytest.mark.parametrize(
    ("triangle", "half", "front", "both"),
    [
        (
            [[0.25, 0.5, 0.1], [0.125, 0.125, -0.2], [0.75, -0.75, 0.2]],
            [0.25, 0.25],
            1.2886099166071073,
            2.7241843872173113,
        ),
        (
            [
                [-0.031090443827747203, 0.2600105211271745, 0.05],
                [0.062180887655494406, 0.0, 0.0],
                [0.062180887655494406, 0.2600105211271745, -0.1],
            ],
            [0.031090443827747203, 0.13000526056358724],
            0.32767544733799958,
            0.71454183033816538,
        ),
    ],
)
def test_crossing_the_plate_at_its_corner_alone_is_finite(triangle, half, front, both):
    for order in ([0, 1, 2], [1, 2, 0], [2, 1, 0]):
        turned = [np.array(triangle)[order]]
        assert plate_integral(turned, half)[0] == pytest.approx(front, rel=1e-14)
        assert plate_integral(turned, half, side="both")[0] == pytest.approx(both, rel=1e-14)


@pytest.mark.parametrize(
    ("triangle", "half"),
    [
        ([[-1.53125, 0.671875, 2.1875], [-0.015625, 0.15625, -3.390625], [0.09375, 1.390625, -1.25]], [0.75, 0.75]),
        ([[-0.3125, 0.640625, 0.328125], [-1.15625, -0.234375, 1.984375], [0.71875, -0.25, -3.65625]], [0.25, 0.5]),
        (
            [
                [1.8657951909689776, 0.9388167443879842, -4.53093533974298],
                [-1.311194650887622, -0.9745611068913507, -0.7400993680111864],
                [-1.5278000975253345, 1.1263059204086376, 6.2123180538019165],
            ],
            [1 / 3, 0.25],
        ),
    ],
)
@pytest.mark.parametrize("side", ["front", "both"])
def test_a_crumb_that_rounding_leaves_at_the_plate_s_corner_has_no_integral(triangle, half, side):
    # it is 1e-18 of the triangle and is cut off where the plate begins, so that its own mean is infinite
    expected = float(plate_reference.plate_integral(triangle, half, side))
    for order in itertools.permutations(range(3)):
        value = plate_integral([np.array(triangle)[list(order)]], half, side=side)[0]
        assert value == pytest.approx(expected, rel=1e-13)


def test_corners_on_one_line_through_the_plate_have_no_integral():
    corners = [[0.041666666666666664, 0.0375, 0.0], [-0.08333333333333333, 0.15, 0.0], [0.08333333333333333, 0.0, 0.0]]
    for method in ("exact", "midpoint"):
        assert plate_integral([corners], [0.08333333333333333, 0.075], side="both", method=method)[0] == 0.0


def test_triangles_through_the_plate_s_corner_or_just_beside_it():
    rng = np.random.default_rng(8)
    one_point = 0
    for k in range(cases(120)):
        half = rng.choice([0.25, 0.5, 0.75, 3.0], 2)
        signs = rng.choice([-1, 1], 2)
        corner, slope = half * signs, signs * rng.integers(1, 4, 2)
        offsets = rng.integers(-64, 65, (3, 2)) / 64.0
        triangle = np.column_stack([corner + offsets, offsets @ slope])
        if k % 2:
            place = tuple(rng.integers(0, 3, 2))
            triangle[place] = np.nextafter(triangle[place], rng.choice([-9.0, 9.0]))
        touches, infinite = plate_reference.contact(triangle.tolist(), half.tolist())
        one_point += touches and not infinite
        value = plate_integral([triangle], half, side="both")[0]
        assert math.isinf(value) == infinite
        if not infinite:
            expected = plate_reference.plate_integral(triangle.tolist(), half.tolist(), "both")
            assert plate_reference.error(value, expected) <= plate_reference.TOLERANCE, (
                triangle.tolist(),
                half.tolist(),
            )
    assert one_point > 8
