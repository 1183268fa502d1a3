"""A row of numbers as a row of small bars in text."""

from __future__ import annotations

from collections.abc import Sequence

_BARS = "▁▂▃▄▅▆▇█"


def sparkline(values: Sequence[float | None]) -> str:
    """Return a bar for each value, from the smallest to the largest; a dot where there is none.

    Values that differ by less than 1e-6 of the largest are told as equal: rounding makes no steps.
    """
    known = [value for value in values if value is not None]
    if not known:
        return ""
    low, high = 0.5 * min(known), 0.5 * max(known)  # halves: the difference of two numbers may be none
    flat = high - low <= 1e-6 * max(abs(low), abs(high))
    return "".join(
        "·"
        if value is None
        else _BARS[3]
        if flat
        else _BARS[round((0.5 * value - low) / (high - low) * (len(_BARS) - 1))]
        for value in values
    )
