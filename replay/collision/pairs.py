"""Which shapes are tested against each other; decided once, before the first frame."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase

from replay.errors import InvalidValue
from replay.geometry.solid import Solid
from replay.kinematics.linkage import Linkage


@dataclass(frozen=True, eq=False)
class CollisionBody:
    """A shape that collides.

    Attributes:
        name: "link/shape", unique.
        link: position of its link in `Linkage.links`.
        solid: the shape in its link's frame.
    """

    name: str
    link: int
    solid: Solid


@dataclass(frozen=True)
class DisabledPair:
    """Shapes that are not tested against each other, and why; `a` and `b` are globs on link or "link/shape" names."""

    a: str
    b: str
    reason: str


@dataclass(frozen=True)
class Pair:
    """Two shapes that are tested.

    Attributes:
        name: "link/shape|link/shape", the two names in order.
        a, b: positions of the two bodies, in the order of the name.
        static: whether no joint can move the two relative to each other; evaluated once, then.
    """

    name: str
    a: int
    b: int
    static: bool


@dataclass(frozen=True)
class PairPlan:
    """The pairs of a scene.

    Attributes:
        pairs: sorted by name.
        unmatched: the disabled pairs whose globs match no pair of shapes on different links, in the order given: a
            misspelt name would leave a pair tested that was meant not to be.
    """

    pairs: tuple[Pair, ...]
    unmatched: tuple[DisabledPair, ...]


def plan_pairs(
    bodies: Sequence[CollisionBody], linkage: Linkage, *, disabled: Sequence[DisabledPair] = ()
) -> tuple[Pair, ...]:
    """Return the pairs to test, sorted by name.

    Every two shapes are a pair unless they are on one link, on links joined by a joint, or disabled.

    Raises:
        InvalidValue: two bodies of one name.
    """
    return plan(bodies, linkage, disabled=disabled).pairs


def plan(bodies: Sequence[CollisionBody], linkage: Linkage, *, disabled: Sequence[DisabledPair] = ()) -> PairPlan:
    """Return the pairs to test and the disabled pairs that match nothing; see `plan_pairs`."""
    names = [body.name for body in bodies]
    if len(set(names)) != len(names):
        raise InvalidValue("bodies", sorted(names), "body names must be unique")
    rules = [(_matching(rule.a, bodies, linkage), _matching(rule.b, bodies, linkage)) for rule in disabled]
    reached: set[int] = set()
    static: dict[tuple[int, int], bool | None] = {}  # None: adjacent
    pairs = []
    for a, b in itertools.combinations(sorted(range(len(bodies)), key=names.__getitem__), 2):
        links = (bodies[a].link, bodies[b].link)
        if links[0] == links[1]:
            continue
        matching = [k for k, (x, y) in enumerate(rules) if (a in x and b in y) or (b in x and a in y)]
        reached.update(matching)
        if links not in static:
            static[links] = None if linkage.are_adjacent(*links) else not linkage.moves_between(*links)
        fixed = static[links]
        if not matching and fixed is not None:
            pairs.append(Pair(f"{names[a]}|{names[b]}", a, b, fixed))
    unmatched = tuple(rule for k, rule in enumerate(disabled) if k not in reached)
    return PairPlan(tuple(sorted(pairs, key=lambda pair: pair.name)), unmatched)


def _matching(pattern: str, bodies: Sequence[CollisionBody], linkage: Linkage) -> set[int]:
    """Return the bodies whose name or whose link's name fits the glob."""
    return {
        k
        for k, body in enumerate(bodies)
        if fnmatchcase(body.name, pattern) or fnmatchcase(linkage.link_names[body.link], pattern)
    }
