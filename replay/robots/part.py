"""A robot as a part of the language: what its links, joints, bodies, poses and disabled pairs are written as."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Final

from replay import limits
from replay.robots.description import Geometry, Limits, Origin, Robot, RobotBody, RobotChange, RobotJoint, RobotLink
from replay.robots.meshes import RobotMeshes
from replay.robots.names import RobotNames
from replay.robots.srdf import Semantics, rigid_pairs

RIGID: Final = "rigid to each other"
SMALLEST: Final = 1e-9
"""Smallest size of a shape [m] that the language takes."""

Entry = dict[str, Any]


@dataclass
class RobotPart:
    """What the part holds, in the order in which it is written.

    Attributes:
        links: by name, as in the language.
        poses: position by joint, by name of the pose.
        disabled: (link, link, reason).
        called: what each link of the robot is called.
        changes: what is not as the description says.
    """

    links: dict[str, Entry] = field(default_factory=dict)
    poses: dict[str, dict[str, float]] = field(default_factory=dict)
    disabled: list[tuple[str, str, str]] = field(default_factory=list)
    called: dict[str, str] = field(default_factory=dict)
    changes: list[RobotChange] = field(default_factory=list)


def make(
    robot: Robot,
    semantics: Semantics,
    meshes: RobotMeshes,
    *,
    prefix: str = "",
    root_pose: Origin | None = None,
    visual: bool = False,
) -> RobotPart:
    """Return a robot as a part.

    Args:
        robot: as read, limits completed.
        semantics: pairs and states.
        meshes: names its mesh files.
        prefix: goes before the names of links, joints and poses.
        root_pose: where the root link stands in the world.
        visual: whether links without collision bodies get what they show.

    Raises:
        RobotError: a mesh file is not to be found or not read.
        MissingPackageError: a mesh needs a package that is not installed.
    """
    links, joints, poses = RobotNames(prefix), RobotNames(prefix), RobotNames(prefix)
    part = RobotPart(called={link: links.take(link) for link in robot.links})
    for joint in robot.joints.values():
        joints.take(joint.name)
    carried = {joint.child: joint for joint in _without_conflicts(robot, part.changes).values()}
    for name, link in robot.links.items():
        entry: Entry = {}
        if name in carried:
            entry = _joint(carried[name], links, joints, robot, part.changes)
        elif root_pose is not None:
            entry = {"pose": _pose(root_pose)}
        shapes = _shapes(link, meshes, visual, part.changes)
        part.links[links[name]] = entry | ({"shapes": shapes} if shapes else {})
    for state, positions in semantics.states.items():
        part.poses[poses.take(state)] = {joints[joint]: value for joint, value in positions.items()}
    part.disabled.extend(_disabled(robot, semantics, part))
    for kind, names in (("link", links), ("joint", joints), ("state", poses)):
        part.changes.extend(names.changes(kind))
    return part


def _pose(origin: Origin) -> Entry:
    entry: Entry = {}
    if any(origin.xyz):
        entry["xyz"] = list(origin.xyz)
    if any(origin.rpy):
        entry["rpy"] = list(origin.rpy)
    return entry


def _joint(joint: RobotJoint, links: RobotNames, joints: RobotNames, robot: Robot, changes: list[RobotChange]) -> Entry:
    entry: Entry = {"parent": links[joint.parent]}
    if pose := _pose(joint.origin):
        entry["pose"] = pose
    if joint.type in ("floating", "planar"):
        if joint.type == "planar":
            rule = "is planar and becomes free: nothing keeps it in its plane"
            changes.append(RobotChange(f"joint {joint.name}", rule, True))
        entry["joint"] = {"name": joints[joint.name], "type": "free"}
    elif joint.moves:
        written: Entry = {"name": joints[joint.name], "type": joint.type, "axis": list(joint.axis)}
        if joint.type != "continuous":
            written |= {
                limit: getattr(joint.limits, limit)
                for limit in ("lower", "upper")
                if math.isfinite(getattr(joint.limits, limit))
            }
        for rate in ("velocity", "acceleration", "deceleration"):
            if getattr(joint.limits, rate) is not None:
                written[rate] = getattr(joint.limits, rate)
        if joint.mimic is not None:
            mimic: Entry = {"joint": joints[joint.mimic.joint]}
            mimic |= {"multiplier": joint.mimic.multiplier} if joint.mimic.multiplier != 1.0 else {}
            mimic |= {"offset": joint.mimic.offset} if joint.mimic.offset != 0.0 else {}
            written["mimic"] = mimic
        entry["joint"] = written
    return entry


def _without_conflicts(robot: Robot, changes: list[RobotChange]) -> Mapping[str, RobotJoint]:
    """Return the joints, those that follow none that has a position held where they are.

    Limits of joints that follow are left out where their leader could be nowhere with them, or in one place alone.
    """
    found = dict(robot.joints)
    for name, joint in robot.joints.items():
        place = f"joint {name}"
        if joint.mimic is None or not joint.moves:
            if joint.mimic is not None:
                changes.append(RobotChange(place, f"is {joint.type}: <mimic> is dropped"))
                found[name] = replace(joint, mimic=None)
            continue
        if not robot.joints[joint.mimic.joint].moves:
            held = joint.mimic.offset
            changes.append(
                RobotChange(place, f"mimics {joint.mimic.joint}, which has no position: it is held at {held:g}")
            )
            kind = "revolute" if joint.type == "continuous" else joint.type
            found[name] = replace(joint, mimic=None, type=kind, limits=Limits(held, held))
    room = {name: (joint.limits.lower, joint.limits.upper) for name, joint in found.items() if joint.mimic is None}
    for name, joint in found.items():
        if joint.mimic is None:
            continue
        leader, multiplier, offset = _leader(found, joint)
        if multiplier != 0.0:
            ends = sorted((bound - offset) / multiplier for bound in (joint.limits.lower, joint.limits.upper))
            lower, upper = max(room[leader][0], ends[0]), min(room[leader][1], ends[1])
            fits = lower < upper or (lower == upper and room[leader][0] == room[leader][1])
        else:
            lower, upper = room[leader]
            fits = joint.limits.lower <= offset <= joint.limits.upper
        if fits:
            room[leader] = (lower, upper)
        else:
            rule = f"its limits {joint.limits.lower:g} and {joint.limits.upper:g} are dropped"
            changes.append(
                RobotChange(f"joint {name}", f"{rule}: they leave nowhere to go to {leader}, which it follows", True)
            )
            found[name] = replace(joint, limits=replace(joint.limits, lower=-math.inf, upper=math.inf))
    return found


def _leader(joints: Mapping[str, RobotJoint], joint: RobotJoint) -> tuple[str, float, float]:
    """Return what a joint follows in the end, and how."""
    name, multiplier, offset = joint.name, 1.0, 0.0
    while (mimic := joints[name].mimic) is not None:
        multiplier, offset = multiplier * mimic.multiplier, multiplier * mimic.offset + offset
        name = mimic.joint
    return name, multiplier, offset


def _shapes(link: RobotLink, meshes: RobotMeshes, visual: bool, changes: list[RobotChange]) -> dict[str, Entry]:
    """Return the shapes of a link by name: what collides, or what it shows where it is asked for and nothing does."""
    bodies, place = link.collisions, f"link {link.name}"
    if not bodies and link.visuals:
        if visual:
            bodies = link.visuals
            changes.append(RobotChange(place, "has no collision body: what it shows collides"))
        else:
            rule = "shows a body that does not collide and is left out; --collision visual takes what is shown"
            changes.append(RobotChange(place, rule, True))
    shown = next((body.color for body in link.visuals if body.color), None)
    names, found = RobotNames(), {}
    for body in bodies:
        geometry = body.geometry
        if geometry.kind != "mesh" and min(geometry.sizes) < SMALLEST and not _is_ball(geometry):
            if max(geometry.sizes) >= SMALLEST:
                sizes = " ".join(f"{value:g}" for value in geometry.sizes)
                changes.append(RobotChange(place, f"a {geometry.kind} of {sizes} m has no volume: it is dropped", True))
            else:
                changes.append(RobotChange(place, f"a {geometry.kind} without any extent is dropped"))
            continue
        stem = geometry.file.rpartition("/")[2].rpartition(".")[0] if geometry.file else ""
        entry = _shape(body, meshes)
        if pose := _pose(body.origin):
            entry["pose"] = pose
        if color := body.color or shown:
            entry["color"] = color
        found[names.take(body.name or stem or geometry.kind)] = entry
    return found


def _is_ball(geometry: Geometry) -> bool:
    """Return whether it is a capsule whose cylinder has no length."""
    return geometry.kind == "capsule" and geometry.sizes[0] >= SMALLEST


def _shape(body: RobotBody, meshes: RobotMeshes) -> Entry:
    geometry = body.geometry
    match geometry.kind:
        case "box":
            return {"type": "cuboid", "size": list(geometry.sizes)}
        case "sphere":
            return {"type": "sphere", "radius": geometry.sizes[0]} | _chord(geometry.sizes[0])
        case "capsule" if geometry.sizes[1] < SMALLEST:
            return {"type": "sphere", "radius": geometry.sizes[0]} | _chord(geometry.sizes[0])
        case "cylinder" | "capsule":
            radius, height = geometry.sizes
            return {"type": geometry.kind, "radius": radius, "height": height} | _chord(radius)
        case _:
            x, y, z = geometry.scale
            scale: Any = x if x == y == z and x > 0.0 else [x, y, z]
            return {"type": "mesh", "file": meshes.name(geometry.file, body.element), "scale": scale}


def _chord(radius: float) -> Entry:
    """Return the chord error where 1 mm, as of a shape that leaves it out, is coarse or finer than what is taken."""
    if 0.05 <= radius <= 100.0:
        return {}
    return {"chord_error": float(f"{radius * (0.02 if radius < 0.05 else 1e-4):.3g}")}


def _disabled(robot: Robot, semantics: Semantics, part: RobotPart) -> Iterator[tuple[str, str, str]]:
    """Yield the pairs that need no test: of the SRDF, and of links that are rigid to each other."""
    order = {link: place for place, link in enumerate(robot.links)}
    bodies = {link for link, called in part.called.items() if "shapes" in part.links[called]}
    bare = 0
    for pair, reason in semantics.disabled.items():
        a, b = sorted(pair, key=order.__getitem__)
        if pair <= bodies:
            yield part.called[a], part.called[b], reason
        else:
            bare += 1
    if bare:
        part.changes.append(RobotChange("disabled pairs", f"{bare} of the SRDF have a link without bodies: left out"))
    for number, (a, b) in enumerate(rigid_pairs(robot, bodies)):
        if number >= limits.ROBOT_PAIRS:
            rule = f"has more than the {limits.ROBOT_PAIRS} pairs of links in one rigid part that are written"
            raise robot.links[robot.root].element.wrong(f"the robot {rule}")
        if frozenset((a, b)) not in semantics.disabled:
            yield part.called[a], part.called[b], RIGID
