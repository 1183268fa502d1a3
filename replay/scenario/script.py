"""A scenario's links and motion as the kinematics know them, and the limits that only the whole motion can break."""

from __future__ import annotations

import bisect
import re
from collections.abc import Iterator
from dataclasses import replace

from replay.errors import InvalidValue, MotionLimitError, Problem
from replay.kinematics.linkage import Joint, JointType, Link, Linkage, Mimic
from replay.kinematics.motion import Keyframe, Move, Script, check_limits, joint_profiles
from replay.kinematics.profiles import Waypoint
from replay.language.node import KeyPath
from replay.language.units import Dimensioned
from replay.numerics import transforms
from replay.scenario import links
from replay.scenario.model import Scenario
from replay.scenario.motion import KeyframePart, WaypointPart


def linkage(scenario: Scenario) -> Linkage:
    """Return the links and joints of a scenario, each joint with the position that it begins in.

    That is its own `initial`, else the one of the pose that the motion begins in, else the one nearest to 0 that its
    limits and those of its followers allow.
    """
    found = [_link(name, link) for name, link in scenario.links.items()]
    machine = Linkage(found)
    initial = {name: min(max(0.0, lower), upper) for name, (lower, upper) in machine.ranges().items()}
    pose = scenario.poses.get(scenario.motion.initial or "", {})
    initial |= {name: position.value for name, position in pose.items()}
    for name, link in scenario.links.items():
        written = getattr(link.joint, "initial", None)
        if written is not None:
            initial[link.joint.name or name] = written
    for name, mimic in machine.followers.items():
        initial[name] = mimic.multiplier * initial[mimic.joint] + mimic.offset
    begun = (replace(link.joint, initial=initial.get(link.joint.name, 0.0)) for link in found)
    return Linkage([replace(link, joint=joint) for link, joint in zip(found, begun, strict=True)])


def script(scenario: Scenario) -> Script:
    """Return the scripted motion of a scenario."""
    motion = scenario.motion
    return Script(
        points={name: tuple(_waypoint(point) for point in points) for name, points in motion.points.items()},
        moves=tuple(
            Move(
                to={name: target.value for name, target in scenario.target(move).items()},
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
            check_limits(joint, profiles[joint.name], motion.tolerance(joint.name, machine.followers))
        except MotionLimitError as error:
            leader = machine.followers[joint.name].joint if joint.name in machine.followers else joint.name
            follows = f", which follows {leader!r}" if leader != joint.name else ""
            rule = f"breaks a limit: {error}{follows}"
            yield scenario.provenance.problem(_where(scenario, leader, error.time), rule)


def _where(scenario: Scenario, joint: str, time: float) -> KeyPath:
    """Return the path of the entry that moves a joint at a time."""
    points = scenario.motion.points.get(joint)
    if joint in scenario.provenance.tracks:
        return ("motion", "recorded", "joints", joint)
    if points is None:
        moves = (k for k, move in enumerate(scenario.motion.moves) if joint in scenario.target(move))
        move = next(moves, None)
        link = next(name for name, part in scenario.links.items() if (part.joint.name or name) == joint)
        return ("motion", "moves", move) if move is not None else ("links", link, "joint")
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
            deceleration=joint.deceleration,
            mimic=_mimic(joint.mimic),
        )
    if isinstance(joint, links.RevolutePart | links.PrismaticPart):
        result = replace(result, lower=joint.lower, upper=joint.upper)
    return Link(name, link.parent, link.pose.transform(), result)


def _mimic(mimic: links.MimicPart | None) -> Mimic | None:
    return None if mimic is None else Mimic(mimic.joint, mimic.multiplier, mimic.offset.value)


def _waypoint(point: WaypointPart) -> Waypoint:
    return Waypoint(point.time, point.position.value, _value(point.velocity), _value(point.acceleration))


def _value(quantity: Dimensioned | None) -> float | None:
    return None if quantity is None else quantity.value


def _keyframe(key: KeyframePart) -> Keyframe:
    x, y, z, w = (float(value) for value in transforms.to_quaternion(key.transform()))
    return Keyframe(key.time, key.xyz, (x, y, z, w))
