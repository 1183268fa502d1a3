"""What a scenario's text names, and the entries of it that are valid: references between entries are checked even while
other entries are wrong, so that all problems are listed at once.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import Any, Final

from pydantic import TypeAdapter, ValidationError

from replay.collision.columns import MARGIN
from replay.guarding.part import GuardPart
from replay.language.fields import Part
from replay.language.globs import Globs, fits
from replay.language.node import Node
from replay.language.units import Dimensioned, Distance, Rate
from replay.scenario.collision import DisablePart
from replay.scenario.expectations import Expectation
from replay.scenario.links import ContinuousPart, Joint, PrismaticPart, RevolutePart
from replay.scenario.methods import Model, builtin_model
from replay.scenario.model import Scenario
from replay.scenario.motion import KeyframePart, Keyframes, MovePart, Positions, WaypointPart, Waypoints
from replay.scenario.source import find
from replay.sensing.kinds import KINDS

SCALAR_JOINTS: Final = ("revolute", "continuous", "prismatic")


def matches(pattern: str, link: str, shape: str | None = None) -> bool:
    """Return whether a pattern matches a link's name or, with a shape, "link/shape"."""
    return fits(link, pattern) or (shape is not None and fits(f"{link}/{shape}", pattern))


@dataclass(frozen=True)
class JointName:
    """The joint of a link, as far as its text can be read.

    Attributes:
        type: None where it cannot be read.
        scalar: the joint itself, if it is a valid one with one position.
    """

    name: str
    link: str
    type: str | None
    scalar: RevolutePart | ContinuousPart | PrismaticPart | None


@dataclass(frozen=True)
class ShapeName:
    """A shape by its name."""

    link: str
    name: str
    collides: bool

    @property
    def full(self) -> str:
        """The name "link/shape"."""
        return f"{self.link}/{self.name}"


class Names:
    """All names of a scenario, and its valid entries; an entry that is not valid is None.

    Args:
        root: the text's tree.
        scenario: the same as validated, or None when anything in it is wrong.
    """

    def __init__(self, root: Node, scenario: Scenario | None) -> None:
        self.root = root
        self._scenario = scenario

    @cached_property
    def parents(self) -> dict[str, str | None]:
        """Parent by link; None for a root, or where it cannot be read."""
        return {link: _text(node.child("parent")) for link, node in self._map("links").items()}

    @cached_property
    def joints(self) -> tuple[JointName, ...]:
        """The joint of each link."""
        return tuple(self._joint(link, node) for link, node in self._map("links").items())

    def _joint(self, link: str, node: Node) -> JointName:
        joint = node.child("joint")
        if joint is None:
            return JointName(link, link, "fixed", None)
        valid = self._entry(Joint, "links", link, "joint")
        scalar = valid if isinstance(valid, RevolutePart | ContinuousPart | PrismaticPart) else None
        return JointName(_text(joint.child("name")) or link, link, _text(joint.child("type")), scalar)

    @cached_property
    def shapes(self) -> tuple[ShapeName, ...]:
        """All shapes."""
        found = []
        for link in self.parents:
            for name, node in self._map("links", link, "shapes").items():
                collide = node.child("collide")
                found.append(ShapeName(link, name, collide is None or collide.value is not False))
        return tuple(found)

    def links_matching(self, pattern: str) -> list[str]:
        """Return the links that a pattern matches."""
        links = tuple(self.parents)
        return [links[place] for place in self._link_globs.fitting(pattern)]

    def shapes_matching(self, pattern: str) -> list[ShapeName]:
        """Return the shapes that a pattern matches, by link or by full name."""
        by_link, by_name = (globs.fitting(pattern) for globs in self._shape_globs)
        return [self.shapes[place] for place in sorted({*by_link, *by_name})]

    @cached_property
    def _link_globs(self) -> Globs:
        return Globs(tuple(self.parents))

    @cached_property
    def _shape_globs(self) -> tuple[Globs, Globs]:
        return Globs([shape.link for shape in self.shapes]), Globs([shape.full for shape in self.shapes])

    @cached_property
    def poses(self) -> dict[str, dict[str, Dimensioned] | None]:
        """Joint positions by pose."""
        return {name: self._entry(Positions, "poses", name) for name in self._map("poses")}

    @property
    def initial(self) -> str | None:
        """The pose that the motion begins in."""
        node = find(self.root, ("motion", "initial"))
        return None if node is None else _text(node)

    @cached_property
    def points(self) -> dict[str, tuple[WaypointPart, ...] | None]:
        """Waypoints by joint."""
        return {name: self._entry(Waypoints, "motion", "points", name) for name in self._map("motion", "points")}

    @cached_property
    def moves(self) -> list[MovePart | None]:
        """Moves in order."""
        return [self._entry(MovePart, "motion", "moves", index) for index in self._list("motion", "moves")]

    @cached_property
    def free(self) -> dict[str, tuple[KeyframePart, ...] | None]:
        """Key frames by joint."""
        return {name: self._entry(Keyframes, "motion", "free", name) for name in self._map("motion", "free")}

    @cached_property
    def sensors(self) -> dict[str, dict[str, Any]]:
        """Sensors by kind and name."""
        return {
            kind: {name: self._entry(KINDS[kind].part, "sensors", kind, name) for name in self._map("sensors", kind)}
            for kind in KINDS
        }

    @cached_property
    def disable(self) -> list[DisablePart | None]:
        """Disabled pairs in order."""
        return [self._entry(DisablePart, "collision", "disable", index) for index in self._list("collision", "disable")]

    @cached_property
    def disabled(self) -> list[tuple[int, frozenset[str], frozenset[str]]]:
        """Of each disabled pair its index, and the full names of the shapes that its two patterns match."""
        found = []
        for index, entry in enumerate(self.disable):
            if entry is not None:
                first, second = (frozenset(s.full for s in self.shapes_matching(side)) for side in entry.pair)
                found.append((index, first, second))
        return found

    @cached_property
    def expect(self) -> list[Part | None]:
        """Expectations in order."""
        return [self._entry(Expectation, "expect", index) for index in self._list("expect")]

    @cached_property
    def rate(self) -> Fraction | None:
        """Frames per second [Hz]."""
        found: Fraction | None = None if self.root.child("rate") is None else self._entry(Rate, "rate")
        return None if found is None else Fraction(found)

    @cached_property
    def guards(self) -> dict[str, GuardPart | None]:
        """Guards by name."""
        return {name: self._entry(GuardPart, "guards", name) for name in self._map("guards")}

    @property
    def tests_pairs(self) -> bool:
        """Whether pairs are tested at all."""
        return _text(find(self.root, ("collision", "pairs"))) != "none"

    @cached_property
    def margin(self) -> float | None:
        """collision.margin [m]."""
        if find(self.root, ("collision", "margin")) is None:
            return MARGIN
        result: float | None = self._entry(Distance, "collision", "margin")
        return result

    @cached_property
    def model(self) -> Model | None:
        """The model, or None when it is not valid."""
        node = self.root.child("model")
        if node is None:
            return Model()
        if self._scenario is not None:
            return self._scenario.model
        try:
            return Model.model_validate(builtin_model(node.data()))
        except ValueError:
            return None

    def _map(self, *path: str) -> dict[str, Node]:
        node = find(self.root, path)
        return {} if node is None else node.mapping

    def _list(self, *path: str) -> range:
        node = find(self.root, path)
        return range(0 if node is None else len(node.sequence))

    def _entry(self, annotation: Any, *path: str | int) -> Any:
        if self._scenario is not None:
            value: Any = self._scenario
            for step in path:
                value = getattr(value, step) if isinstance(value, Part) and isinstance(step, str) else value[step]
            return value
        node = find(self.root, path)
        assert node is not None
        try:
            return TypeAdapter(annotation).validate_python(node.data())
        except ValidationError:
            return None


def _text(node: Node | None) -> str | None:
    return node.value if node is not None and isinstance(node.value, str) else None
