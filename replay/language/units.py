"""Quantities: a number is SI, a text carries its unit ("30 deg", "5 cm"); the table of units is closed.

A text is converted exactly: the result is the double nearest to the decimal number times the unit's factor, so that
"5 cm" is 0.05 and "180 deg" is the double nearest to pi.
"""

from __future__ import annotations

import math
import operator
import re
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Annotated, Any, Final

from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler
from pydantic_core import PydanticCustomError, core_schema

from replay.language import decimal_comma
from replay.numerics.constants import FULL_TURN

_PI = Fraction(31415926535897932384626433832795028841971693993751058209749446, 10**61)
_DEGREE = _PI / 180


@dataclass(frozen=True)
class Dimension:
    """A physical dimension with the units it may be written in.

    Attributes:
        name: as in "is a length where an angle belongs", with its article.
        si: the unit of a bare number.
        units: factor to SI of each unit.
        example: a text that works.
    """

    name: str
    si: str
    units: dict[str, Fraction] = field(repr=False, compare=False)
    example: str = field(repr=False)

    @property
    def what_works(self) -> str:
        """What may be written, for messages."""
        if not any(self.units):
            return "write a number"
        return f"write a number [{self.si}] or text such as '{self.example}' (units: {', '.join(self.units)})"


def _metric(si: str, **prefixed: int) -> dict[str, Fraction]:
    return {si: Fraction(1)} | {unit: Fraction(10) ** power for unit, power in prefixed.items()}


def _per(units: dict[str, Fraction], divisor: str) -> dict[str, Fraction]:
    return {f"{unit}/{divisor}": factor for unit, factor in units.items()}


_METRES = _metric("m", cm=-2, mm=-3)
_ANGLES = {"rad": Fraction(1), "deg": _DEGREE}

LENGTH: Final = Dimension(
    "a length", "m", _metric("m", cm=-2, mm=-3, um=-6, km=3) | {"in": Fraction(254, 10**4)}, "5 cm"
)
ANGLE: Final = Dimension("an angle", "rad", _ANGLES | {"mrad": Fraction(1, 1000)}, "30 deg")
TIME: Final = Dimension("a time", "s", _metric("s", ms=-3, us=-6, ns=-9) | {"min": Fraction(60)}, "5 s")
FREQUENCY: Final = Dimension("a frequency", "Hz", _metric("Hz", kHz=3), "60 Hz")
VELOCITY: Final = Dimension("a velocity", "m/s", _per(_METRES, "s"), "5 cm/s")
ANGULAR_VELOCITY: Final = Dimension("an angular velocity", "rad/s", _per(_ANGLES, "s"), "25 deg/s")
ACCELERATION: Final = Dimension("an acceleration", "m/s^2", _per(_METRES, "s^2"), "0.5 m/s^2")
ANGULAR_ACCELERATION: Final = Dimension("an angular acceleration", "rad/s^2", _per(_ANGLES, "s^2"), "50 deg/s^2")
CAPACITANCE: Final = Dimension("a capacitance", "F", _metric("F", uF=-6, nF=-9, pF=-12, fF=-15), "10 pF")
PERMITTIVITY: Final = Dimension("a permittivity", "F/m", _metric("F/m", **{"nF/m": -9, "pF/m": -12}), "8.854 pF/m")
VOLTAGE: Final = Dimension("a voltage", "V", _metric("V", mV=-3, kV=3), "2.5 V")
SHARE: Final = Dimension("a share", "-", {"%": Fraction(1, 100)}, "5 %")
NUMBER: Final = Dimension("a number", "-", {}, "1")

DIMENSIONS: Final = (
    LENGTH,
    ANGLE,
    TIME,
    FREQUENCY,
    VELOCITY,
    ANGULAR_VELOCITY,
    ACCELERATION,
    ANGULAR_ACCELERATION,
    CAPACITANCE,
    PERMITTIVITY,
    VOLTAGE,
    SHARE,
)
DIMENSION_OF: Final = {unit: dimension for dimension in DIMENSIONS for unit in dimension.units}

_DECIMAL = r"[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]{1,3})?"
_QUANTITY = re.compile(rf"\s*({_DECIMAL})(?:/([0-9]+))?\s*([^\s0-9.+-]\S*)?\s*")
_MAX_LENGTH = 400


def quantity_rule(text: str, wanted: tuple[Dimension, ...]) -> tuple[Fraction, Dimension] | str:
    """Return the exact SI value of a text and its dimension, or the rule that it breaks and what works.

    Args:
        text: a decimal number, or a ratio of one to an integer ("30000/1001 Hz"), and a unit.
        wanted: the dimensions that may stand here.
    """
    what_works = " or ".join(dimension.what_works for dimension in wanted)
    found = _QUANTITY.fullmatch(text) if len(text) <= _MAX_LENGTH else None
    if comma := decimal_comma.rule(text[:_MAX_LENGTH]):
        return comma
    if found is None:
        return f"is not {wanted[0].name}; {what_works}"
    decimal, divisor, unit = found.groups()
    if unit is None:
        return f"is a text without a unit; {what_works}"
    dimension = DIMENSION_OF.get(unit)
    if dimension is None:
        return f"has the unknown unit {unit!r}; {what_works}"
    if dimension not in wanted:
        return f"is {dimension.name} where {' or '.join(d.name for d in wanted)} belongs; {what_works}"
    if divisor is not None and int(divisor) == 0:
        return f"divides by zero; {what_works}"
    return Fraction(decimal) / int(divisor or 1) * dimension.units[unit], dimension


def _rejected(rule: str) -> PydanticCustomError:
    return PydanticCustomError("quantity", "{rule}", {"rule": rule})


def _exact(value: object, wanted: tuple[Dimension, ...]) -> tuple[Fraction | float, Dimension | None]:
    """Return the SI value, as an infinite float or exactly, and its dimension (None for a bare number)."""
    what_works = " or ".join(dimension.what_works for dimension in wanted)
    if isinstance(value, str):
        comma = decimal_comma.rule(value[:_MAX_LENGTH]) or "is text where a number belongs"
        result = quantity_rule(value, wanted) if wanted[0] is not NUMBER else comma
        if isinstance(result, str):
            raise _rejected(result)
        return result
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise _rejected(f"is not {wanted[0].name}; {what_works}")
    if isinstance(value, float) and math.isnan(value):
        raise _rejected(f"is not a number; {what_works}")
    if isinstance(value, float) and math.isinf(value):
        return value, None
    # repr is the shortest decimal that reads back as this double: the decimal that was written
    return Fraction(repr(value)), None


def _double(exact: Fraction | float) -> float:
    try:
        return float(exact) + 0.0  # -0.0 becomes 0.0
    except OverflowError:
        raise _rejected("is too large for a number") from None


@dataclass(frozen=True)
class Quantity:
    """Marks a pydantic field as a quantity.

    Attributes:
        name: of the type in the JSON Schema.
        dimension: what may be written.
        above, at_least, below, at_most: limits in SI; a value is > above, >= at_least, < below and <= at_most.
        infinite: whether `.inf` is meaningful here.
        exact: keep the value as a `Fraction`.
        words: texts that stand for a value, and the value.
    """

    name: str
    dimension: Dimension
    above: float | None = None
    at_least: float | None = None
    below: float | None = None
    at_most: float | None = None
    infinite: bool = False
    exact: bool = False
    words: tuple[tuple[str, Any], ...] = ()

    def parse(self, value: object) -> float | Fraction:
        """Return the value in SI, or what a word stands for.

        Raises:
            PydanticCustomError: it is something else, has a wrong unit, or is outside the limits.
        """
        for word, meant in self.words:
            if value == word:
                return meant  # type: ignore[no-any-return]
        if self.words and isinstance(value, str) and value.strip().isalpha():
            choices = ", ".join(word for word, _ in self.words)
            raise _rejected(f"is none of {choices}, and not {self.dimension.name}; {self.dimension.what_works}")
        exact, _ = _exact(value, (self.dimension,))
        number = _double(exact)
        if math.isinf(number) and not self.infinite:
            raise _rejected(f"is not finite; {self.dimension.what_works}")
        unit = "" if self.dimension is NUMBER else f" {self.dimension.si}"
        for limit, broken, symbol in (
            (self.above, operator.le, ">"),
            (self.at_least, operator.lt, ">="),
            (self.below, operator.ge, "<"),
            (self.at_most, operator.gt, "<="),
        ):
            if limit is not None and broken(number, limit):
                raise _rejected(f"must be {symbol} {limit:.10g}{unit}")
        return exact if self.exact and isinstance(exact, Fraction) else number

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> core_schema.CoreSchema:
        """Validate by `parse` alone."""
        return core_schema.no_info_plain_validator_function(self.parse)

    def __get_pydantic_json_schema__(self, schema: Any, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        """Show a number or a text with one of the units."""
        limits = {
            "exclusiveMinimum": self.above,
            "minimum": self.at_least,
            "exclusiveMaximum": self.below,
            "maximum": self.at_most,
        }
        number: dict[str, Any] = {"type": "number"} | {key: limit for key, limit in limits.items() if limit is not None}
        result = json_schema(self.name, number, (self.dimension,))
        if self.words:
            result["anyOf"].insert(0, {"enum": [word for word, _ in self.words]})
        return result


@dataclass(frozen=True)
class Dimensioned:
    """A value [SI] whose dimension is known only where it was written with a unit: a joint position before the joint is
    looked up. `dimension` is None for a bare number.
    """

    value: float
    dimension: Dimension | None


@dataclass(frozen=True)
class AnyQuantity:
    """Marks a pydantic field that may have one of several dimensions, depending on something else."""

    name: str
    dimensions: tuple[Dimension, ...]
    at_least: float | None = None

    def parse(self, value: object) -> Dimensioned:
        """Return the value in SI with its dimension; raises PydanticCustomError as `Quantity.parse` does."""
        exact, dimension = _exact(value, self.dimensions)
        number = _double(exact)
        if math.isinf(number):
            raise _rejected("is not finite")
        if abs(number) > _FAR:
            raise _rejected(f"must be between -{_FAR:g} and {_FAR:g}")
        if self.at_least is not None and number < self.at_least:
            raise _rejected(f"must be >= {self.at_least:.10g}")
        return Dimensioned(number, dimension)

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> core_schema.CoreSchema:
        """Validate by `parse` alone."""
        return core_schema.no_info_plain_validator_function(self.parse)

    def __get_pydantic_json_schema__(self, schema: Any, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        """Show a number or a text with one of the units."""
        limit = {} if self.at_least is None else {"minimum": self.at_least}
        return json_schema(self.name, {"type": "number"} | limit, self.dimensions)


QUANTITY_KEY: Final = "x-quantity"
"""Names a quantity's type in generated JSON Schemas, until each type is defined once."""


def json_schema(name: str, number: dict[str, Any], dimensions: tuple[Dimension, ...]) -> dict[str, Any]:
    """Return the JSON Schema of a quantity: a number, or a text with one of the units."""
    units = [unit for dimension in dimensions for unit in dimension.units]
    if not units:
        return {QUANTITY_KEY: name, **number}
    pattern = rf"^\s*{_DECIMAL}(/[0-9]+)?\s*({'|'.join(unit.replace('^', chr(92) + '^') for unit in units)})\s*$"
    return {QUANTITY_KEY: name, "anyOf": [number, {"type": "string", "pattern": pattern}]}


_FAR = 1e12
"""Largest length [m] and joint position: its sixth power stays finite, and its rounding below 1 mm."""

_SMALL = 1e-9
"""Smallest size [m] and smallest joint limit: smaller ones are slips of a unit, and their areas drown in rounding."""

Number = Annotated[float, Quantity("Number", NUMBER, at_least=-1e100, at_most=1e100)]
Length = Annotated[float, Quantity("Length", LENGTH, at_least=-_FAR, at_most=_FAR)]
Size = Annotated[float, Quantity("Size", LENGTH, at_least=_SMALL, at_most=_FAR)]
Distance = Annotated[float, Quantity("Distance", LENGTH, at_least=0.0, at_most=_FAR)]
Range = Annotated[float, Quantity("Range", LENGTH, above=0.0, infinite=True)]
Angle = Annotated[float, Quantity("Angle", ANGLE, at_least=-_FAR, at_most=_FAR)]
Aperture = Annotated[float, Quantity("Aperture", ANGLE, above=0.0, at_most=FULL_TURN)]
Time = Annotated[float, Quantity("Time", TIME, at_least=0.0, at_most=1e9)]
LongestGap = Annotated[float, Quantity("LongestGap", TIME, above=0.0, at_most=1e9)]
ClockOffset = Annotated[
    float | None, Quantity("ClockOffset", TIME, at_least=-1e9, at_most=1e9, words=(("estimate", None),))
]
Duration = Annotated[Fraction, Quantity("Duration", TIME, at_least=0.0, at_most=1e9, exact=True)]
Delay = Annotated[Fraction, Quantity("Delay", TIME, at_least=0.0, at_most=1e9, exact=True)]
Rate = Annotated[Fraction, Quantity("Rate", FREQUENCY, above=0.0, at_most=1e9, exact=True)]
MaxVelocity = Annotated[float, Quantity("MaxVelocity", VELOCITY, at_least=_SMALL, infinite=True)]
MaxAngularVelocity = Annotated[float, Quantity("MaxAngularVelocity", ANGULAR_VELOCITY, at_least=_SMALL, infinite=True)]
MaxAcceleration = Annotated[float, Quantity("MaxAcceleration", ACCELERATION, at_least=_SMALL, infinite=True)]
MaxAngularAcceleration = Annotated[
    float, Quantity("MaxAngularAcceleration", ANGULAR_ACCELERATION, at_least=_SMALL, infinite=True)
]
Capacitance = Annotated[float, Quantity("Capacitance", CAPACITANCE, at_least=1e-18, at_most=1.0)]
StrayCapacitance = Annotated[float, Quantity("StrayCapacitance", CAPACITANCE, at_least=0.0, at_most=1.0)]
Earth = Annotated[
    float,
    Quantity("Earth", CAPACITANCE, at_least=0.0, at_most=1.0, words=(("grounded", math.inf), ("floating", 0.0))),
]
Permittivity = Annotated[float, Quantity("Permittivity", PERMITTIVITY, at_least=1e-18, at_most=1.0)]
Voltage = Annotated[float, Quantity("Voltage", VOLTAGE, at_least=-1e6, at_most=1e6)]
Supply = Annotated[float, Quantity("Supply", VOLTAGE, at_least=1e-6, at_most=1e6)]
Probability = Annotated[float, Quantity("Probability", SHARE, at_least=0.0, at_most=1.0)]
Share = Annotated[float, Quantity("Share", NUMBER, at_least=1e-3, at_most=1.0)]
Accuracy = Annotated[float, Quantity("Accuracy", SHARE, at_least=1e-3, at_most=0.5)]
Scale = Annotated[float, Quantity("Scale", NUMBER, at_least=1e-9, at_most=1e9)]
AxisScale = Annotated[float, Quantity("AxisScale", NUMBER, at_least=-1e9, at_most=1e9)]

JointPosition = Annotated[Dimensioned, AnyQuantity("JointPosition", (ANGLE, LENGTH))]
LimitTolerance = Annotated[Dimensioned, AnyQuantity("LimitTolerance", (ANGLE, LENGTH), at_least=0.0)]
JointVelocity = Annotated[Dimensioned, AnyQuantity("JointVelocity", (ANGULAR_VELOCITY, VELOCITY))]
JointAcceleration = Annotated[Dimensioned, AnyQuantity("JointAcceleration", (ANGULAR_ACCELERATION, ACCELERATION))]
