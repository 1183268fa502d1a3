"""Limits of joints that a description does not have: MoveIt's joint_limits.yaml, and accelerations that are given."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

from replay.errors import Problem, RobotError, ScenarioError
from replay.language.node import Node
from replay.language.units import ACCELERATION, ANGULAR_ACCELERATION, Dimension, quantity_rule
from replay.robots.description import Limits, Robot, RobotChange, RobotJoint
from replay.robots.urdf import RATES, SLOWEST
from replay.scenario.yaml_text import parse


def accelerations(texts: Iterable[str]) -> dict[Dimension, float]:
    """Return the acceleration of joints that turn [rad/s^2] and of joints that slide [m/s^2], as given with units.

    Raises:
        RobotError: a text is no acceleration with its unit, not positive, or the second one of its kind.
    """
    found: dict[Dimension, float] = {}
    for text in texts:
        result = quantity_rule(text, (ANGULAR_ACCELERATION, ACCELERATION))
        if isinstance(result, str):
            raise RobotError("--acceleration", f"{text!r} {result}")
        value, dimension = result
        if not SLOWEST <= value <= 10**12:
            raise RobotError("--acceleration", f"{text!r} must be between 1e-9 and 1e12 {dimension.si}")
        if dimension in found:
            raise RobotError("--acceleration", f"{text!r} is {dimension.name} like one before it; give one of a kind")
        found[dimension] = float(value)
    return found


def accelerated(robot: Robot, given: dict[Dimension, float]) -> None:
    """Give accelerations to the joints of a robot that have none; what is still missing is told in its changes."""
    missing = []
    for name, joint in robot.joints.items():
        if joint.moves and joint.limits.acceleration is None:
            value = given.get(ACCELERATION if joint.type == "prismatic" else ANGULAR_ACCELERATION)
            robot.joints[name] = replace(joint, limits=replace(joint.limits, acceleration=value))
            if value is None and joint.mimic is None:
                missing.append(name)
    if missing:
        shown = ", ".join(missing[:10]) + (", ..." if len(missing) > 10 else "")
        rule = "have no limit of acceleration, which moves need; --acceleration or --limits gives one"
        robot.changes.append(RobotChange(f"joints {shown}", rule))


def limited(robot: Robot, path: Path, data: bytes) -> None:
    """Replace limits of a robot's joints by those of a joint_limits.yaml; what it cannot is told in its changes.

    Raises:
        RobotError: the file is not of that form.
        ScenarioError: it is not YAML.
    """
    problems: list[Problem] = []
    root = parse(data, str(path), problems)
    if problems:
        raise ScenarioError(problems)
    joints = None if root is None else root.child("joint_limits")
    if joints is None or not isinstance(joints.value, dict):
        raise RobotError(str(path), "has no joint_limits: {JOINT: {has_velocity_limits: true, max_velocity: 1}, ...}")
    for name, entry in joints.mapping.items():
        if name not in robot.joints or not robot.joints[name].moves:
            kind = "no joint" if name not in robot.joints else f"a {robot.joints[name].type} joint"
            robot.changes.append(RobotChange(f"joint {name}", f"of {path.name} is {kind} of the robot: left out"))
            continue
        joint = robot.joints[name]
        robot.joints[name] = replace(joint, limits=_limits(joint, entry, robot))


def _limits(joint: RobotJoint, entry: Node, robot: Robot) -> Limits:
    """Return the limits of a joint with those replaced that an entry has."""
    place, found = f"joint {joint.name}", joint.limits
    rates = {rate: getattr(found, rate) for rate in RATES}
    for rate in RATES:
        if _has(entry, rate):
            value = abs(_number(entry, f"max_{rate}"))
            if value < SLOWEST:
                robot.changes.append(
                    RobotChange(place, f"a limit of {rate} of {value:g}, by which nothing moves, is left out")
                )
            else:
                rates[rate] = value
    if _has(entry, "jerk"):
        robot.changes.append(RobotChange(place, "jerk is not limited: the limit of the joint limits is dropped", True))
    if _has(entry, "position") and joint.type != "continuous":
        lower, upper = _number(entry, "min_position"), _number(entry, "max_position")
        if lower > upper:
            raise _wrong(entry, "min_position", f"is above max_position {upper:g}")
        found = replace(found, lower=lower, upper=upper)
    return Limits(found.lower, found.upper, *(rates[rate] for rate in RATES))


def _has(entry: Node, kind: str) -> bool:
    node = entry.child(f"has_{kind}_limits")
    if node is not None and not isinstance(node.value, bool):
        raise _wrong(entry, f"has_{kind}_limits", "must be true or false")
    return node is not None and node.value is True


def _number(entry: Node, key: str) -> float:
    node = entry.child(key)
    value: Any = None if node is None else node.value
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) <= 10**12:
        raise _wrong(entry, key, "must be a number between -1e12 and 1e12")
    return float(value)


def _wrong(entry: Node, key: str, rule: str) -> RobotError:
    node = entry.child(key)
    place = entry.place if node is None else node.place
    return RobotError(place.file, f"{key} {rule}" if node is not None else f"{key} is missing", line=place.line)
