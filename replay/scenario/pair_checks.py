"""What must hold of pairs of patterns: they match what is tested, and clearances that are asked for are computed."""

from __future__ import annotations

from collections.abc import Iterator

from replay.language.node import KeyPath
from replay.scenario.names import Names, ShapeName
from replay.scenario.problems import Finding, did_you_mean


def matching_patterns(names: Names, path: KeyPath, pair: tuple[str, str]) -> Iterator[Finding]:
    """Find patterns that match nothing."""
    for side, pattern in enumerate(pair):
        if not names.links_matching(pattern) and not names.shapes_matching(pattern):
            known = [*names.parents, *(shape.full for shape in names.shapes)]
            yield (*path, side), f"matches no link and no shape; {did_you_mean(pattern, known)}"


def tested_pairs(names: Names, path: KeyPath, pair: tuple[str, str]) -> Iterator[Finding]:
    """Find that two patterns match no pair of shapes that is tested, and why."""
    if not names.tests_pairs:
        yield path, f"{list(pair)}: nothing is tested, since collision.pairs is none"
        return
    reason = "they match no two shapes on different links"
    for a in names.shapes_matching(pair[0]):
        for b in names.shapes_matching(pair[1]):
            hindrance = _hindrance(names, a, b)
            if hindrance is None:
                return
            reason = hindrance or reason
    yield path, f"{list(pair)}: no pair of shapes that these match is tested: {reason}"


def _hindrance(names: Names, a: ShapeName, b: ShapeName) -> str | None:
    """Return why a pair is not tested; empty for shapes of one link, None when it is tested."""
    if a.link == b.link:
        return ""
    if not (a.collides and b.collides):
        return f"{(b if a.collides else a).full} has collide: false"
    if names.parents.get(a.link) == b.link or names.parents.get(b.link) == a.link:
        return f"links {a.link!r} and {b.link!r} are joined by a joint"
    for index, first, second in names.disabled:
        if (a.full in first and b.full in second) or (b.full in first and a.full in second):
            return f"collision.disable[{index}] leaves it out"
    return None


def known_clearance(names: Names, path: KeyPath, least: float) -> Iterator[Finding]:
    """Find that a clearance is not computed as far as it is asked for."""
    if names.model is None or names.margin is None:
        return
    if names.model.collision.clearance == "never":
        yield path, "cannot be judged, since model.collision.clearance is never; write near or always"
    elif names.model.collision.clearance == "near" and least > names.margin:
        margin = f"collision.margin {names.margin:.6g} m, up to which clearances are computed"
        yield path, f"is above {margin}; raise the margin, or write model.collision.clearance: always"
