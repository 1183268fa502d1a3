"""Quantities: exact, closed, and refused with what works."""

import math
from fractions import Fraction

import mpmath
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import TypeAdapter, ValidationError

from replay.language import units
from replay.language.units import DIMENSIONS, JointPosition, Length, Quantity, Range

DECIMALS = st.decimals(allow_nan=False, allow_infinity=False, places=6, min_value=-(10**9), max_value=10**9)
# an independent table: powers of ten as text, and pi from mpmath
POWERS = {
    "m": 0,
    "cm": -2,
    "mm": -3,
    "um": -6,
    "km": 3,
    "s": 0,
    "ms": -3,
    "us": -6,
    "ns": -9,
    "Hz": 0,
    "kHz": 3,
    "rad": 0,
}
POWERS |= {"mrad": -3, "m/s": 0, "cm/s": -2, "mm/s": -3, "rad/s": 0, "m/s^2": 0, "cm/s^2": -2, "mm/s^2": -3}
POWERS |= {"rad/s^2": 0, "F": 0, "uF": -6, "nF": -9, "pF": -12, "fF": -15, "F/m": 0, "nF/m": -9, "pF/m": -12}
POWERS |= {"ns": -9, "V": 0, "mV": -3, "kV": 3, "%": -2}
DEGREES = ("deg", "deg/s", "deg/s^2")
SPECIAL = {"in": "0.0254", "min": "60"}


def read(dimension, text):
    return Quantity("Any", dimension).parse(text)


@pytest.mark.parametrize("dimension", DIMENSIONS, ids=lambda dimension: dimension.si)
@given(number=DECIMALS, blank=st.sampled_from(["", " ", "  "]))
def test_a_text_is_the_double_nearest_to_its_decimal_value(dimension, number, blank):
    for unit in dimension.units:
        with mpmath.workdps(80):
            if unit in DEGREES:
                exact = mpmath.mpf(str(number)) * mpmath.pi / 180
            else:
                exact = mpmath.mpf(str(number)) * mpmath.mpf(SPECIAL.get(unit, f"1e{POWERS.get(unit, 0)}"))
            expected = float(exact)
        assert read(dimension, f"{number}{blank}{unit}") == expected


@given(st.floats(-1e12, 1e12))
def test_a_number_is_itself(number):
    assert TypeAdapter(Length).validate_python(number) == number


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("5 cm", 0.05),
        ("1e-6 m", 1e-6),
        (".5 m", 0.5),
        ("5. m", 5.0),
        ("+1 in", 0.0254),
        ("1/3 m", 1.0 / 3.0),
        ("-0 m", 0.0),
    ],
)
def test_lengths(text, value):
    result = TypeAdapter(Length).validate_python(text)
    assert result == value and math.copysign(1.0, result) == 1.0


def test_angles_reach_the_doubles_nearest_to_pi():
    angle = next(dimension for dimension in DIMENSIONS if dimension.si == "rad")
    assert read(angle, "180 deg") == math.pi
    assert read(angle, "360 deg") == 2.0 * math.pi
    assert read(angle, "90 deg") == 0.5 * math.pi


@pytest.mark.parametrize(
    "bad",
    [
        *["", "m", "5", "5  ", "five m", "5 cm m", "5,0 m", "1_000 m", "0x10 m", "5 CM", "1/0 m", "nan m", "inf m"],
        *["1e5000 m", "1e400 m", "5 deg", "1e-5 mm^2", "٥ m", "5" * 500 + " m", True, None, [1], math.nan, 10**400],
    ],
)
def test_what_is_no_length_is_refused(bad):
    with pytest.raises(ValidationError):
        TypeAdapter(Length).validate_python(bad)


def test_infinity_is_a_range_but_no_length():
    assert TypeAdapter(Range).validate_python(math.inf) == math.inf
    with pytest.raises(ValidationError, match="is not finite"):
        TypeAdapter(Length).validate_python(-math.inf)


def test_a_joint_position_keeps_its_dimension_until_the_joint_is_known():
    parse = TypeAdapter(JointPosition).validate_python
    assert parse("30 deg").dimension.name == "an angle"
    assert parse("5 cm").dimension.name == "a length"
    assert parse(0.5).dimension is None
    for value, rule in (
        (-math.inf, "is not finite"),
        ("1e400 m", "is too large for a number"),
        (1e13, "must be between"),
    ):
        with pytest.raises(ValidationError, match=rule):
            parse(value)
    with pytest.raises(ValidationError, match="is a time where an angle or a length belongs"):
        parse("5 s")


def test_no_unit_stands_for_two_dimensions():
    units = [unit for dimension in DIMENSIONS for unit in dimension.units]
    assert len(units) == len(set(units))
    for dimension in DIMENSIONS:
        assert dimension.units.get(dimension.si, Fraction(1)) == Fraction(1)  # a share has none
        read(dimension, dimension.example)


@pytest.mark.parametrize(
    ("name", "least", "most", "open_below"),
    [
        ("Number", -1e100, 1e100, False),
        ("Length", -1e12, 1e12, False),
        ("Size", 1e-9, 1e12, False),
        ("Distance", 0.0, 1e12, False),
        ("Range", 0.0, math.inf, True),
        ("Angle", -1e12, 1e12, False),
        ("Aperture", 0.0, 2.0 * math.pi, True),
        ("Time", 0.0, 1e9, False),
        ("Duration", 0.0, 1e9, False),
        ("Rate", 0.0, 1e9, True),
        ("MaxVelocity", 1e-9, math.inf, False),
        ("MaxAngularVelocity", 1e-9, math.inf, False),
        ("MaxAcceleration", 1e-9, math.inf, False),
        ("MaxAngularAcceleration", 1e-9, math.inf, False),
        ("Capacitance", 1e-18, 1.0, False),
        ("StrayCapacitance", 0.0, 1.0, False),
        ("Permittivity", 1e-18, 1.0, False),
        ("Voltage", -1e6, 1e6, False),
        ("Supply", 1e-6, 1e6, False),
        ("Share", 1e-3, 1.0, False),
        ("Scale", 1e-9, 1e9, False),
    ],
)
def test_a_quantity_takes_its_bounds_and_nothing_beyond(name, least, most, open_below):
    adapter = TypeAdapter(getattr(units, name))
    inside = [least, most] if not open_below else [5e-324 if name != "Rate" else 1e-9, most]
    for value in inside:
        assert float(adapter.validate_python(value)) == value
    beyond = [math.nextafter(least, -math.inf), *([least] if open_below else [])]
    beyond += [math.nextafter(most, math.inf)] if most < math.inf else []
    for value in beyond:
        with pytest.raises(ValidationError):
            adapter.validate_python(value)
    if most < math.inf:
        with pytest.raises(ValidationError):
            adapter.validate_python(math.inf)
    with pytest.raises(ValidationError):
        adapter.validate_python(math.nan)


def test_a_quantity_has_four_hundred_characters_at_most():
    parse = TypeAdapter(Length).validate_python
    longest = "1." + "0" * 396 + " m"
    assert len(longest) == 400 and parse(longest) == 1.0
    with pytest.raises(ValidationError, match="is not a length"):
        parse(longest.replace(" ", "  "))
