"""A scenario's links and motion as the kinematics know them, and the limits that only the whole motion can break."""

from __future__ import annotations

import bisect
import re
from collections.abc import Iterator
from dataclasses import replace

from replay.errors import InvalidValue, MotionLimitError, Problem
from replay.kinematics.linkage import Joint, JointType, Link, Linkage
from replay.kinematics.motion import Keyframe, Move, Script, check_limits, joint_profiles
from replay.kinematics.profiles import Waypoint
from replay.language.units import Dimensioned
from replay.numerics import transforms
from replay.scenario import links
from replay.scenario.model import Scenario
from replay.scenario.motion import KeyframePart, WaypointPart


def linkage(scenario: Scenario) -> Linkage:
    """Return the links and joints of a scenario."""
    return Linkage([_link(name, link) for name, link in scenario.links.items()])


def script(scenario: Scenario) -> Script:
    """Return the scripted motion of a scenario."""
    motion = scenario.motion
    return Script(
        points={name: tuple(_waypoint(point) for point in points) for name, points in motion.points.items()},
        moves=tuple(
            Move(
                to={name: target.value for name, target in move.to.items()},
                start=move.start,
                speed=move.speed,
                synchronised=move.synchronised,
            )
            for move in motion.moves
        ),
        free={name: tuple(_keyframe(key) for key in keyframes) for name, keyframes in motion.free.items()},
        recorded=scenario.provenance.tracks,
        recorded_free=scenario.provenance.free_tracks,
    )


def motion_problems(scenario: Scenario) -> Iterator[Problem]:
    """Yield where the motion as a whole cannot be done: moves that overlap, limits that are broken on the way."""
    machine, motion = linkage(scenario), script(scenario)
    try:
        profiles = joint_profiles(machine, motion)
    except InvalidValue as error:
        path = tuple(int(step) if step.isdigit() else step for step in re.findall(r"[^.\[\]]+", error.name))
        yield scenario.provenance.problem(path, f"cannot be done: {error.rule}")
        return
    for joint in machine.joints:
        try:
            check_limits(joint, profiles[joint.name], motion.tolerance(joint.name))
        except MotionLimitError as error:
            yield scenario.provenance.problem(_where(scenario, joint.name, error.time), f"breaks a limit: {error}")


def _where(scenario: Scenario, joint: str, time: float) -> tuple[str | int, ...]:
    """Return the path of the entry that moves a joint at a time."""
    points = scenario.motion.points.get(joint)
    if joint in scenario.provenance.tracks:
        return ("motion", "recorded", "joints", joint)
    if points is None:
        return ("motion", "moves", next(k for k, move in enumerate(scenario.motion.moves) if joint in move.to))
    index = bisect.bisect_right([point.time for point in points], time) - 1
    return ("motion", "points", joint, min(max(index, 0), len(points) - 1))


def _link(name: str, link: links.LinkPart) -> Link:
    joint = link.joint
    result = Joint(joint.name or name, JointType(joint.type))
    if isinstance(joint, links.RevolutePart | links.ContinuousPart | links.PrismaticPart):
        result = replace(
            result,
            axis=joint.axis,
            velocity=joint.velocity,
            acceleration=joint.acceleration,
            initial=joint.initial,
        )
    if isinstance(joint, links.RevolutePart | links.PrismaticPart):
        result = replace(result, lower=joint.lower, upper=joint.upper)
    return Link(name, link.parent, link.pose.transform(), result)


def _waypoint(point: WaypointPart) -> Waypoint:
    return Waypoint(point.time, point.position.value, _value(point.velocity), _value(point.acceleration))


def _value(quantity: Dimensioned | None) -> float | None:
    return None if quantity is None else quantity.value


def _keyframe(key: KeyframePart) -> Keyframe:
    x, y, z, w = (float(value) for value in transforms.to_quaternion(key.transform()))
    return Keyframe(key.time, key.xyz, (x, y, z, w))
