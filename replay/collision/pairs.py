"""Which shapes are tested against each other; decided once, before the first frame."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from replay.errors import InvalidValue
from replay.geometry.solid import Solid
from replay.kinematics.linkage import JointType, Linkage
from replay.language.globs import Globs
from replay.numerics.arrays import Flags, Integers

MOST_PAIRS = 500_000
"""Most pairs that are listed, those of 1 000 bodies: results hold columns for each, 20 bytes a frame."""


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


class PairRules:
    """Which pairs of bodies are tested, as a rule that is asked instead of a list: all pairs of a very large scene.

    Two bodies are tested unless they are on one link, on links joined by a joint, or disabled.

    Args:
        bodies: all bodies.
        linkage: whose links they are on.
        disabled: pairs left out.

    Raises:
        InvalidValue: two bodies of one name.
    """

    def __init__(
        self, bodies: Sequence[CollisionBody], linkage: Linkage, *, disabled: Sequence[DisabledPair] = ()
    ) -> None:
        self.names = [body.name for body in bodies]
        if len(set(self.names)) != len(self.names):
            raise InvalidValue("bodies", sorted(self.names), "body names must be unique")
        self.disabled = tuple(disabled)
        self.order = np.array(sorted(range(len(bodies)), key=self.names.__getitem__), dtype=np.int64)
        self._rank = np.argsort(self.order)
        self._link = np.array([body.link for body in bodies], dtype=np.int64)
        self._parent = linkage.parents
        self._rigid = _rigid_parts(linkage)
        globs = Globs([linkage.link_names[body.link] for body in bodies]), Globs(self.names)
        self._sides = [tuple(_fitting(pattern, globs) for pattern in (rule.a, rule.b)) for rule in disabled]
        self._masks, self._keys = self._left_out()

    def tested(self, a: Integers | int, b: Integers) -> Flags:
        """Return which of the pairs of bodies a, b (broadcast) are tested."""
        result = self._apart(a, b) & ~self._joined(a, b)
        for x, y in self._masks:
            result &= ~((x[a] & y[b]) | (y[a] & x[b]))
        if len(self._keys):
            wanted = np.minimum(a, b) * len(self.names) + np.maximum(a, b)
            place = np.minimum(np.searchsorted(self._keys, wanted), len(self._keys) - 1)
            result &= self._keys[place] != wanted
        return result

    def static(self, a: Integers | int, b: Integers) -> Flags:
        """Return which pairs no joint can move relative to each other."""
        found: Flags = self._rigid[self._link[a]] == self._rigid[self._link[b]]
        return found

    def by_name(self, pairs: Integers) -> Integers:
        """Return pairs of bodies (k, 2), each with the body first whose name comes first."""
        turned = self._rank[pairs[:, 0]] > self._rank[pairs[:, 1]]
        return np.where(turned[:, None], pairs[:, ::-1], pairs)

    def count(self) -> int:
        """Return how many pairs are tested."""
        return sum(int(self.tested(a, self.order[k + 1 :]).sum()) for k, a in enumerate(self.order))

    def unmatched(self) -> tuple[DisabledPair, ...]:
        """Return the disabled pairs that match no two bodies on different links."""
        missed = []
        for rule, (x, y) in zip(self.disabled, self._sides, strict=True):
            links_x, links_y = set(self._link[list(x)].tolist()), set(self._link[list(y)].tolist())
            if not links_x or not links_y or (links_x == links_y and len(links_x) == 1):
                missed.append(rule)
        return tuple(missed)

    def _left_out(self) -> tuple[list[tuple[Flags, Flags]], Integers]:
        """Return the disabled pairs as few masks (x, y), for rules of many pairs, and as sorted keys of single pairs.

        Rules that share a side are one rule; what n bodies with a rule each would cost is n^2 for every body.
        """
        sides = {(min(rule), max(rule)) for rule in self._sides}
        for kept in (1, 0):
            joined: dict[tuple[int, ...], set[int]] = {}
            for rule in sides:
                joined.setdefault(rule[kept], set()).update(rule[1 - kept])
            pairs = [(tuple(sorted(other)), same) for same, other in joined.items()]
            sides = {rule if kept else rule[::-1] for rule in pairs}
        masks, keys = [], [np.zeros(0, dtype=np.int64)]
        for x, y in sides:
            if len(x) * len(y) > len(self.names):
                masks.append((self._mask(x), self._mask(y)))
            else:
                a, b = np.repeat(np.array(x, dtype=np.int64), len(y)), np.tile(np.array(y, dtype=np.int64), len(x))
                keys.append(np.minimum(a, b) * len(self.names) + np.maximum(a, b))
        return masks, np.unique(np.concatenate(keys))

    def _mask(self, bodies: tuple[int, ...]) -> Flags:
        mask = np.zeros(len(self.names), dtype=bool)
        mask[list(bodies)] = True
        return mask

    def _apart(self, a: Integers | int, b: Integers) -> Flags:
        result: Flags = self._link[a] != self._link[b]
        return result

    def _joined(self, a: Integers | int, b: Integers) -> Flags:
        x, y = self._link[a], self._link[b]
        result: Flags = (self._parent[x] == y) | (self._parent[y] == x)
        return result


def plan_pairs(
    bodies: Sequence[CollisionBody], linkage: Linkage, *, disabled: Sequence[DisabledPair] = ()
) -> tuple[Pair, ...]:
    """Return the pairs to test, sorted by name.

    Every two shapes are a pair unless they are on one link, on links joined by a joint, or disabled.

    Raises:
        InvalidValue: two bodies of one name, or more than MOST_PAIRS pairs.
    """
    return plan(bodies, linkage, disabled=disabled).pairs


def plan(bodies: Sequence[CollisionBody], linkage: Linkage, *, disabled: Sequence[DisabledPair] = ()) -> PairPlan:
    """Return the pairs to test and the disabled pairs that match nothing; see `plan_pairs`."""
    rules = PairRules(bodies, linkage, disabled=disabled)
    count = rules.count()
    if count > MOST_PAIRS:
        reason = (
            f"results are kept for every pair and frame, at most {MOST_PAIRS} pairs: disable pairs that cannot meet, "
            "put shapes that move together on one link, or split the scene; "
            "`CollisionPipeline.contacts` with `PairRules` lists what is near in scenes of any size"
        )
        raise InvalidValue("pairs", count, reason)
    names, pairs = rules.names, []
    for k, a in enumerate(rules.order.tolist()):
        others = rules.order[k + 1 :]
        others = others[rules.tested(a, others)]
        fixed = rules.static(a, others)
        pairs += [
            Pair(f"{names[a]}|{names[b]}", a, b, is_fixed)
            for b, is_fixed in zip(others.tolist(), fixed.tolist(), strict=True)
        ]
    return PairPlan(tuple(sorted(pairs, key=lambda pair: pair.name)), rules.unmatched())


def _fitting(pattern: str, globs: tuple[Globs, Globs]) -> tuple[int, ...]:
    """Return the bodies whose link's name, or whose own, fits the glob."""
    by_link, by_name = (names.fitting(pattern) for names in globs)
    return tuple(sorted({*by_link, *by_name})) if by_link and by_name else by_link or by_name


def _rigid_parts(linkage: Linkage) -> Integers:
    """Return for each link the link (-1: the world) that it is fixed to, over any number of fixed joints."""
    result = np.arange(len(linkage.links), dtype=np.int64)
    for link in range(len(linkage.links)):
        part = link
        while part >= 0 and linkage.links[part].joint.type is JointType.FIXED:
            part = int(linkage.parents[part])
        result[link] = part
    return result
