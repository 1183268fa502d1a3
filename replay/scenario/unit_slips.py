"""Angles that were probably meant in degrees: numbers without a unit that are more than a turn."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

from replay.errors import Problem
from replay.language.node import KeyPath
from replay.numerics.constants import FULL_TURN
from replay.scenario.source import find

if TYPE_CHECKING:
    from replay.scenario.model import Scenario


def beyond_a_turn(scenario: Scenario) -> Iterator[Problem]:
    """Yield a note for each limit and target of a joint that turns which is a bare number beyond a turn."""
    for path, value in _angles(scenario):
        root = scenario.provenance.root
        node = None if root is None else find(root, path)
        bare = node is not None and isinstance(node.value, int | float)
        if bare and math.isfinite(value) and abs(value) > FULL_TURN:
            rule = f"is in rad and more than a turn; write '{value:g} deg' if degrees are meant"
            yield scenario.provenance.problem(path, rule)


def _angles(scenario: Scenario) -> Iterator[tuple[KeyPath, float]]:
    turning = {}
    for name, link in scenario.links.items():
        if link.joint.type in ("revolute", "continuous"):
            turning[link.joint.name or name] = link.joint
            for key in ("lower", "upper", "initial"):
                value = getattr(link.joint, key, None)
                if value is not None:
                    yield ("links", name, "joint", key), value
    for joint, points in scenario.motion.points.items():
        if joint in turning and turning[joint].type == "revolute":
            for index, point in enumerate(points):
                yield ("motion", "points", joint, index, "position"), point.position.value
    for index, move in enumerate(scenario.motion.moves):
        for joint, position in move.to.items() if not isinstance(move.to, str) else ():
            if joint in turning and turning[joint].type == "revolute":
                yield ("motion", "moves", index, "to", joint), position.value
