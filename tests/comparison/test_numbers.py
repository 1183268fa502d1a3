"""Numbers and rotations against tolerances, by definition and by an independent method."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from replay.comparison.numbers import compare_numbers, compare_rotations
from replay.comparison.rules import Tolerance
from replay.numerics import transforms

doubles = st.floats(allow_nan=True, allow_infinity=True)
bounds = st.sampled_from([0.0, 1e-300, 1e-9, 1e-3, 1.0, 1e300, math.inf])


@given(doubles, doubles, bounds, bounds)
def test_tolerances_mean_what_they_say(a, b, absolute, relative):
    found = compare_numbers(np.array([a]), np.array([b]), Tolerance(abs=absolute, rel=relative))
    if math.isnan(a) or math.isnan(b):
        inside = math.isnan(a) and math.isnan(b)
        assert found.nan[0] == (not inside)
    elif math.isinf(a) or math.isinf(b):
        inside = a == b
        assert found.infinite[0] == (not inside)
    else:
        inside = abs(a - b) <= max(absolute, relative * max(abs(a), abs(b)))
    assert found.outside[0] == (not inside)
    assert found.differs[0] == (not (a == b or (math.isnan(a) and math.isnan(b))))


@given(doubles, doubles, bounds)
def test_the_order_of_the_runs_does_not_matter(a, b, relative):
    one = compare_numbers(np.array([a]), np.array([b]), Tolerance(rel=relative))
    other = compare_numbers(np.array([b]), np.array([a]), Tolerance(rel=relative))
    assert one.outside[0] == other.outside[0]
    np.testing.assert_array_equal(one.error, other.error)


@pytest.mark.parametrize("angle", [0.0, 1e-15, 1e-12, 1e-9, 1e-3, 1.0, 3.0, math.pi])
def test_the_angle_between_rotations_keeps_its_digits(angle):
    rng = np.random.default_rng(3)
    axis = np.array([2.0, -1.0, 2.0]) / 3.0
    first = transforms.from_rpy(rng.uniform(-3, 3, size=(50, 3)))
    second = transforms.compose(first, transforms.from_axis_angle(axis, np.full(50, angle)))
    a, b = transforms.to_quaternion(first), transforms.to_quaternion(second)
    found = compare_rotations(a, b, Tolerance(abs=4.0))
    np.testing.assert_allclose(found.error, angle, atol=2e-15 + 1e-12 * angle)
    np.testing.assert_allclose(compare_rotations(b, -a, Tolerance()).error, found.error, atol=1e-15)
    assert not found.outside.any()
    assert not compare_rotations(a, -a, Tolerance()).differs.any()


def test_nan_in_rotations():
    known, lost = np.array([[0.0, 0.0, 0.0, 1.0]]), np.full((1, 4), np.nan)
    assert not compare_rotations(lost, lost, Tolerance()).outside.any()
    assert compare_rotations(lost, lost, Tolerance(nan="fail")).nan.all()
    assert compare_rotations(known, lost, Tolerance(abs=math.inf)).nan.all()
    assert not compare_rotations(known, known, Tolerance(nan="fail")).outside.any()
