"""Quantities as people say them: the unit that suits their size, and as few digits as tell what is meant."""

from __future__ import annotations

import math
from collections.abc import Sequence

_MOST_DIGITS = 17
_DEGREE = math.pi / 180.0
_PREFIXED = {
    "m": (("um", 1e-6), ("mm", 1e-3), ("cm", 1e-2), ("m", 1.0)),
    "s": (("us", 1e-6), ("ms", 1e-3), ("s", 1.0)),
    "V": (("uV", 1e-6), ("mV", 1e-3), ("V", 1.0)),
    "F": (("aF", 1e-18), ("fF", 1e-15), ("pF", 1e-12), ("nF", 1e-9), ("uF", 1e-6)),
    "F/m": (("pF/m", 1e-12), ("nF/m", 1e-9)),
    "Hz": (("Hz", 1.0), ("kHz", 1e3)),
    "rad": (("deg", _DEGREE),),
}
"""Units by the SI unit that they are told instead of, with their factors to it, in ascending order."""


def suited(values: Sequence[float], unit: str) -> tuple[str, float]:
    """Return the unit in which to tell some values [unit], and its factor: the largest that they reach."""
    base, slash, divisor = unit.partition("/")
    known = _PREFIXED.get(unit) or (_PREFIXED.get(base, ()) if slash and divisor.startswith("s") else ())
    finite = [abs(value) for value in values if math.isfinite(value) and value != 0.0]
    if not known:
        return ("" if unit == "-" else unit), 1.0
    largest = max(finite, default=known[-1][1] if len(known) > 1 else 1.0)
    name, factor = next((one for one in reversed(known) if largest >= one[1] * (1.0 - 1e-9)), known[0])
    return name + ("" if unit in _PREFIXED else slash + divisor), factor


def shown(value: float, unit: str, *, digits: int = 3) -> str:
    """Return "2.1 cm" of 0.021 m."""
    name, factor = suited([value], unit)
    return f"{_number(value / factor, digits)} {name}".rstrip()


def signed(value: float, unit: str) -> str:
    """Return "+85 mV" of 0.085 V."""
    return ("+" if value > 0.0 else "") + shown(value, unit)


def change(old: float, new: float, unit: str) -> str:
    """Return "2.1 -> 1.4 cm": both in one unit, with as many digits as tell them apart."""
    name, factor = suited([old, new], unit)
    for digits in range(3, _MOST_DIGITS + 1):
        texts = _number(old / factor, digits), _number(new / factor, digits)
        if texts[0] != texts[1]:
            break
    return f"{texts[0]} -> {texts[1]} {name}".rstrip()


def written(old: float, new: float, unit: str) -> str:
    """Return "20 -> 21 cm" of two values that somebody wrote: with all digits that they may have had."""
    return " -> ".join(_as_written([old, new], unit))


def exact(value: float, unit: str) -> str:
    """Return "20 cm" of a value that somebody wrote."""
    return _as_written([value], unit)[0]


def _as_written(values: Sequence[float], unit: str) -> list[str]:
    """Return values in the unit that suits them, or in the SI unit if they have fewer digits there: 2 rad/s."""
    name, factor = suited(values, unit)
    texts, plain = ([_exact(value / by) for value in values] for by in (factor, 1.0))
    if sum(map(len, plain)) < sum(map(len, texts)):
        name, texts = unit, plain
    return [*texts[:-1], f"{texts[-1]} {name}".rstrip()]


def _number(value: float, digits: int) -> str:
    """Return a number without an exponent where that is short."""
    if not math.isfinite(value) or value == 0.0:
        return f"{value + 0.0:g}"
    if 1e-4 <= abs(value) < 1e6:
        places = max(digits - 1 - math.floor(math.log10(abs(value))), 0)
        text = f"{value:.{places}f}"
        return text.rstrip("0").rstrip(".") if "." in text else text
    return f"{value:.{digits}g}"


def _exact(value: float) -> str:
    """Return the shortest number that is this one within 1e-12 of it: conversions of units leave no traces."""
    if not math.isfinite(value):
        return f"{value:g}"
    for digits in range(1, _MOST_DIGITS):
        if abs(float(f"{value:.{digits}g}") - value) <= 1e-12 * abs(value):
            break
    return _number(float(f"{value:.{digits}g}"), digits)
