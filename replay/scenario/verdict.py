"""Whether a scenario's expectations hold, followed block by block while results stream past."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from replay.collision.columns import CollisionColumns, Level
from replay.scenario.expectations import Between, CapacitiveExpectation, DistanceExpectation, PairExpectation
from replay.scenario.layout import Layout
from replay.scenario.names import matches
from replay.scenario.node import Place
from replay.scenario.source import Provenance
from replay.scenario.tallies import Begin, Count, Extremes, Tally, Times, Values
from replay.sensing.columns import CapacitiveColumns, Detection, DistanceColumns


@dataclass(frozen=True)
class Outcome:
    """What became of one line of an expectation.

    Attributes:
        expectation: as people read it: `detector* | patient*: contact never`.
        place: where it is written; None when the scenario was not read from text.
        passed: whether it held.
        detail: the values and times that decided.
    """

    expectation: str
    place: Place | None
    passed: bool
    detail: str


@dataclass(frozen=True)
class _Block:
    collision: CollisionColumns | None
    distance: DistanceColumns | None
    capacitive: CapacitiveColumns | None


@dataclass
class _Check:
    """One line of an expectation: what is taken from each block, and what is kept of it."""

    text: str
    path: tuple[str | int, ...]
    what: str
    take: Callable[[_Block], Values]
    state: Tally


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
        expectations: Sequence[PairExpectation | DistanceExpectation | CapacitiveExpectation],
        layout: Layout,
        *,
        clearance: str = "near",
        margin: float = math.inf,
        provenance: Provenance | None = None,
    ) -> None:
        self._layout = layout
        self._clearance = clearance
        self._margin = margin
        self._provenance = provenance or Provenance()
        self._checks: list[_Check] = []
        for index, expectation in enumerate(expectations):
            if isinstance(expectation, PairExpectation):
                self._add_pairs(("expect", index), expectation)
            elif isinstance(expectation, DistanceExpectation):
                self._add_distance(("expect", index), expectation)
            else:
                self._add_capacitive(("expect", index), expectation)

    def update(
        self,
        time_ns: Times,
        collision: CollisionColumns | None,
        distance: DistanceColumns | None,
        capacitive: CapacitiveColumns | None,
    ) -> None:
        """Take the results of the next n frames, at times (n,) [ns]."""
        block = _Block(collision, distance, capacitive)
        for check in self._checks:
            check.state.update(time_ns, check.take(block))

    def finish(self) -> list[Outcome]:
        """Return what became of each line, in the order they are written."""
        outcomes = []
        for check in self._checks:
            passed, detail = check.state.result(check.what)
            outcomes.append(Outcome(check.text, self._provenance.place(check.path), passed, detail))
        return outcomes

    def _add_pairs(self, path: tuple[str | int, ...], expected: PairExpectation) -> None:
        columns = matching_pairs(self._layout.pairs, expected.pair)
        about = " | ".join(expected.pair)

        def reaches(level: Level) -> Callable[[_Block], Values]:
            def take(block: _Block) -> Values:
                assert block.collision is not None
                reached: Values = np.any(block.collision.level[:, columns] >= level, axis=1).astype(np.float64)
                return reached

            return take

        if isinstance(expected.contact, Between):
            begin, end = expected.contact.between
            window = (round(begin * 1e9), round(end * 1e9))
            text = f"{about}: contact begins between {begin:.6g} s and {end:.6g} s"
            self._checks.append(_Check(text, (*path, "contact"), "contact", reaches(Level.CONTACT), Begin(window)))
        elif expected.contact is not None:
            text = f"{about}: contact {expected.contact}"
            state = Count(expected.contact)
            self._checks.append(_Check(text, (*path, "contact"), "contact", reaches(Level.CONTACT), state))
        if expected.bounds is not None:
            text, state = f"{about}: bounds {expected.bounds}", Count(expected.bounds)
            self._checks.append(_Check(text, (*path, "bounds"), "bounds meet", reaches(Level.BOUNDS), state))
        if expected.clearance is not None:
            least = expected.clearance.min

            def clearance(block: _Block) -> Values:
                assert block.collision is not None
                part = block.collision.clearance[:, columns]
                known = block.collision.evaluated[:, columns]
                values = np.where(known, part, math.inf)
                values = np.where(block.collision.level[:, columns] == Level.CONTACT, 0.0, values)
                smallest = np.min(values, axis=1, initial=math.inf)
                unknown = np.isinf(smallest) | (complete & ~known.all(axis=1) & (smallest > 0.0))
                result: Values = np.where(unknown, math.nan, smallest)
                return result

            complete = self._clearance != "near" or least > self._margin
            bounds = Extremes("m", low=least, complete=complete)
            text = f"{about}: clearance >= {least:.6g} m"
            self._checks.append(_Check(text, (*path, "clearance"), "clearance", clearance, bounds))

    def _add_distance(self, path: tuple[str | int, ...], expected: DistanceExpectation) -> None:
        column = self._layout.distance_sensors.index(expected.distance)

        def reading(block: _Block) -> Values:
            assert block.distance is not None
            return block.distance.distance[:, column]

        def detected(block: _Block) -> Values:
            assert block.distance is not None
            found: Values = (block.distance.status[:, column] != Detection.NOTHING).astype(np.float64)
            return found

        for key, bound, symbol in (("min", expected.min, ">="), ("max", expected.max, "<=")):
            if bound is not None:
                state = Extremes("m", low=bound if key == "min" else None, high=bound if key == "max" else None)
                text = f"{expected.distance}: distance {symbol} {bound:.6g} m"
                self._checks.append(_Check(text, (*path, key), "distance", reading, state))
        if expected.detected is not None:
            text = f"{expected.distance}: detected {expected.detected}"
            check = _Check(text, (*path, "detected"), "detected", detected, Count(expected.detected))
            self._checks.append(check)

    def _add_capacitive(self, path: tuple[str | int, ...], expected: CapacitiveExpectation) -> None:
        column = self._layout.capacitive_sensors.index(expected.capacitive)

        def output(block: _Block) -> Values:
            assert block.capacitive is not None
            return block.capacitive.output_voltage[:, column]

        def saturated(block: _Block) -> Values:
            assert block.capacitive is not None
            return block.capacitive.saturated[:, column].astype(np.float64)

        limits = expected.output
        for key, symbol in (("min", ">="), ("max", "<=")):
            bound = None if limits is None else getattr(limits, key)
            if bound is not None:
                state = Extremes("V", low=bound if key == "min" else None, high=bound if key == "max" else None)
                text = f"{expected.capacitive}: output {symbol} {bound:.6g} V"
                self._checks.append(_Check(text, (*path, "output", key), "output", output, state))
        if expected.saturated is not None:
            text = f"{expected.capacitive}: saturated {expected.saturated}"
            check = _Check(text, (*path, "saturated"), "saturated", saturated, Count(expected.saturated))
            self._checks.append(check)


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
