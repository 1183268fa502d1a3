"""Whether what a scenario expects of its guards holds, judged by what became of each trigger."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from replay.errors import count
from replay.guarding.outcome import Stop
from replay.guarding.part import BeforePart, GuardExpectation

Judged = tuple[str, tuple[str, ...], bool, str]
"""A line of an expectation as people read it, its path from the expectation on, whether it held, and what decided."""


def judge(expected: GuardExpectation, stops: Sequence[Stop]) -> Iterator[Judged]:
    """Yield what became of each line of an expectation.

    Args:
        expected: as it is written.
        stops: of all guards, by time.
    """
    name = expected.guard
    mine = [stop for stop in stops if stop.guard == name]
    if isinstance(expected.stops, BeforePart):
        before = expected.stops.before
        passed = bool(mine) and _rests(mine[0]) and mine[0].held is not None and mine[0].held <= before
        yield f"{name}: stops before {before:.6g} s", ("stops",), passed, _told(mine)
    elif expected.stops is not None:
        passed = not mine if expected.stops == "never" else bool(mine) and all(map(_rests, mine))
        yield f"{name}: stops {expected.stops}", ("stops",), passed, _told(mine)
    if expected.stopping_distance is not None:
        most = expected.stopping_distance.max.value
        ways = [(joint.stopping_distance, joint) for stop in mine for joint in stop.joints]
        late = [stop for stop in mine if stop.held is None]
        detail = (
            _told(mine)
            if not ways
            else "largest stopping distance {:.6g} {} of {}".format(
                *max(((way, joint.unit, joint.joint) for way, joint in ways), key=lambda item: item[0])
            )
        )
        passed = not late and all(way <= most for way, _ in ways)
        detail += f", not at its end in {count(len(late), 'case')}" if late and ways else ""
        yield f"{name}: stopping distance <= {most:.6g}", ("stopping_distance", "max"), passed, detail
    if expected.clearance_at_stop is not None:
        least = expected.clearance_at_stop.min
        nearest = [stop.clearance_at_stop for stop in mine]
        known = [value for value in nearest if value is not None]
        passed = len(known) == len(nearest) and all(value >= least for value in known)
        detail = _told(mine)
        if known:
            smallest = min(known)
            detail = "beyond the margin" if math.isinf(smallest) else f"smallest clearance {smallest:.6g} m"
        met = next((stop for stop in mine if stop.contact is not None), None)
        if met is not None:
            speeds = ", ".join(f"{joint} at {speed:.6g}/s" for joint, speed in met.contact_speed.items())
            detail += f", contact at {met.contact:.6g} s with {speeds}"
        yield f"{name}: clearance at stop >= {least:.6g} m", ("clearance_at_stop", "min"), passed, detail


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
