"""URDF 1.0 to 1.2 to a `Robot`, whatever its version attribute says. What the elements mean: wiki.ros.org/urdf/XML."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from replay import limits
from replay.robots.description import (
    Following,
    Geometry,
    Limits,
    Origin,
    Robot,
    RobotBody,
    RobotChange,
    RobotJoint,
    RobotLink,
    Triple,
)
from replay.robots.numbers import number, numbers, size
from replay.robots.xml_text import XACRO, XmlElement, parse

_TYPES = ("fixed", "revolute", "continuous", "prismatic", "floating", "planar")
_OF_A_LINK = {"visual", "collision", "inertial"}
_OF_A_JOINT = {"parent", "child", "origin", "axis", "limit", "mimic", "dynamics", "safety_controller", "calibration"}
_OF_A_BODY = {"origin", "geometry", "material"}
_UNUSED = "is not used: replay moves links along their scripts and knows no forces"


def read(path: Path, data: bytes) -> Robot:
    """Return the robot that a URDF file describes.

    Raises:
        RobotError: it is no URDF, or contradicts itself: the first thing that is wrong, with its line.
    """
    root = parse(path, data, root="robot")
    changes: list[RobotChange] = []
    colors = _colors(root, changes)
    links: dict[str, RobotLink] = {}
    for element in root.all("link"):
        link = _link(element, colors, changes)
        if link.name in links:
            raise element.wrong(
                f"link {link.name!r} is there twice; the first is in line {links[link.name].element.line}"
            )
        links[link.name] = link
    if not links:
        left = next((child for child in root.children if child.tag.startswith(XACRO)), None)
        raise root.wrong(f"the robot has no link{'' if left is None else f', but <{left.tag[:100]}>, which {_MACRO}'}")
    joints: dict[str, RobotJoint] = {}
    for element in root.all("joint"):
        joint = _joint(element, changes)
        if joint.name in joints:
            first = joints[joint.name].element.line
            raise element.wrong(f"joint {joint.name!r} is there twice; the first is in line {first}")
        joints[joint.name] = joint
    top = _root(root, links, joints)
    _check_mimics(joints)
    others = Counter(child.tag for child in root.children if child.tag not in ("link", "joint", "material"))
    changes.extend(_unread(f"{times} x <{tag[:100]}>", "", tag) for tag, times in sorted(others.items()))
    name = root.attributes.get("name", "").strip() or path.stem
    return Robot(name, links, _parents_first(top, joints), top, changes)


_MACRO = "is a macro of xacro that was not expanded: what it stands for is missing"


def _unread(place: str, what: str, tag: str) -> RobotChange:
    """Return what is told of an element that is not read; a macro in it may stand for a body or a joint."""
    macro = tag.startswith(XACRO)
    return RobotChange(place, f"{what} {_MACRO if macro else 'is not used'}".strip(), physical=macro)


def _colors(root: XmlElement, changes: list[RobotChange]) -> dict[str, str]:
    """Return the colours of the materials that the robot itself names."""
    found = {}
    for material in root.all("material"):
        color = _color(material, {}, changes)
        if color is not None:
            found[material.text("name")] = color
    return found


def _color(material: XmlElement | None, known: Mapping[str, str], changes: list[RobotChange]) -> str | None:
    if material is None:
        return None
    written = material.first("color")
    if written is None:
        if material.first("texture") is not None:
            changes.append(RobotChange(f"material {material.attributes.get('name', '')!r}", "its texture is dropped"))
        return known.get(material.attributes.get("name", "").strip())
    shares = [min(max(share, 0.0), 1.0) for share in numbers(written, "rgba", 4)]
    text = "#" + "".join(f"{round(255.0 * share):02x}" for share in shares)
    return text.removesuffix("ff") if len(text) == 9 and text.endswith("ff") else text


def _link(element: XmlElement, colors: Mapping[str, str], changes: list[RobotChange]) -> RobotLink:
    name = element.text("name")
    place = f"link {name}"
    bodies = {kind: tuple(_bodies(element, kind, colors, changes)) for kind in ("collision", "visual")}
    if element.first("inertial") is not None:
        changes.append(RobotChange(place, f"inertia {_UNUSED}"))
    for tag in sorted({child.tag for child in element.children} - _OF_A_LINK):
        changes.append(_unread(place, f"<{tag[:100]}>", tag))
    return RobotLink(name, bodies["collision"], bodies["visual"], element)


def _bodies(link: XmlElement, kind: str, colors: Mapping[str, str], changes: list[RobotChange]) -> list[RobotBody]:
    found = []
    for element in link.all(kind):
        holder = element.first("geometry")
        shapes = [] if holder is None else [child for child in holder.children if child.tag in _SHAPES]
        if holder is None or not shapes:
            held = "" if holder is None or not holder.children else f": <{holder.children[0].tag}> is none"
            rule = f"<{kind}> of link {link.text('name')!r} has no geometry of {', '.join(_SHAPES)}{held}"
            raise element.wrong(rule)
        geometry = _SHAPES[shapes[0].tag](shapes[0])
        color = _color(element.first("material"), colors, changes)
        for tag in sorted({child.tag for child in element.children} - _OF_A_BODY):
            changes.append(RobotChange(f"link {link.text('name')}", f"<{tag[:100]}> of a <{kind}> is not used"))
        found.append(RobotBody(element.attributes.get("name", "").strip(), _origin(element), geometry, color, element))
    return found


def _box(element: XmlElement) -> Geometry:
    sizes = numbers(element, "size", 3)
    if min(sizes) < 0.0:
        raise element.wrong(f"<box> has size={element.text('size')!r}, which is below 0")
    return Geometry("box", sizes)


def _round(element: XmlElement) -> Geometry:
    return Geometry(element.tag, (size(element, "radius"), size(element, "length")))


def _sphere(element: XmlElement) -> Geometry:
    return Geometry("sphere", (size(element, "radius"),))


def _mesh(element: XmlElement) -> Geometry:
    file = element.text("filename")
    if len(element.attributes.get("scale", "").split()) == 1:
        scale = (number(element, "scale"),) * 3
    else:
        scale = _triple(numbers(element, "scale", 3, (1.0, 1.0, 1.0)))
    if 0.0 in scale:
        raise element.wrong(f"<mesh> has scale={element.text('scale')!r}, which leaves it no extent")
    return Geometry("mesh", file=file, scale=scale)


_SHAPES = {"box": _box, "cylinder": _round, "sphere": _sphere, "capsule": _round, "mesh": _mesh}


def _origin(element: XmlElement) -> Origin:
    written = element.first("origin")
    if written is None:
        return Origin()
    zero = (0.0, 0.0, 0.0)
    return Origin(_triple(numbers(written, "xyz", 3, zero)), _triple(numbers(written, "rpy", 3, zero)))


def _triple(values: tuple[float, ...]) -> Triple:
    x, y, z = values
    return x, y, z


def _joint(element: XmlElement, changes: list[RobotChange]) -> RobotJoint:
    name, kind = element.text("name"), element.text("type")
    place = f"joint {name}"
    if kind not in _TYPES:
        raise element.wrong(f"joint {name!r} is of type {kind!r}; URDF has {', '.join(_TYPES)}")
    ends = {}
    for end in ("parent", "child"):
        holder = element.first(end)
        if holder is None:
            raise element.wrong(f"joint {name!r} has no <{end}>")
        ends[end] = holder.text("link")
    axis: Triple = (1.0, 0.0, 0.0)
    written = element.first("axis")
    if written is not None and kind in ("revolute", "continuous", "prismatic"):
        axis = _triple(numbers(written, "xyz", 3, axis))
        if math.hypot(*axis) < 1e-100:
            raise written.wrong(f"joint {name!r} has the axis {written.text('xyz')[:60]}, which has no direction")
    for tag, rule in (
        ("dynamics", "friction and damping: <dynamics> is not used"),
        ("safety_controller", "soft limits: <safety_controller> is not used"),
        ("calibration", "<calibration> is not used"),
    ):
        if element.first(tag) is not None:
            changes.append(RobotChange(place, rule))
    for tag in sorted({child.tag for child in element.children} - _OF_A_JOINT):
        changes.append(_unread(place, f"<{tag[:100]}>", tag))
    limits = _limits(element, name, kind, changes) if kind in ("revolute", "continuous", "prismatic") else Limits()
    origin, mimic = _origin(element), _mimic(element)
    return RobotJoint(name, kind, ends["parent"], ends["child"], origin, axis, element, limits, mimic)


def _limits(joint: XmlElement, name: str, kind: str, changes: list[RobotChange]) -> Limits:
    """Return the limits of a joint; lower and upper are 0 when a <limit> leaves them out."""
    place, limit = f"joint {name}", joint.first("limit")
    if limit is None:
        if kind != "continuous":
            changes.append(RobotChange(place, f"is {kind} without <limit>: it has no limits"))
        return Limits()
    found = Limits()
    if kind != "continuous":
        lower = number(limit, "lower", 0.0, infinite=True)
        upper = number(limit, "upper", 0.0, infinite=True)
        if lower > upper:
            raise limit.wrong(f"joint {name!r} has the lower limit {lower:g} above the upper one {upper:g}")
        found = Limits(lower, upper)
    velocity, acceleration, deceleration = (_rate(limit, rate, name, changes) for rate in RATES)
    if limit.attributes.get("jerk", "").strip():
        changes.append(RobotChange(place, f"jerk is not limited: the limit {limit.text('jerk')[:60]} is dropped", True))
    if number(limit, "effort", 0.0, infinite=True) != 0.0:
        changes.append(RobotChange(place, f"effort {_UNUSED}"))
    return replace(found, velocity=velocity, acceleration=acceleration, deceleration=deceleration)


def _rate(limit: XmlElement, rate: str, joint: str, changes: list[RobotChange]) -> float | None:
    if not limit.attributes.get(rate, "").strip():
        return None
    value = number(limit, rate, infinite=True)
    if value < SLOWEST:
        rule = f"a limit of {rate} of {value:g}, by which nothing moves, is left out"
        changes.append(RobotChange(f"joint {joint}", rule))
    return value if SLOWEST <= value < math.inf else None


RATES = ("velocity", "acceleration", "deceleration")
SLOWEST = 1e-9
"""Smallest limit of velocity and acceleration that the language takes [per s, per s^2]."""


def _mimic(joint: XmlElement) -> Following | None:
    written = joint.first("mimic")
    if written is None:
        return None
    return Following(written.text("joint"), number(written, "multiplier", 1.0), number(written, "offset", 0.0))


def _root(root: XmlElement, links: Mapping[str, RobotLink], joints: Mapping[str, RobotJoint]) -> str:
    """Return the link that all others hang on; RobotError where the links are no tree."""
    carried: dict[str, RobotJoint] = {}
    for joint in joints.values():
        for end in ("parent", "child"):
            if getattr(joint, end) not in links:
                rule = f"joint {joint.name!r} has the {end} {getattr(joint, end)!r}, which is no link of the robot"
                raise joint.element.wrong(rule)
        if joint.child in carried:
            rule = f"link {joint.child!r} is the child of joint {joint.name!r} and of {carried[joint.child].name!r}"
            raise joint.element.wrong(f"{rule}; links form a tree")
        carried[joint.child] = joint
    tops = [name for name in links if name not in carried]
    if not tops:
        raise root.wrong("no link is without a parent: the links go in a circle")
    if len(tops) > 1:
        shown = ", ".join(repr(name) for name in tops[:5]) + (", ..." if len(tops) > 5 else "")
        raise links[tops[1]].element.wrong(f"{len(tops)} links have no parent, {shown}; a robot has one root")
    return tops[0]


def _parents_first(top: str, joints: Mapping[str, RobotJoint]) -> dict[str, RobotJoint]:
    """Return the joints so that each comes after those that carry it; RobotError where some go in a circle."""
    below: dict[str, list[RobotJoint]] = {}
    for joint in joints.values():
        below.setdefault(joint.parent, []).append(joint)
    found: dict[str, RobotJoint] = {}
    waiting = list(reversed(below.get(top, [])))
    while waiting:
        joint = waiting.pop()
        found[joint.name] = joint
        waiting.extend(reversed(below.get(joint.child, [])))
    for joint in joints.values():
        if joint.name not in found:
            raise joint.element.wrong(f"link {joint.child!r} is its own ancestor; links form a tree")
    return found


def _check_mimics(joints: Mapping[str, RobotJoint]) -> None:
    for joint in joints.values():
        chain, follows = {joint.name}, joint.mimic
        while follows is not None:
            if follows.joint not in joints:
                rule = f"joint {joint.name!r} mimics {follows.joint!r}, which is no joint of the robot"
                raise joint.element.wrong(rule)
            if follows.joint in chain:
                raise joint.element.wrong(f"joint {joint.name!r} mimics itself by way of {sorted(chain)[:5]}")
            if len(chain) > limits.ROBOT_DEPTH:
                raise joint.element.wrong(
                    f"joint {joint.name!r} mimics by way of more than {limits.ROBOT_DEPTH} others"
                )
            chain.add(follows.joint)
            follows = joints[follows.joint].mimic
