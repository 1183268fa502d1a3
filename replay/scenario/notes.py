"""What a reader should know of a scenario although it is valid: what its end cuts off, short logs, what frames miss."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from functools import partial
from typing import TYPE_CHECKING

from replay.errors import Problem, count
from replay.guarding.part import ReleasePart, parts_of, sensors_of
from replay.language.fields import Part
from replay.scenario.expectations import BetweenPart, PairExpectation
from replay.scenario.names import matches
from replay.scenario.unit_slips import beyond_a_turn
from replay.sensing.kinds import KINDS

if TYPE_CHECKING:
    from replay.collision.pairs import CollisionBody
    from replay.geometry.solid import Solid
    from replay.scenario.methods import Model
    from replay.scenario.model import Scenario


def notes(
    scenario: Scenario, *, model: Model | None = None, solids: Mapping[tuple[str, str], Solid] | None = None
) -> list[Problem]:
    """Return the notes on a scenario, each with its place.

    Args:
        scenario: as loaded.
        model: replaces the scenario's own.
        solids: shapes by link and name, in the links' frames; all that need no mesh file when left out.
    """
    end = float(scenario.duration)
    after = f"after the scenario's end at {end:.6g} s"
    problem = scenario.provenance.problem
    found = []
    times = {("points", joint): [point.time for point in points] for joint, points in scenario.motion.points.items()}
    times |= {("free", joint): [key.time for key in keys] for joint, keys in scenario.motion.free.items()}
    for (kind, joint), seconds in times.items():
        late = [index for index, time in enumerate(seconds) if time > end]
        if late:
            more = f", and {len(late) - 1} more" if len(late) > 1 else ""
            found.append(problem(("motion", kind, joint, late[0], "time"), f"is {after}{more}"))
    for index, moved_until in _late_moves(scenario, end):
        found.append(problem(("motion", "moves", index), f"ends at {moved_until:.6g} s, {after}"))
    found.extend(scenario.provenance.log_notes)
    found.extend(_short_logs(scenario))
    for index, expected in enumerate(scenario.expect):
        window = expected.contact if isinstance(expected, PairExpectation) else None
        if isinstance(window, BetweenPart) and window.between[1] > end:
            found.append(problem(("expect", index, "contact", "between", 1), f"is {after}"))
    found.extend(beyond_a_turn(scenario))
    found.extend(_sensor_notes(scenario, model or scenario.model))
    found.extend(_guard_notes(scenario))
    if (model or scenario.model).collision.between == "sampled":
        from replay.scenario.scene import primitive_solids
        from replay.scenario.speed_notes import speed_notes

        found.extend(speed_notes(scenario, primitive_solids(scenario) if solids is None else solids))
    return found


def sensor_faults(scenario: Scenario, model: Model) -> list[Problem]:
    """Return what of the sensors a model cannot compute, each with its place."""
    return [
        scenario.provenance.problem(("sensors", kind.name, *path), rule)
        for kind in KINDS.values()
        for path, rule in kind.faults(
            scenario.sensors.of(kind.name), partial(_felt, scenario, kind.name), getattr(model, kind.name)
        )
    ]


def _felt(scenario: Scenario, kind: str) -> dict[str, list[str]]:
    """Return the links that each sensor of a kind senses."""
    sensed = [name for name, link in scenario.links.items() if any(shape.sense for shape in link.shapes.values())]
    return {
        name: [
            link
            for link in sensed
            if link != sensor.link and not any(matches(pattern, link) for pattern in sensor.ignore)
        ]
        for name, sensor in scenario.sensors.of(kind).items()
    }


def _sensor_notes(scenario: Scenario, model: Model) -> Iterator[Problem]:
    earth = {name: link.earth for name, link in scenario.links.items()}
    for kind in KINDS.values():
        written, felt = scenario.sensors.of(kind.name), _felt(scenario, kind.name)
        for path, rule in kind.notes(written, felt, earth, getattr(model, kind.name)):
            yield scenario.provenance.problem(("sensors", kind.name, *path), rule)


def _guard_notes(scenario: Scenario) -> Iterator[Problem]:
    """Yield guards that could let go, but hold all that could end their condition."""
    from replay.scenario.script import linkage

    releasing = {
        name: guard
        for name, guard in scenario.guards.items()
        if guard.stop is not None and isinstance(guard.release, ReleasePart)
    }
    machine = linkage(scenario) if releasing else None
    for name, guard in releasing.items():
        assert machine is not None
        moving = set()
        for a, b in _looked_at(scenario, guard.when):
            chains = machine.chains_to_common_ancestor(machine.link_index(a), machine.link_index(b))
            joints = [machine.links[k].joint for chain in chains for k in chain]
            moving |= {joint.name for joint in joints if joint.type.value != "fixed"}
        leaders = {machine.followers[joint].joint if joint in machine.followers else joint for joint in moving}
        if leaders <= set(guard.joints):
            rule = "has no effect: the condition depends on joints that the guard holds, and on no others"
            yield scenario.provenance.problem(("guards", name, "release"), rule)


def _looked_at(scenario: Scenario, when: Part) -> Iterator[tuple[str, str]]:
    """Yield the two links of all that a condition looks at."""
    for part in parts_of(when):
        asked = getattr(part, "separation", part)
        pair = getattr(asked, "pair", None)
        shapes = [(link, shape) for link, entry in scenario.links.items() for shape in entry.shapes]
        if pair is not None:
            sides = [{link for link, shape in shapes if matches(side, link, shape)} for side in pair]
            yield from ((a, b) for a in sides[0] for b in sides[1] if a != b)
        for kind, name in sensors_of(part):
            sensor = scenario.sensors.of(kind)[name]
            sensed = {link for link, _ in shapes if not any(matches(pattern, link) for pattern in sensor.ignore)}
            yield from ((sensor.link, link) for link in sorted(sensed - {sensor.link}))


def piece_notes(bodies: Sequence[CollisionBody], pieces: str) -> list[str]:
    """Return what convex pieces cost each body that they only approximate, one line each."""
    if pieces != "convex":
        return []
    from replay.geometry.decomposition import closed_cavities, decompose

    found = []
    for body in bodies:
        if body.solid.pieces:
            continue
        parts, cavities = decompose(body.solid), closed_cavities(body.solid)
        costs = [] if math.isnan(parts.volume_error) else [f"{100.0 * parts.volume_error:+.2g} % of its volume"]
        costs.append(f"up to {parts.protrusion:.2g} m beyond its surface")
        costs.append(f"up to {parts.missed:.2g} m of it missed")
        if cavities:
            costs.append("a closed cavity filled" if cavities == 1 else f"{cavities} closed cavities filled")
        found.append(f"{body.name} collides as {count(len(parts.pieces), 'convex piece')}: {', '.join(costs)}")
    return found


def touching_note(pairs: Sequence[str]) -> list[str]:
    """Return what is said of pairs "link/shape|link/shape" in contact in the first frame, and YAML to disable them."""
    verb = "is" if len(pairs) == 1 else "are"
    rule = f"{verb} in contact in the first frame; where they may be, write below collision.disable:"
    sides = (pair.split("|") for pair in pairs)
    return [
        f"{count(len(pairs), 'pair')} {rule}",
        *(f"    - {{pair: [{a}, {b}], reason: in contact from the first frame}}" for a, b in sides),
    ]


def _late_moves(scenario: Scenario, end: float) -> Iterator[tuple[int, float]]:
    """Yield the last move of each joint that still moves at the end, and when it ends [s]."""
    from replay.kinematics.motion import joint_profiles
    from replay.scenario.script import linkage, script

    moves = scenario.motion.moves
    profiles = joint_profiles(linkage(scenario), script(scenario)) if moves else {}
    late: dict[int, float] = {}
    targets = [scenario.target(move) for move in moves]
    for joint in {name for target in targets for name in target}:
        seconds = max(profiles[joint].end, default=0.0)
        if seconds > end + 1e-9:
            index = max(index for index, target in enumerate(targets) if joint in target)
            late[index] = max(seconds, late.get(index, 0.0))
    yield from sorted(late.items())


def _short_logs(scenario: Scenario) -> Iterator[Problem]:
    last = float(Fraction(scenario.frames - 1) / Fraction(scenario.rate))
    ends = {joint: float(track.seconds[-1]) for joint, track in scenario.provenance.tracks.items()}
    ends |= {joint: float(track.seconds[-1]) for joint, track in scenario.provenance.free_tracks.items()}
    short = [f"{joint} at {seconds:.6g} s" for joint, seconds in sorted(ends.items()) if seconds < last - 1e-9]
    if short:
        rule = f"ends before the scenario's last frame at {last:.6g} s: {', '.join(short)}; the last positions hold"
        yield scenario.provenance.problem(("motion", "recorded", "file"), rule)
