"""A part that was made, as a scenario in memory: that it is valid, and what touches in random poses."""

from __future__ import annotations

import itertools
import math
from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from replay import limits
from replay.errors import RobotError, ScenarioError
from replay.kinematics.linkage import Linkage
from replay.numerics.arrays import Floats
from replay.numerics.constants import FULL_TURN
from replay.robots.part import RobotPart
from replay.scenario.load import load_from
from replay.scenario.model import Scenario
from replay.scenario.source import resolve_name

_SEED = 1
_DEEP = "in/" * 60
"""Folders around the scenario in memory, so that a part may name files far above it."""


class _Memory:
    """A scenario that includes a part, with the part's mesh files where they are."""

    main = f"{_DEEP}scenario.yaml"

    def __init__(self, part: str, file: Path, meshes: Mapping[str, Path | bytes], *, deep: bool) -> None:
        self._file = file
        self._text = {
            self.main: b"version: 1\nname: part\nrate: 1\nduration: 0\ninclude: [part.yaml]\n",
            f"{_DEEP}part.yaml": part.encode(),
        }
        self._meshes = {resolve_name(name, self.main): content for name, content in meshes.items()} if deep else None

    def shown(self, name: str) -> str:
        """Return what messages call the file of this name."""
        return str(self._file) if name.endswith("part.yaml") else name

    def read(self, name: str) -> bytes:
        """Return the file's bytes; none of a mesh where meshes are not looked at."""
        if name in self._text:
            return self._text[name]
        content = b"" if self._meshes is None else self._meshes[name]
        return content if isinstance(content, bytes) else content.read_bytes()


def valid(part: str, file: Path, meshes: Mapping[str, Path | bytes], *, deep: bool = False) -> Scenario:
    """Return a scenario that holds a part alone.

    Args:
        part: its text.
        file: where it will be, for errors.
        meshes: file by the name that the part has for it.
        deep: whether mesh files are read, so that the scene can be built.

    Raises:
        RobotError: the part would not be valid; the first reason.
    """
    try:
        return load_from(_Memory(part, file, meshes, deep=deep))
    except ScenarioError as error:
        raise RobotError(str(file), f"would not be a valid part: {error.problems[0]}") from None


def needless_pairs(scenario: Scenario, part: RobotPart, samples: int) -> Iterator[tuple[str, str, str]]:
    """Yield the pairs of links that need no test, with what random poses show of them.

    Each joint is taken anywhere within its limits, or within a turn where it has none (a metre to either side, of one
    that slides), all alike; those that follow are where they follow. Two links are neighbours if a joint joins them, or
    only links without bodies are between.

    Args:
        scenario: holds the part alone, with its meshes.
        part: of which pairs that are disabled already are not looked at.
        samples: how many poses.

    Raises:
        ScenarioError: a mesh cannot be used.
    """
    from replay.scenario.scene import build
    from replay.simulation import touching

    scene = build(scenario)
    columns: dict[tuple[str, str], list[int]] = {}
    for column, name in enumerate(scene.layout.pairs):
        a, b = sorted(side.partition("/")[0] for side in name.split("|"))
        columns.setdefault((a, b), []).append(column)
    machine, times_of = scene.linkage, Counter[tuple[str, str]]()
    free = np.broadcast_to(np.eye(4), (samples, len(machine.free_names), 4, 4))
    for flags in touching(scene, random_positions(machine, samples), free):
        for pair, of_links in columns.items():
            times_of[pair] += int(np.count_nonzero(flags[:, of_links].any(axis=1)))
    near = _neighbours(part)
    for pair in columns:
        times = times_of[pair]
        if times == 0:
            yield *pair, f"never in contact in {samples} random poses"
        elif frozenset(pair) in near:
            yield *pair, f"adjacent, in contact in {times} of {samples} random poses"
        elif times == samples:
            yield *pair, f"always in contact in {samples} random poses"


def random_positions(machine: Linkage, samples: int) -> Floats:
    """Return random joint positions (samples, J) [rad or m], the same each time."""
    if not 1 <= samples <= limits.ROBOT_SAMPLES:
        raise RobotError("--check-collisions", f"{samples} must be between 1 and {limits.ROBOT_SAMPLES}")
    random = np.random.default_rng(_SEED)
    ranges = machine.ranges()
    positions = np.zeros((samples, len(machine.joints)))
    for k, joint in enumerate(machine.joints):
        if joint.name in ranges:
            lower, upper = ranges[joint.name]
            half = 1.0 if joint.type.unit == "m" else 0.5 * FULL_TURN
            lower = lower if math.isfinite(lower) else (upper - 2.0 * half if math.isfinite(upper) else -half)
            upper = upper if math.isfinite(upper) else lower + 2.0 * half
            positions[:, k] = lower + (upper - lower) * random.random(samples)
    return machine.followed(positions)


def _neighbours(part: RobotPart) -> set[frozenset[str]]:
    """Return the pairs of links with bodies that a joint joins, or that only links without bodies are between."""
    bare: dict[str, str] = {}  # the uppermost of the links without bodies that hang together, by each of them
    found = set()
    around: dict[str, set[str]] = {}
    for name, entry in part.links.items():  # not sorted: a parent may come after its child
        if "shapes" not in entry:
            top: str = name
            above: str | None = entry.get("parent")
            while above is not None and "shapes" not in part.links[above]:
                top = bare.get(above, above)
                above = part.links[top].get("parent")
            bare[name] = top
    for name, entry in part.links.items():
        parent = entry.get("parent")
        for link, other in ((name, parent), (parent, name)) if parent is not None else ():
            if other in bare and link not in bare:
                around.setdefault(bare[other], set()).add(link)
            elif other not in bare and link not in bare:
                found.add(frozenset((link, other)))
    for links in around.values():
        found.update(frozenset(pair) for pair in itertools.combinations(sorted(links), 2))
    return found
