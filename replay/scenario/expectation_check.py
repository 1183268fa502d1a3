"""Whether a scenario's expectations hold, followed block by block while results stream past."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from replay.collision.columns import CollisionColumns, Level
from replay.guarding.outcome import Stop
from replay.guarding.part import GuardExpectation
from replay.language.fields import Part
from replay.language.node import KeyPath
from replay.numerics.arrays import Floats, Integers
from replay.scenario.expectations import BetweenPart, PairExpectation
from replay.scenario.guard_outcomes import judge
from replay.scenario.layout import Layout
from replay.scenario.meetings import Clearances, Meetings, Seen, seen
from replay.scenario.names import matches
from replay.scenario.outcome import Outcome
from replay.scenario.source import ScenarioProvenance, dotted
from replay.scenario.tallies import Count, Extremes, Tally
from replay.sensing.kind import Expected
from replay.sensing.kinds import KINDS


@dataclass(frozen=True)
class _Block:
    collision: CollisionColumns | None
    readings: Mapping[str, Any]


@dataclass
class _Check:
    """One line of an expectation: what is taken from each block, and what is kept of it."""

    text: str
    path: KeyPath
    what: str
    take: Callable[[_Block], Any]
    state: Tally


@dataclass
class _GuardCheck:
    """An expectation of a guard, judged in the end."""

    path: KeyPath
    expected: GuardExpectation


class ExpectationCheck:
    """Follows expectations over all frames.

    Args:
        expectations: of the scenario.
        layout: names behind the columns.
        clearance, margin: the model's `collision.clearance` and the scenario's `collision.margin` [m]: they tell what a
            clearance that was not computed means.
        provenance: knows where the expectations are written.
    """

    def __init__(
        self,
        expectations: Sequence[Part],
        layout: Layout,
        *,
        clearance: str = "near",
        margin: float = math.inf,
        provenance: ScenarioProvenance | None = None,
    ) -> None:
        self._layout = layout
        self._clearance = clearance
        self._margin = margin
        self._provenance = provenance or ScenarioProvenance()
        self._checks: list[_Check | _GuardCheck] = []
        for index, expectation in enumerate(expectations):
            if isinstance(expectation, GuardExpectation):
                self._checks.append(_GuardCheck(("expect", index), expectation))
                continue
            if isinstance(expectation, PairExpectation):
                self._add_pairs(("expect", index), expectation)
                continue
            for kind in KINDS.values():
                if isinstance(expectation, kind.expectation):
                    for expected in kind.expected:
                        self._add_reading(("expect", index), kind.name, expectation, expected)

    def update(self, time_ns: Integers, collision: CollisionColumns | None, readings: Mapping[str, Any]) -> None:
        """Take the results of the next n frames, at times (n,) [ns]: of pairs, and of each kind of sensor by name."""
        block = _Block(collision, readings)
        for check in self._checks:
            if isinstance(check, _Check):
                check.state.update(time_ns, check.take(block))

    def finish(self, stops: Sequence[Stop] = ()) -> list[Outcome]:
        """Return what became of each line, in the order they are written; `stops` of the guards of the run."""
        outcomes = []
        for check in self._checks:
            if isinstance(check, _GuardCheck):
                for text, path, passed, detail, measure in judge(check.expected, stops, check.path):
                    outcomes.append(Outcome(text, self._provenance.place(path), passed, detail, measure))
                continue
            passed, detail = check.state.result(check.what)
            measure = check.state.measure(dotted(check.path))
            outcomes.append(Outcome(check.text, self._provenance.place(check.path), passed, detail, measure))
        return outcomes

    def _add_pairs(self, path: KeyPath, expected: PairExpectation) -> None:
        columns = matching_pairs(self._layout.pairs, expected.pair)
        about = " | ".join(expected.pair)
        names = [self._layout.pairs[k].replace("|", " | ") for k in columns.tolist()]

        def reaches(level: Level) -> Callable[[_Block], Seen]:
            def take(block: _Block) -> Seen:
                assert block.collision is not None
                return seen(block.collision, columns, level)

            return take

        if isinstance(expected.contact, BetweenPart):
            begin, end = expected.contact.between
            window = (round(begin * 1e9), round(end * 1e9))
            text = f"{about}: contact begins between {begin:.6g} s and {end:.6g} s"
            self._checks.append(
                _Check(
                    text, (*path, "contact"), "contact", reaches(Level.CONTACT), Meetings(window=window, names=names)
                )
            )
        elif expected.contact is not None:
            text = f"{about}: contact {expected.contact}"
            state = Meetings(expected.contact, names=names)
            self._checks.append(_Check(text, (*path, "contact"), "contact", reaches(Level.CONTACT), state))
        if expected.bounds is not None:
            text, state = f"{about}: bounds {expected.bounds}", Meetings(expected.bounds, names=names)
            self._checks.append(_Check(text, (*path, "bounds"), "bounds meet", reaches(Level.BOUNDS), state))
        if expected.clearance is not None:
            least = expected.clearance.min

            def clearance(block: _Block) -> tuple[Floats, Floats, Seen, Integers]:
                assert block.collision is not None
                part = block.collision.clearance[:, columns]
                known = block.collision.evaluated[:, columns]
                values = np.where(known, part, math.inf)
                values = np.where(block.collision.level[:, columns] == Level.CONTACT, 0.0, values)
                smallest = np.min(values, axis=1, initial=math.inf)
                unknown = np.isinf(smallest) | (complete & ~known.all(axis=1) & (smallest > 0.0))
                bounds = np.full(len(part), math.nan)
                if block.collision.clearance_bound is not None:
                    bounds = np.fmin.reduce(block.collision.clearance_bound[:, columns], axis=1)
                contact = seen(block.collision, columns, Level.CONTACT)
                which = np.argmin(values, axis=1) if values.shape[1] else np.zeros(len(values), dtype=np.int64)
                return np.where(unknown, math.nan, smallest), bounds, contact, which

            complete = self._clearance != "near" or least > self._margin
            tally = Clearances(Extremes("m", low=least, complete=complete), meetings=Meetings("never", names=names))
            text = f"{about}: clearance >= {least:.6g} m"
            self._checks.append(_Check(text, (*path, "clearance"), "clearance", clearance, tally))

    def _add_reading(self, path: KeyPath, kind: str, written: Any, expected: Expected) -> None:
        name = getattr(written, kind)
        column = self._layout.sensors[kind].index(name)
        asked = getattr(written, expected.what) if expected.inside else written
        here = (*path, expected.what) if expected.inside else path

        def take(block: _Block) -> Floats:
            return expected.values(block.readings[kind])[:, column].astype(np.float64)

        def add(text: str, where: KeyPath, state: Tally) -> None:
            self._checks.append(_Check(f"{name}: {expected.what} {text}", where, expected.what, take, state))

        if expected.unit:
            for key, bound, symbol in (("low", "min", ">="), ("high", "max", "<=")):
                value = getattr(asked, bound, None)
                if value is not None:
                    state = Extremes(expected.unit, **{key: value})
                    add(f"{symbol} {value:.6g} {expected.unit}", (*here, bound), state)
        elif asked is not None:
            add(asked, here, Count(asked))


def clearance_limits(expectations: Sequence[Part], pairs: Sequence[str]) -> dict[str, float]:
    """Return the smallest clearance [m] that is expected of each pair of which one is; the strictest of several."""
    found: dict[str, float] = {}
    for expected in expectations:
        if isinstance(expected, PairExpectation) and expected.clearance is not None:
            for index in matching_pairs(pairs, expected.pair).tolist():
                found[pairs[index]] = max(found.get(pairs[index], 0.0), expected.clearance.min)
    return found


def matching_pairs(pairs: Sequence[str], patterns: tuple[str, str]) -> NDArray[np.intp]:
    """Return the indices of the pairs "link/shape|link/shape" whose two sides two patterns match, either way round."""
    found = []
    for index, pair in enumerate(pairs):
        (a, _, shape_a), (b, _, shape_b) = (side.partition("/") for side in pair.split("|"))
        first, second = patterns
        if (matches(first, a, shape_a) and matches(second, b, shape_b)) or (
            matches(first, b, shape_b) and matches(second, a, shape_a)
        ):
            found.append(index)
    return np.array(found, dtype=np.intp)
