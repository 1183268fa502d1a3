"""Whether what a scenario expects of its guards holds, judged by what became of each trigger."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from replay.errors import count
from replay.guarding.outcome import Stop
from replay.guarding.part import BeforePart, GuardExpectation
from replay.language.node import KeyPath
from replay.scenario.measures import Measure, finite
from replay.scenario.source import dotted


class GuardJudgement(NamedTuple):
    """A line of an expectation as people read it, its path, whether it held, what decided, and that as a number."""

    text: str
    path: KeyPath
    passed: bool
    detail: str
    measure: Measure


def judge(expected: GuardExpectation, stops: Sequence[Stop], place: KeyPath) -> Iterator[GuardJudgement]:
    """Yield what became of each line of an expectation.

    Args:
        expected: as it is written.
        stops: of all guards, by time.
        place: its path in the scenario.
    """
    name = expected.guard
    mine = [stop for stop in stops if stop.guard == name]
    if isinstance(expected.stops, BeforePart):
        before = expected.stops.before
        passed = bool(mine) and _rests(mine[0]) and mine[0].held is not None and mine[0].held <= before
        path = (*place, "stops", "before")
        held = mine[0].held if mine else None
        margin = None if held is None else before - held
        number = Measure(dotted(path), held, "s", held, name, before, margin)
        yield GuardJudgement(f"{name}: stops before {before:.6g} s", path, passed, _told(mine), number)
    elif expected.stops is not None:
        passed = not mine if expected.stops == "never" else bool(mine) and all(map(_rests, mine))
        path, triggers = (*place, "stops"), float(len(mine))
        most, margin = (0.0, -triggers) if expected.stops == "never" else (None, None)
        number = Measure(dotted(path), triggers, "", mine[0].trigger if mine else None, name, most, margin)
        yield GuardJudgement(f"{name}: stops {expected.stops}", path, passed, _told(mine), number)
    if expected.stopping_distance is not None:
        most = expected.stopping_distance.max.value
        path = (*place, "stopping_distance", "max")
        ways = [(joint.stopping_distance, joint, stop.held) for stop in mine for joint in stop.joints]
        late = [stop for stop in mine if stop.held is None]
        detail, number = _told(mine), Measure(dotted(path), None, "", limit=most)
        if ways:
            way, joint, held = max(ways, key=lambda item: item[0])
            detail = f"largest stopping distance {way:.6g} {joint.unit} of {joint.joint}"
            detail += f", not at its end in {count(len(late), 'case')}" if late else ""
            number = Measure(dotted(path), way, joint.unit, held, joint.joint, most, most - way)
        passed = not late and all(way <= most for way, _, _ in ways)
        yield GuardJudgement(f"{name}: stopping distance <= {most:.6g}", path, passed, detail, number)
    if expected.clearance_at_stop is not None:
        least = expected.clearance_at_stop.min
        nearest = [stop.clearance_at_stop for stop in mine]
        known = [value for value in nearest if value is not None]
        passed = len(known) == len(nearest) and all(value >= least for value in known)
        path, detail = (*place, "clearance_at_stop", "min"), _told(mine)
        number = Measure(dotted(path), None, "m", limit=least)
        if known:
            smallest = min(known)
            held = next(stop.held for stop in mine if stop.clearance_at_stop == smallest)
            number = Measure(dotted(path), finite(smallest), "m", held, name, least, finite(smallest - least))
            detail = "beyond the margin" if math.isinf(smallest) else f"smallest clearance {smallest:.6g} m"
        met = next((stop for stop in mine if stop.contact is not None), None)
        if met is not None:
            speeds = ", ".join(f"{joint} at {speed:.6g}/s" for joint, speed in met.contact_speed.items())
            detail += f", contact at {met.contact:.6g} s with {speeds}"
        yield GuardJudgement(f"{name}: clearance at stop >= {least:.6g} m", path, passed, detail, number)


def lines(stops: Sequence[Stop]) -> list[str]:
    """Return what guards did as lines for people."""
    found = []
    for stop in stops:
        text = f"guard {stop.guard}: triggered at {stop.trigger:.6g} s"
        if stop.held is not None:
            text += f", holds at {stop.held:.6g} s"
            ways = (f"{joint.joint} {joint.stopping_distance:.6g} {joint.unit}" for joint in stop.joints)
            text += f" after {', '.join(ways)}"
        text += "" if stop.released is None else f", let go at {stop.released:.6g} s"
        text += "" if stop.contact is None else f"; contact at {stop.contact:.6g} s"
        found.append(text)
        for joint in stop.joints:
            if joint.excess > 1.0:
                unit = f"{joint.unit}/s^2"
                limit = joint.peak_acceleration / joint.excess
                more = f"{100.0 * (joint.excess - 1.0):.3g} % above its limit {limit:.6g} {unit}"
                found.append(
                    f"guard {stop.guard}: {joint.joint} is accelerated by {joint.peak_acceleration:.6g} {unit}, {more}"
                )
    return found


def _rests(stop: Stop) -> bool:
    return stop.held is not None and all(joint.at_rest for joint in stop.joints)


def _told(stops: Sequence[Stop]) -> str:
    if not stops:
        return "never triggered"
    first = stops[0]
    text = f"triggered {count(len(stops), 'time')}, first at {first.trigger:.6g} s"
    if first.held is None:
        return f"{text}, still braking at the end"
    return f"{text}, {'at rest' if _rests(first) else 'holds'} at {first.held:.6g} s"
