"""Times of logs from text to whole nanoseconds, exactly: no double stands between.

A double holds the seconds since 1970 to 0.24 us only, which at 1 kHz is 2e-4 of the time between two samples.
"""

from __future__ import annotations

import datetime
import re
from fractions import Fraction

MAX_TIME = 1 << 62
"""Largest time [ns], before or after 0: 146 years, so that the difference of two fits in 64 bits."""

_DECIMAL = re.compile(r"([-+]?)(?=\.?[0-9])([0-9]*)\.?([0-9]*)(?:[eE]([-+]?[0-9]{1,4}))?")
_DATE = re.compile(
    r"(?P<date>\d{4}-\d{2}-\d{2})[Tt ](?P<clock>\d{2}:\d{2}(:\d{2})?)([.,](?P<fraction>\d+))?"
    r"\s*(?P<zone>[Zz]|UTC|[-+]\d{2}:?\d{2})?"
)
_DAY_BEGIN = datetime.datetime(1970, 1, 1, tzinfo=datetime.UTC)


def nanoseconds(text: str, unit: Fraction) -> int | None:
    """Return a time written as a decimal number in nanoseconds, half rounded to even; None for other text.

    Args:
        text: such as `1700000000.123456789` or `1.7e9`.
        unit: that the number counts in [ns].

    Raises:
        OverflowError: it is beyond `MAX_TIME`.
    """
    found = _DECIMAL.fullmatch(text) if len(text) <= 80 else None
    if found is None:
        return None
    sign, whole, part, exponent = found.groups()
    power = int(exponent or 0) - len(part)
    above, below = int(whole + part) * unit.numerator * 10 ** max(power, 0), unit.denominator * 10 ** max(-power, 0)
    time, rest = divmod(above, below)
    time += 2 * rest > below or (2 * rest == below and time % 2 == 1)
    return _within(-time if sign == "-" else time)


def date_nanoseconds(text: str) -> tuple[int, bool] | None:
    """Return an ISO 8601 date with time of day in nanoseconds since 1970, and whether it names its zone.

    Read are `2024-05-01T12:00:00.123456789Z`, a space for the T, a comma for the point, a zone such as `+02:00` or
    none (then UTC is meant). Text of another form is None.

    Raises:
        ValueError: it has the form and is no date, such as the 30th of February.
        OverflowError: it is beyond `MAX_TIME`.
    """
    found = _DATE.fullmatch(text)
    if found is None:
        return None
    zone = found["zone"]
    offset = "+00:00" if zone is None or zone.upper() in ("Z", "UTC") else f"{zone[:3]}:{zone[-2:]}"
    moment = datetime.datetime.fromisoformat(f"{found['date']}T{found['clock']}{offset}") - _DAY_BEGIN
    seconds = moment.days * 86_400 + moment.seconds
    fraction = round(Fraction(int(found["fraction"] or 0), 10 ** len(found["fraction"] or "")) * 10**9)
    return _within(seconds * 10**9 + fraction), zone is not None


def _within(time: int) -> int:
    if not -MAX_TIME <= time <= MAX_TIME:
        raise OverflowError
    return time
