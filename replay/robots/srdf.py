"""SRDF: which pairs need no test, and named states of groups. What the elements mean: moveit.picknik.ai."""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Container, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from replay.robots.description import Robot, RobotChange
from replay.robots.numbers import number
from replay.robots.xml_text import XmlElement, parse

Pair = frozenset[str]


@dataclass
class Semantics:
    """What an SRDF file says of a robot, all names known.

    Attributes:
        disabled: the reason by pair of links that need no test.
        states: positions by joint, by the name of the state.
        unknown: line and tag of the element that first names it, by name of a link that the robot does not have.
        changes: names that the robot does not have, and what is not used.
    """

    disabled: dict[Pair, str] = field(default_factory=dict)
    states: dict[str, dict[str, float]] = field(default_factory=dict)
    unknown: dict[str, tuple[int, str]] = field(default_factory=dict)
    changes: list[RobotChange] = field(default_factory=list)


def read(path: Path, data: bytes, robot: Robot) -> Semantics:
    """Return what an SRDF file says of a robot; names that it does not have are told in `changes`.

    Raises:
        RobotError: it is no SRDF, or an entry has not what it needs.
    """
    root = parse(path, data, root="robot")
    found = Semantics()
    _read_pairs(root, path, robot, found)
    for link, (line, tag) in found.unknown.items():
        rule = f"<{tag}> names {link[:100]!r}, which is no link: left out"
        found.changes.append(RobotChange(f"line {line} of the SRDF", rule))
    _read_states(root, robot, found)
    known = ("disable_collisions", "disable_default_collisions", "enable_collisions", "group_state", "group")
    others = Counter(child.tag for child in root.children if child.tag not in known)
    found.changes.extend(RobotChange(f"{times} x <{tag}>", "is not used") for tag, times in sorted(others.items()))
    return found


def _read_pairs(root: XmlElement, path: Path, robot: Robot, found: Semantics) -> None:
    for element in root.all("disable_default_collisions"):
        link = element.text("link")
        for other in robot.links if _known(link, robot.links, element, found) else ():
            if other != link:
                found.disabled[frozenset((link, other))] = f"{link} is disabled by default in {path.name}"
    for tag in ("disable_collisions", "enable_collisions"):
        for element in root.all(tag):
            ends = element.text("link1"), element.text("link2")
            known = [_known(link, robot.links, element, found) for link in ends]  # both are told
            if not all(known) or ends[0] == ends[1]:
                continue
            if tag == "enable_collisions":
                found.disabled.pop(frozenset(ends), None)
            else:
                reason = " ".join(element.attributes.get("reason", "").split())[:500]
                found.disabled[frozenset(ends)] = reason or f"disabled in {path.name}"


def _known(link: str, links: Mapping[str, object], element: XmlElement, found: Semantics) -> bool:
    if link not in links:
        found.unknown.setdefault(link, (element.line, element.tag))
    return link in links


def _read_states(root: XmlElement, robot: Robot, found: Semantics) -> None:
    """Read the states; one of several groups by its own name is called by its group's too."""
    states = list(root.all("group_state"))
    times = Counter(element.text("name") for element in states)
    for element in states:
        name, group = element.text("name"), element.attributes.get("group", "").strip()
        called = name if times[name] == 1 else f"{group}_{name}"
        if called in found.states:
            raise element.wrong(f"<group_state> {name!r} of group {group!r} is there twice")
        positions = dict(_positions(element, called, robot, found))
        if positions:
            found.states[called] = positions
        else:
            found.changes.append(RobotChange(f"state {called}", "holds no joint with a position: left out"))


def _positions(state: XmlElement, called: str, robot: Robot, found: Semantics) -> Iterator[tuple[str, float]]:
    place = f"state {called}"
    for element in state.all("joint"):
        name = element.text("name")
        joint = robot.joints.get(name)
        if joint is None:
            found.changes.append(RobotChange(place, f"names {name!r}, which is no joint: left out"))
        elif not joint.moves:
            found.changes.append(RobotChange(place, f"joint {name} is {joint.type}: left out"))
        elif joint.mimic is not None:
            found.changes.append(RobotChange(place, f"joint {name} follows {joint.mimic.joint}: left out"))
        elif len(element.text("value").split()) != 1:
            found.changes.append(RobotChange(place, f"joint {name} has several values: left out"))
        else:
            value = number(element, "value")
            if joint.limits.lower <= value <= joint.limits.upper:
                yield name, value
            else:
                beyond = f"is beyond its limits {joint.limits.lower:g} and {joint.limits.upper:g}"
                found.changes.append(RobotChange(place, f"joint {name} at {value:g} {beyond}: left out"))


def rigid_pairs(robot: Robot, bodies: Container[str]) -> Iterator[tuple[str, str]]:
    """Yield the pairs of links with bodies that no joint moves relative to each other and that none joins directly."""
    group: dict[str, str] = {robot.root: robot.root}
    joined = {frozenset((joint.parent, joint.child)) for joint in robot.joints.values()}
    for joint in robot.joints.values():
        group[joint.child] = group[joint.parent] if joint.type == "fixed" else joint.child
    members: dict[str, list[str]] = {}
    for link in (link for link in robot.links if link in bodies):
        members.setdefault(group[link], []).append(link)
    for links in members.values():
        yield from (pair for pair in itertools.combinations(links, 2) if frozenset(pair) not in joined)
