"""What a plain scalar means, by the core schema of YAML 1.2 (section 10.3.2).

`1e-6` is a number, and `on`, `no`, `12:30` and `1_000` are text.
"""

from __future__ import annotations

import math
import re

from replay import limits
from replay.language.node import Scalar

_INTEGER = re.compile(r"[-+]?[0-9]+|0o[0-7]+|0x[0-9a-fA-F]+")
_FLOAT = re.compile(r"[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?")
_INFINITY = re.compile(r"[-+]?\.(?:inf|Inf|INF)")
_NOT_A_NUMBER = (".nan", ".NaN", ".NAN")
_NULL = ("", "~", "null", "Null", "NULL")
_TRUE = ("true", "True", "TRUE")
_FALSE = ("false", "False", "FALSE")


def meaning(text: str) -> tuple[Scalar, str]:
    """Return the value that a text stands for, and what is wrong with it: 0 takes the place of a number not read."""
    if text in _NULL:
        return None, ""
    if text in _TRUE or text in _FALSE:
        return text in _TRUE, ""
    if _INFINITY.fullmatch(text):
        return -math.inf if text[0] == "-" else math.inf, ""
    if text in _NOT_A_NUMBER:
        return math.nan, ""
    integer = _INTEGER.fullmatch(text) is not None
    if not integer and _FLOAT.fullmatch(text) is None:
        return text, ""
    if len(text) > limits.NUMBER_DIGITS:
        return 0, f"a number of {len(text)} characters; at most {limits.NUMBER_DIGITS} are read"
    if integer:
        bases = {"0o": 8, "0x": 16}
        base = bases.get(text[:2], 10)
        return int(text[2:] if base != 10 else text, base), ""
    number = float(text)
    if math.isinf(number):
        return 0.0, f"{text} is too large for a number; write .inf where infinity is meant"
    return number, ""
