"""What public functions take for numbers, and what they refuse."""

from fractions import Fraction

import numpy as np
import pytest

import replay
from replay.collision import gjk
from replay.errors import InvalidValue, ReplayError
from replay.geometry import bounds
from replay.numerics.arguments import as_float, as_floats
from replay.sensing.distance import closest_in_cone

NO_NUMBERS = [[["a", "b", "c"]], [[1, 2, 3], [4, 5]], {}, None, "text", [[1j, 0, 0]], [[True, False, True]], object()]
TRIANGLE = [[[0, 0, 1], [1, 0, 1], [0, 1, 1]]]


@pytest.mark.parametrize(
    "value", [[[1, 2, 3]], np.array([[1, 2, 3]], dtype=">f4"), np.ones((3, 1), order="F").T, ((1, 2, 3),)]
)
def test_real_numbers_of_any_kind_become_float64(value):
    array = as_floats("points", value, (None, 3))
    assert array.dtype == np.float64
    assert array.flags.c_contiguous
    assert array.shape == (1, 3)


def test_empty_sequences_have_the_shape_that_is_asked_for():
    assert as_floats("triangles", [], (None, 3, 3)).shape == (0, 3, 3)
    with pytest.raises(InvalidValue, match=r"apex = array of shape \(0,\): must have shape \(3,\)"):
        as_floats("apex", [], (3,))


@pytest.mark.parametrize("value", [1, 1.0, np.float32(1), np.int64(1), Fraction(1), np.array(1.0)])
def test_one_real_number(value):
    assert as_float("x", value) == 1.0


@pytest.mark.parametrize("value", [None, "1", [1.0], 1j, True, np.True_, np.array([1.0])])
def test_what_is_not_one_real_number(value):
    with pytest.raises(InvalidValue, match="must be a real number"):
        as_float("x", value)


def test_a_whole_number_beyond_all_doubles():
    with pytest.raises(InvalidValue, match="too large"):
        as_float("x", 10**400)


@pytest.mark.parametrize("value", NO_NUMBERS, ids=lambda value: type(value).__name__)
@pytest.mark.parametrize(
    "call",
    [
        bounds.fit_sphere,
        bounds.fit_aabb,
        bounds.fit_obb,
        lambda value: gjk.intersect(value, [[0, 0, 0]]),
        lambda value: gjk.distance([[0, 0, 0]], value),
        lambda value: gjk.distance([[0, 0, 0]], [[0, 0, 0]], pose_a=value if value is not None else "none"),
        lambda value: closest_in_cone(value, [0, 0, 0], [0, 0, 1], 1.0),
        lambda value: closest_in_cone(TRIANGLE, value, [0, 0, 1], 1.0),
        lambda value: closest_in_cone(TRIANGLE, [0, 0, 0], value, 1.0),
        lambda value: closest_in_cone(TRIANGLE, [0, 0, 0], [0, 0, 1], value),
        lambda value: closest_in_cone(TRIANGLE, [0, 0, 0], [0, 0, 1], 1.0, range=value),
        lambda value: replay.sensing.capacitive.plate_integral(value, [1, 1]),
        lambda value: replay.sensing.capacitive.plate_integral(TRIANGLE, value),
        lambda value: replay.sensing.capacitive.output_voltage(value, coupling=1.0),
        lambda value: replay.sensing.capacitive.output_voltage(1.0, coupling=value),
        lambda value: replay.sensing.capacitive.output_voltage(1.0, coupling=1.0, supply=value),
    ],
)
def test_public_functions_refuse_what_is_no_number(call, value):
    with pytest.raises(ReplayError):
        call(value)
