"""Which parts of a mesh are inside out: each outermost one is turned by itself, together with what is nested in it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from replay.geometry.closing import caps, openness
from replay.geometry.containment import contains
from replay.geometry.parts import Parts
from replay.geometry.solid import signed_volume
from replay.geometry.tree import Tree, triangle_tree
from replay.numerics.arrays import Flags, Floats, Integers
from replay.numerics.extents import extents

_ROUNDING = 1e-14  # of volumes, in cubes of the largest extent
_MOST_OPEN_PARTS = 200  # more are crumbs of one surface, and looked at together


class Shell(NamedTuple):
    """A part that has an inside: its faces, their triangles and caps, and the volume it encloses, negative inside out.

    Attributes:
        which: (k,) its faces.
        triangles: (k, 3, 3) [m].
        closing: (m, 3, 3) [m], see `closing.caps`.
        volume: [m^3].
    """

    which: Integers
    triangles: Floats
    closing: Floats
    volume: float

    @property
    def is_inside_out(self) -> bool:
        """Whether its volume is negative, beyond rounding: two walls that coincide have none."""
        lower, upper = extents(self.triangles.reshape(-1, 3))
        extent = float(np.max(upper - lower))
        return self.volume < -_ROUNDING * extent**3


class Turned(NamedTuple):
    """Which faces to turn over, and how many of how many outermost parts that is."""

    faces: Flags
    inside_out: int
    outermost: int


def inside_out(triangles: Floats, parts: Parts) -> Turned:
    """Return which triangles (n, 3, 3) belong to parts that are inside out.

    A shell nested in another one is turned only with it: of the opposite sense it is a cavity, of the same sense solid.
    Parts that overlap are turned each by itself, and so are open ones, as far as they have an inside.
    """
    shells = _shells(triangles, parts)
    shells.sort(key=lambda shell: -abs(shell.volume))
    root = _outermost(shells) if len(shells) > 1 else [0] * len(shells)
    faces = np.zeros(len(triangles), dtype=np.bool_)
    for shell, outer in zip(shells, root, strict=True):
        faces[shell.which] = shells[outer].is_inside_out
    roots = sorted(set(root))
    return Turned(faces, sum(shells[k].is_inside_out for k in roots), len(roots))


def _shells(triangles: Floats, parts: Parts) -> list[Shell]:
    order = np.argsort(parts.label, kind="stable")
    groups = np.split(order, np.flatnonzero(np.diff(parts.label[order])) + 1)
    none = np.zeros((0, 3, 3))
    found = []
    crumbs = []
    apart = np.count_nonzero(~parts.closed) <= _MOST_OPEN_PARTS
    for which in groups:
        if parts.closed[parts.label[which[0]]]:
            own = triangles if len(groups) == 1 else triangles[which]
            found.append(Shell(which, own, none, signed_volume(own)))
        elif parts.one_sided[parts.label[which[0]]]:
            continue
        elif not apart or not _add_open(found, triangles, which):
            crumbs.append(which)
    if len(crumbs) > 1 or (crumbs and not apart):
        _add_open(found, triangles, np.concatenate(crumbs))
    return found


def _add_open(found: list[Shell], triangles: Floats, which: Integers) -> bool:
    """Add open faces as a shell if they have an inside; return whether they have."""
    own = triangles[which]
    closing = caps(own)
    if not openness(own, closing).has_inside:
        return False
    found.append(Shell(which, own, closing, signed_volume(np.concatenate([own, closing]))))
    return True


def _outermost(shells: list[Shell]) -> list[int]:
    """Return for each shell, largest first, which one that is in no other it is nested in, itself where it is none."""
    lower, upper = np.array([extents(shell.triangles.reshape(-1, 3)) for shell in shells]).transpose(1, 0, 2)
    trees: dict[int, Tree] = {}
    root: list[int] = []
    for k, shell in enumerate(shells):
        around = np.flatnonzero((lower[:k] <= lower[k]).all(axis=1) & (upper[:k] >= upper[k]).all(axis=1))
        root.append(k)
        for outer in around[::-1].tolist():  # the smallest first
            if outer not in trees:
                trees[outer] = triangle_tree(shells[outer].triangles)
            if _holds(shells[outer], trees[outer], shell):
                root[k] = root[outer]
                break
    return root


def _holds(outer: Shell, tree: Tree, shell: Shell) -> bool:
    """Return whether a shell is within another one: its corners, and the middles of its edges and triangles."""
    middles = 0.5 * (shell.triangles + shell.triangles[:, [1, 2, 0]])
    points = np.concatenate([shell.triangles.reshape(-1, 3), middles.reshape(-1, 3), shell.triangles.mean(axis=1)])
    few = contains(outer.triangles, points[::-1][:8], tree=tree, closing=outer.closing)
    return bool(few.all() and contains(outer.triangles, points, tree=tree, closing=outer.closing).all())
