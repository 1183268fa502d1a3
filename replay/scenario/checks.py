"""What must hold between the entries of a scenario: names exist, once, and are used for what they are."""

from __future__ import annotations

from collections.abc import Iterator

from replay.language.node import KeyPath
from replay.language.units import (
    ACCELERATION,
    ANGLE,
    ANGULAR_ACCELERATION,
    ANGULAR_VELOCITY,
    LENGTH,
    VELOCITY,
    Dimension,
    Dimensioned,
)
from replay.scenario.expectations import PairExpectation
from replay.scenario.guard_checks import guard_findings
from replay.scenario.names import SCALAR_JOINTS, JointName, Names
from replay.scenario.pair_checks import known_clearance, matching_patterns, tested_pairs
from replay.scenario.problems import Finding, did_you_mean
from replay.sensing.kinds import KINDS
from replay.sensing.signal.part import sampling_problems


def check(names: Names) -> Iterator[Finding]:
    """Yield everything that does not hold."""
    yield from _links(names)
    yield from _motion(names)
    yield from _sensors(names)
    yield from _disabled(names)
    yield from _expectations(names)
    yield from guard_findings(names)


def _links(names: Names) -> Iterator[Finding]:
    written = names.root.child("links")
    if not names.parents and (written is None or isinstance(written.value, dict)):
        yield ("links",), "must hold at least one link"
    for link, parent in names.parents.items():
        if parent is not None and parent not in names.parents:
            yield ("links", link, "parent"), f"is no link; {did_you_mean(parent, names.parents, what='links are')}"
    yield from _circles(names.parents)
    yield from _mimics(names)
    first: dict[str, JointName] = {}
    for joint in names.joints:
        if joint.type == "fixed":
            continue
        other = first.setdefault(joint.name, joint)
        if other is not joint:
            where = ("links", joint.link, "joint", "name")
            yield where, f"names this joint {joint.name!r} like that of link {other.link!r}; joint names are unique"


def _mimics(names: Names) -> Iterator[Finding]:
    """Find joints that follow none, one that has no position, or themselves."""
    joints = {joint.name: joint for joint in names.joints if joint.type != "fixed"}
    follows = {name: joint.scalar.mimic for name, joint in joints.items() if joint.scalar is not None}
    settled: set[str] = set()
    for name, mimic in follows.items():
        if mimic is None:
            continue
        path: KeyPath = ("links", joints[name].link, "joint", "mimic")
        if mimic.joint in joints and joints[mimic.joint].type == "free":
            yield (*path, "joint"), "is a free joint, which has no position that could be followed"
        else:
            yield from _scalar_joint((*path, "joint"), joints, mimic.joint)
        wrong = _wrong_dimension(mimic.offset, _dimension(joints[name]), joints[name])
        if wrong is not None:
            yield (*path, "offset"), wrong
        chain: dict[str, None] = {}
        above: str | None = name
        while above is not None and above not in settled and above not in chain:
            chain[above] = None
            leader = follows.get(above)
            above = None if leader is None else leader.joint
        settled.update(chain)
        if above is not None and above in chain:
            circle = " -> ".join([*list(chain)[list(chain).index(above) :][:10], above])
            yield (*path, "joint"), f"makes a circle: {circle}; one of these must lead"


def _circles(parents: dict[str, str | None]) -> Iterator[Finding]:
    """Find links that are their own ancestors, each circle once."""
    settled: set[str] = set()
    for link in parents:
        chain: dict[str, None] = {}
        above: str | None = link
        while above is not None and above not in settled and above not in chain:
            chain[above] = None
            above = parents.get(above)
        settled.update(chain)
        if above is not None and above in chain:
            circle = list(chain)[list(chain).index(above) :]
            shown = " -> ".join([*circle[:10], *(["..."] if len(circle) > 10 else []), above])
            yield ("links", above, "parent"), f"makes a circle: {shown}; parents must form trees"


def _motion(names: Names) -> Iterator[Finding]:
    joints = {joint.name: joint for joint in names.joints if joint.type != "fixed"}
    for name, waypoints in names.points.items():
        path: KeyPath = ("motion", "points", name)
        yield from _moved_joint(path, joints, name)
        joint = joints.get(name)
        for index, point in enumerate(waypoints or ()):
            if joint is not None:
                yield from _position((*path, index, "position"), point.position, joint)
                yield from _rate((*path, index, "velocity"), point.velocity, joint, "velocity")
                yield from _rate((*path, index, "acceleration"), point.acceleration, joint, "acceleration")
    for pose, positions in names.poses.items():
        for name, position in (positions or {}).items():
            path = ("poses", pose, name)
            yield from _moved_joint(path, joints, name)
            if name in joints:
                yield from _position(path, position, joints[name])
    if names.initial is not None and names.initial not in names.poses:
        yield ("motion", "initial"), f"is no pose; {did_you_mean(names.initial, names.poses, what='poses are')}"
    for index, move in enumerate(names.moves):
        target = {} if move is None else move.to
        if isinstance(target, str):
            path = ("motion", "moves", index, "to")
            if target not in names.poses:
                yield path, f"is no pose; {did_you_mean(target, names.poses, what='poses are')}"
            for name in names.poses.get(target) or {}:
                yield from _in_a_move(path, joints, names, name, f"moves joint {name!r}, which ")
            continue
        for name, position in target.items():
            path = ("motion", "moves", index, "to", name)
            yield from _moved_joint(path, joints, name)
            if name in joints:
                yield from _position(path, position, joints[name])
            yield from _in_a_move(path, joints, names, name, "")
    free = [joint.name for joint in joints.values() if joint.type == "free"]
    for name in names.free:
        path = ("motion", "free", name)
        if name not in joints:
            yield path, f"is no joint; {did_you_mean(name, free, what='free joints are')}"
        elif joints[name].type in SCALAR_JOINTS:
            yield (
                path,
                f"is a {joints[name].type} joint; motion.free moves free joints, motion.points and moves this one",
            )


def _in_a_move(path: KeyPath, joints: dict[str, JointName], names: Names, name: str, subject: str) -> Iterator[Finding]:
    """Find what keeps a joint from being moved by a move; `subject` goes before what is said of it."""
    if name in joints:
        yield from _has_limits(path, joints[name], subject)
    if name in names.points:
        yield path, f"{subject}is a joint that motion.points moves as well; keep one of the two"


def _moved_joint(path: KeyPath, joints: dict[str, JointName], name: str) -> Iterator[Finding]:
    yield from _scalar_joint(path, joints, name)
    joint = joints.get(name)
    if joint is not None and joint.scalar is not None and joint.scalar.mimic is not None:
        leader = joint.scalar.mimic.joint
        yield path, f"is a joint that follows {leader!r}, which alone moves it; name the joint that leads"


def _scalar_joint(path: KeyPath, joints: dict[str, JointName], name: str) -> Iterator[Finding]:
    scalar = [joint.name for joint in joints.values() if joint.type in SCALAR_JOINTS]
    if name not in joints:
        yield path, f"is no joint that moves; {did_you_mean(name, scalar, what='joints are')}"
    elif joints[name].type == "free":
        yield path, "is a free joint; move it by key frames in motion.free"


def _position(path: KeyPath, position: Dimensioned, joint: JointName) -> Iterator[Finding]:
    if joint.type not in SCALAR_JOINTS:
        return
    expected = _dimension(joint)
    wrong = _wrong_dimension(position, expected, joint)
    if wrong is not None:
        yield path, wrong
    elif joint.scalar is not None and joint.scalar.type != "continuous":
        value, lower, upper = position.value, joint.scalar.lower, joint.scalar.upper
        if value > upper:
            yield path, f"is above the upper limit {upper:.6g} {expected.si} of joint {joint.name!r}"
        elif value < lower:
            yield path, f"is below the lower limit {lower:.6g} {expected.si} of joint {joint.name!r}"


def _rate(path: KeyPath, rate: Dimensioned | None, joint: JointName, limit: str) -> Iterator[Finding]:
    if rate is None or joint.type not in SCALAR_JOINTS:
        return
    linear, angular = (VELOCITY, ANGULAR_VELOCITY) if limit == "velocity" else (ACCELERATION, ANGULAR_ACCELERATION)
    expected = linear if joint.type == "prismatic" else angular
    wrong = _wrong_dimension(rate, expected, joint)
    if wrong is not None:
        yield path, wrong
    elif joint.scalar is not None and abs(rate.value) > getattr(joint.scalar, limit):
        most = getattr(joint.scalar, limit)
        yield path, f"is beyond the {limit} limit {most:.6g} {expected.si} of joint {joint.name!r}"


def _dimension(joint: JointName) -> Dimension:
    return LENGTH if joint.type == "prismatic" else ANGLE


def _wrong_dimension(value: Dimensioned, expected: Dimension, joint: JointName) -> str | None:
    if value.dimension in (None, expected):
        return None
    moves = f"joint {joint.name!r} is {joint.type}"
    assert value.dimension is not None
    return f"is {value.dimension.name} where {expected.name} belongs ({moves}); {expected.what_works}"


def _has_limits(path: KeyPath, joint: JointName, subject: str) -> Iterator[Finding]:
    if joint.scalar is None or joint.scalar.mimic is not None:
        return
    missing = [limit for limit in ("velocity", "acceleration") if getattr(joint.scalar, limit) == float("inf")]
    if missing:
        what = " and ".join(missing)
        yield path, f"{subject}needs a finite {what} limit on joint {joint.name!r}; give it one, or use motion.points"


def _sensors(names: Names) -> Iterator[Finding]:
    for kind, sensors in names.sensors.items():
        for name, sensor in sensors.items():
            if sensor is None:
                continue
            path: KeyPath = ("sensors", kind, name)
            if sensor.link not in names.parents:
                rule = did_you_mean(sensor.link, names.parents, what="links are")
                yield (*path, "link"), f"is no link; {rule}"
            for index, pattern in enumerate(sensor.ignore):
                if not names.links_matching(pattern):
                    rule = did_you_mean(pattern, names.parents, what="links are")
                    yield (*path, "ignore", index), f"matches no link; {rule}"
            signal = getattr(sensor, "signal", None)
            if signal is not None and names.rate is not None:
                yield from (((*path, "signal", key), rule) for key, rule in sampling_problems(signal, names.rate))
            own = [shape.name for shape in names.shapes if shape.link == sensor.link]
            for place, shape in KINDS[kind].own_shapes(sensor).items():
                if shape not in own:
                    rule = did_you_mean(shape, own, what="its shapes are") if own else "it has no shapes"
                    yield (*path, *place), f"is no shape of link {sensor.link!r}; {rule}"


def _disabled(names: Names) -> Iterator[Finding]:
    for index, entry in enumerate(names.disable):
        if entry is None:
            continue
        path: KeyPath = ("collision", "disable", index, "pair")
        found = list(matching_patterns(names, path, entry.pair))
        yield from found
        sides = [names.shapes_matching(pattern) for pattern in entry.pair]
        if not found and not any(a.link != b.link for a in sides[0] for b in sides[1]):
            yield path, f"{list(entry.pair)}: these match no two shapes on different links"


def _expectations(names: Names) -> Iterator[Finding]:
    for index, expected in enumerate(names.expect):
        path: KeyPath = ("expect", index)
        if isinstance(expected, PairExpectation):
            found = list(matching_patterns(names, (*path, "pair"), expected.pair))
            yield from found or tested_pairs(names, (*path, "pair"), expected.pair)
            if expected.clearance is not None:
                yield from known_clearance(names, (*path, "clearance", "min"), expected.clearance.min)
        for kind, sensors in names.sensors.items():
            if isinstance(expected, KINDS[kind].expectation) and getattr(expected, kind) not in sensors:
                rule = did_you_mean(getattr(expected, kind), sensors, what=f"{kind} sensors are")
                yield (*path, kind), f"is no {kind} sensor; {rule}"
            elif isinstance(expected, KINDS[kind].expectation) and getattr(expected, "measured", None) is not None:
                sensor = sensors[getattr(expected, kind)]
                if sensor is not None and sensor.signal is None:
                    rule = f"is measured by no signal chain; give sensors.{kind}.{getattr(expected, kind)} a signal"
                    yield (*path, "measured"), rule
