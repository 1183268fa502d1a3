"""What must hold of guards: what they look at is computed, their joints can be slowed down, units fit."""

from __future__ import annotations

import math
from collections.abc import Iterator

from replay.guarding.part import (
    AllCondition,
    AnyCondition,
    GuardExpectation,
    GuardPart,
    PairCondition,
    ReleasePart,
    SeparationCondition,
)
from replay.language.fields import Part
from replay.language.node import KeyPath
from replay.language.units import (
    ACCELERATION,
    ANGLE,
    ANGULAR_ACCELERATION,
    LENGTH,
    Dimension,
)
from replay.scenario.names import SCALAR_JOINTS, JointName, Names
from replay.scenario.pair_checks import known_clearance, matching_patterns, tested_pairs
from replay.scenario.problems import Finding, did_you_mean
from replay.sensing.kinds import KINDS


def guard_findings(names: Names) -> Iterator[Finding]:
    """Yield everything that does not hold of guards, and of what is expected of them."""
    joints = {joint.name: joint for joint in names.joints if joint.type != "fixed"}
    for name, guard in names.guards.items():
        if guard is None:
            continue
        path: KeyPath = ("guards", name)
        where: KeyPath = ("stop",) if guard.stop is not None else ("slow", "joints")
        for index, joint in enumerate(guard.joints):
            here = (*path, *where, index)
            yield from _slowed(here, joints, joint)
            if joint in guard.joints[:index]:
                yield here, "is there twice"
            if joint in joints and joint not in guard.deceleration:
                yield from _brakes(here, joints[joint])
        for joint in guard.direction:
            yield from _slowed((*path, "direction", joint), joints, joint)
        for joint, rate in guard.deceleration.items():
            if joint in joints and joints[joint].type in SCALAR_JOINTS and rate.dimension is not None:
                wanted = ACCELERATION if joints[joint].type == "prismatic" else ANGULAR_ACCELERATION
                if rate.dimension is not wanted:
                    rule = f"is {rate.dimension.name} where {wanted.name} belongs"
                    kind = f"joint {joint!r} is {joints[joint].type}"
                    yield (*path, "deceleration", joint), f"{rule} ({kind}); {wanted.what_works}"
        dimensions: set[Dimension] = set()
        yield from _condition(names, (*path, "when"), guard.when, dimensions)
        yield from _hysteresis(path, guard, dimensions)
    for index, expected in enumerate(names.expect):
        if isinstance(expected, GuardExpectation):
            yield from _expected(names, ("expect", index), expected, joints)


def _slowed(path: KeyPath, joints: dict[str, JointName], name: str) -> Iterator[Finding]:
    scalar = [joint.name for joint in joints.values() if joint.type in SCALAR_JOINTS]
    joint = joints.get(name)
    if joint is None:
        yield path, f"is no joint that moves; {did_you_mean(name, scalar, what='joints are')}"
    elif joint.type == "free":
        yield path, "is a free joint, whose key frames go on whatever guards do"
    elif joint.scalar is not None and joint.scalar.mimic is not None:
        leader = joint.scalar.mimic.joint
        yield path, f"is a joint that follows {leader!r} and its clock; name the joint that leads"


def _brakes(path: KeyPath, joint: JointName) -> Iterator[Finding]:
    if joint.scalar is None or joint.scalar.mimic is not None:
        return
    limit = joint.scalar.acceleration if joint.scalar.deceleration is None else joint.scalar.deceleration
    if math.isinf(limit):
        rule = f"needs a finite deceleration: joint {joint.name!r} has no limit of it, nor of its acceleration"
        yield path, f"{rule}; give it one, or the guard a deceleration: {{{joint.name}: ...}}"


def _condition(names: Names, path: KeyPath, when: Part, dimensions: set[Dimension]) -> Iterator[Finding]:
    """Find what is wrong with a condition; the dimensions of its thresholds are added to `dimensions`."""
    if isinstance(when, AnyCondition | AllCondition):
        key = "any" if isinstance(when, AnyCondition) else "all"
        for index, part in enumerate(getattr(when, key)):
            yield from _condition(names, (*path, key, index), part, dimensions)
        return
    asked: Part = when
    if isinstance(when, SeparationCondition):
        dimensions.add(LENGTH)
        path, asked = (*path, "separation"), when.separation
    pair = getattr(asked, "pair", None)
    if isinstance(when, PairCondition) and when.clearance is not None:
        dimensions.add(LENGTH)
    if pair is not None:
        found = list(matching_patterns(names, (*path, "pair"), pair))
        yield from found or tested_pairs(names, (*path, "pair"), pair)
    for kind, sensors in names.sensors.items():
        sensor = getattr(asked, kind, None)
        output = KINDS[kind].output
        if not isinstance(sensor, str) or output is None:
            continue
        dimensions.add(output.dimension)
        if sensor not in sensors:
            yield (*path, kind), f"is no {kind} sensor; {did_you_mean(sensor, sensors, what=f'{kind} sensors are')}"
        elif sensors[sensor] is not None and not _senses(names, sensors[sensor]):
            yield (*path, kind), f"never reads anything: sensor {sensor!r} ignores every link that has shapes"


def _senses(names: Names, sensor: Part) -> bool:
    """Return whether a sensor senses any link besides its own."""
    ignored = {link for pattern in getattr(sensor, "ignore", ()) for link in names.links_matching(pattern)}
    return any(shape.link != getattr(sensor, "link", None) and shape.link not in ignored for shape in names.shapes)


def _hysteresis(path: KeyPath, guard: GuardPart, dimensions: set[Dimension]) -> Iterator[Finding]:
    release = guard.release
    if not isinstance(release, ReleasePart) or release.hysteresis is None:
        return
    here = (*path, "release", "hysteresis")
    asked = sorted(dimension.name for dimension in dimensions)
    if not asked:
        yield here, "has no effect: the condition has no threshold"
    elif len(asked) > 1:
        yield here, f"cannot be added to thresholds of {' and '.join(asked)}; use guards of one kind of threshold each"
    elif release.hysteresis.dimension not in (None, *dimensions):
        (wanted,) = dimensions
        assert release.hysteresis.dimension is not None
        rule = f"is {release.hysteresis.dimension.name} where {wanted.name} belongs"
        yield here, f"{rule}, as in the condition; {wanted.what_works}"


def _expected(
    names: Names, path: KeyPath, expected: GuardExpectation, joints: dict[str, JointName]
) -> Iterator[Finding]:
    if expected.guard not in names.guards:
        yield (*path, "guard"), f"is no guard; {did_you_mean(expected.guard, names.guards, what='guards are')}"
        return
    guard = names.guards[expected.guard]
    if expected.stopping_distance is not None and guard is not None:
        bound = expected.stopping_distance.max
        types = {joints[joint].type for joint in guard.joints if joint in joints}
        dimensions = {LENGTH if kind == "prismatic" else ANGLE for kind in types}
        if bound.dimension is not None and dimensions != {bound.dimension}:
            rule = f"is {bound.dimension.name}, and not all joints of the guard go by such"
            yield (*path, "stopping_distance", "max"), f"{rule}; write a number [rad or m], or guards of their own"
    if expected.clearance_at_stop is not None:
        yield from known_clearance(names, (*path, "clearance_at_stop", "min"), expected.clearance_at_stop.min)
