"""Numbers in the attributes of descriptions of robots: decimal, separated by blanks, and within what they stand for."""

from __future__ import annotations

import math
import re

from replay.robots.xml_text import XmlElement

_NUMBER = re.compile(r"[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]{1,4})?")
_INFINITE = re.compile(r"([-+]?)inf(inity)?", re.IGNORECASE)
_LARGEST = 1e12


def number(element: XmlElement, name: str, default: float | None = None, *, infinite: bool = False) -> float:
    """Return an attribute as a number.

    Args:
        element: which has it.
        name: of the attribute.
        default: what it is when left out; None if it must be there.
        infinite: whether it may be infinite, as limits may; what is beyond 1e12 is then, too.

    Raises:
        RobotError: it is none, or beyond 1e12.
    """
    if default is not None and not element.attributes.get(name, "").strip():
        return default
    text = element.text(name)
    value = _value(text)
    if infinite and (found := _INFINITE.fullmatch(text)):
        return -math.inf if found[1] == "-" else math.inf
    if infinite and value is not None and abs(value) > _LARGEST:
        return math.copysign(math.inf, value)
    if value is None or abs(value) > _LARGEST:
        raise element.wrong(f"<{element.tag}> has {name}={text[:60]!r}, which is no number between -1e12 and 1e12")
    return value + 0.0


def numbers(element: XmlElement, name: str, count: int, default: tuple[float, ...] | None = None) -> tuple[float, ...]:
    """Return an attribute as so many numbers; see `number`."""
    if default is not None and not element.attributes.get(name, "").strip():
        return default
    text = element.text(name)
    values = [_value(part) for part in text.split()[: count + 1]]
    if len(values) != count or any(value is None or abs(value) > _LARGEST for value in values):
        rule = f"which are not {count} numbers between -1e12 and 1e12"
        raise element.wrong(f"<{element.tag}> has {name}={text[:60]!r}, {rule}")
    return tuple(value + 0.0 for value in values if value is not None)


def size(element: XmlElement, name: str) -> float:
    """Return an attribute that is a length >= 0; RobotError if it is negative."""
    value = number(element, name)
    if value < 0.0:
        raise element.wrong(f"<{element.tag}> has {name}={value:g}, which is below 0")
    return value


def _value(text: str) -> float | None:
    return float(text) if _NUMBER.fullmatch(text) else None
