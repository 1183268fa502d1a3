"""Timing that can be compared: contenders warmed up, run in turn, their answers checked before their times count."""

from __future__ import annotations

import math
import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Check:
    """What the answers of one contender are worth against the reference.

    Attributes:
        worst_error: largest error over all queries, in the unit that the case states; NaN if any is no number.
        wrong: queries whose answer is wrong beyond the tolerance the case states.
        tolerance: the error up to which an answer counts as right; inf where only a curve of error is wanted.
        mean_error: where the case asks for it.
        missed: queries in which an inexact method says "nothing there" while there is something.
    """

    worst_error: float
    wrong: int = 0
    tolerance: float = math.inf
    mean_error: float = math.nan
    missed: int = 0

    @property
    def failed(self) -> bool:
        """Whether this contender must not be called fast: it answered wrongly, or with an error that is no number."""
        return self.wrong > 0 or math.isnan(self.worst_error)


@dataclass(frozen=True)
class Contender:
    """One way to answer all queries of a case.

    Attributes:
        name: of the method, as the tables show it.
        run: answers the queries once and returns the answers.
        queries: how many queries one call answers.
        check: compares those answers with the reference.
    """

    name: str
    run: Callable[[], Any]
    queries: int
    check: Callable[[Any], Check]


@dataclass(frozen=True)
class Row:
    """One contender's result in one case; times are seconds per query."""

    case: str
    method: str
    median: float
    low: float
    high: float
    rounds: int
    worst_error: float
    wrong: int
    queries: int
    failed: bool
    mean_error: float = math.nan
    missed: int = 0
    note: str = ""


def silent(case: str) -> None:
    """Show nothing."""


_tell: Callable[[str], None] = silent


def tell_by(tell: Callable[[str], None]) -> None:
    """Let others show which case is measured."""
    global _tell  # noqa: PLW0603
    _tell = tell


LEAST_ROUND = 5e-4
"""[s] A contender that is faster is called several times a round; long rounds would all meet a pause of the machine."""


def compete(case: str, contenders: Sequence[Contender], *, rounds: int = 7) -> list[Row]:
    """Time contenders against each other on one case.

    Each is called once to warm up (compilation, caches) and to have its answers checked, then all are called in turn
    `rounds` times, so that a machine that slows down slows all of them: ratios within one case can be trusted, absolute
    times belong to the machine.

    Returns:
        one row a contender, in the order given; `low` and `high` are the fastest and slowest round.
    """
    _tell(case)
    checks = [contender.check(contender.run()) for contender in contenders]
    calls = [max(1, math.ceil(LEAST_ROUND / max(_seconds(contender, 1), 1e-9))) for contender in contenders]
    times: list[list[float]] = [[] for _ in contenders]
    for _ in range(rounds):
        for contender, count, taken in zip(contenders, calls, times, strict=True):
            taken.append(_seconds(contender, count) / (count * contender.queries))
    return [
        Row(
            case=case,
            method=contender.name,
            median=statistics.median(taken),
            low=min(taken),
            high=max(taken),
            rounds=rounds,
            worst_error=check.worst_error,
            wrong=check.wrong,
            queries=contender.queries,
            failed=check.failed,
            mean_error=check.mean_error,
            missed=check.missed,
        )
        for contender, taken, check in zip(contenders, times, checks, strict=True)
    ]


def _seconds(contender: Contender, calls: int) -> float:
    begin = time.perf_counter()
    for _ in range(calls):
        contender.run()
    return time.perf_counter() - begin


def exponent(points: Sequence[tuple[float, float]]) -> float:
    """Return p of the law y ~ x^p fitted to points (x, y) by least squares in the logarithms; NaN below two points."""
    if len(points) < 2:
        return math.nan
    x, y = [math.log(point[0]) for point in points], [math.log(point[1]) for point in points]
    mean_x, mean_y = statistics.fmean(x), statistics.fmean(y)
    square = sum((a - mean_x) ** 2 for a in x)
    return sum((a - mean_x) * (b - mean_y) for a, b in zip(x, y, strict=True)) / square


def absent(case: str, method: str, why: str) -> Row:
    """Return the row of a peer that cannot take part; it says why instead of vanishing from the table."""
    nan = math.nan
    return Row(case, method, nan, nan, nan, 0, nan, 0, 0, failed=False, note=why)
