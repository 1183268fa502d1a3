"""Sweeps: one scenario text that stands for many, each with some of its values replaced and named by them."""

from __future__ import annotations

import itertools
import math
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Final, Self

from pydantic import Discriminator, Field, StrictInt, StringConstraints, Tag, model_validator

from replay import limits
from replay.errors import Problem, ScenarioError
from replay.language.fields import Part, rejected
from replay.language.node import KeyPath, Node, Place
from replay.scenario.source import dotted
from replay.sensing.kinds import KINDS

MAX_CASES: Final = limits.SWEEP_CASES
MAX_NAME: Final = 100

_PATH = r"^[A-Za-z0-9_][A-Za-z0-9_.\-]*(\[[0-9]+\][A-Za-z0-9_.\-]*)*$"
ValuePath = Annotated[str, StringConstraints(pattern=_PATH, max_length=300)]
"""Names a value of the scenario: `sensors.distance.tip.aperture`, `motion.moves[0].speed`."""

_FIXED: Final = ("version", "name", "include", "sweep")
_MAY_BE_LEFT_OUT: Final = {
    ("collision",),
    ("model",),
    ("model", "collision"),
    *(("model", kind) for kind in KINDS),
}
_UNSAFE = re.compile(r"[^A-Za-z0-9_.,+=\-]+")


class CountPart(Part):
    """Whole numbers one after another."""

    from_: Annotated[StrictInt, Field(alias="from", ge=-(1 << 53), le=1 << 53)]
    """The first."""
    count: Annotated[StrictInt, Field(ge=1)]
    """How many there are."""


def _kind_of_values(value: object) -> str:
    return "count" if isinstance(value, dict | CountPart) else "list"


Values = Annotated[
    Annotated[Annotated[tuple[Any, ...], Field(min_length=1)], Tag("list")] | Annotated[CountPart, Tag("count")],
    Discriminator(_kind_of_values),
]


class SweepPart(Part):
    """Cases of this scenario: each replaces some values, and is a scenario of its own, named by them."""

    grid: Annotated[dict[ValuePath, Values], Field(min_length=1)] | None = None
    """Values by path, a list or {from: 1, count: 1000}: one case for each combination."""
    list: Annotated[tuple[Annotated[dict[ValuePath, Any], Field(min_length=1)], ...] | None, Field(min_length=1)] = None
    """Values by path for each case."""

    @model_validator(mode="after")
    def _one_of_two(self) -> Self:
        if (self.grid is None) == (self.list is None):
            raise rejected("needs either grid (all combinations) or list (case by case)")
        count = len(self.list or ())
        if self.grid is not None:
            numbers = (item.count if isinstance(item, CountPart) else len(item) for item in self.grid.values())
            count = math.prod(numbers)
        if count > MAX_CASES:
            shown = count if count <= 10**9 else "more than 10^9"
            raise rejected(f"makes {shown} cases; at most {MAX_CASES} are run")
        paths = self.grid or {path for case in self.list or () for path in case}
        if len(paths) > limits.SWEEP_PATHS:
            raise rejected(f"names {len(paths)} different paths; at most {limits.SWEEP_PATHS} are swept")
        return self


@dataclass(frozen=True)
class SweepCase:
    """One case: its name, and the values that it replaces by the texts of their paths."""

    name: str
    values: Mapping[str, Node]


def cases(root: Node, name: str) -> tuple[SweepCase, ...]:
    """Return the cases of a scenario's tree, whose `sweep` is valid; none when it has no sweep.

    A case is called NAME[key=value,...]: of each path the shortest end that no other path shares, and the values as
    they are written, without what does not belong in a file's name. A case whose name would be too long, or that of
    another one, is called by its number, NAME[3].
    """
    sweep = root.child("sweep")
    if sweep is None:
        return ()
    combinations = list(_combinations(sweep))
    values_each = _nodes(root) - _nodes(sweep)  # no case has the sweep itself
    if len(combinations) * values_each > limits.SWEEP_VALUES:
        rule = f"makes {len(combinations)} cases of {values_each} values each; at most {limits.SWEEP_VALUES} values"
        raise ScenarioError([sweep.place.problem(f"sweep {rule} are read altogether")])
    labels = _labels(list(dict.fromkeys(path for values in combinations for path in values)))
    names: dict[str, None] = {}
    found = []
    for number, values in enumerate(combinations, start=1):
        inside = ",".join(f"{labels[path]}={_label(node)}" for path, node in values.items())
        called = f"{name}[{inside}]"
        if len(called) > MAX_NAME or called in names:
            called = f"{name}[{number}]"
        names[called] = None
        found.append(SweepCase(called, values))
    return tuple(found)


def replaced(root: Node, case: SweepCase, problems: list[Problem]) -> Node:
    """Return a scenario's tree with a case's name and values; what shares no change is shared.

    Paths that name nothing are appended to `problems`.
    """
    tree = Node(root.place, dict(root.mapping), dict(root.keys))
    del tree.mapping["sweep"]
    title = tree.mapping["name"]
    tree.mapping["name"] = Node(title.place, case.name, text=case.name)
    for written, value in case.values.items():
        found = _resolve(tree, written)
        if isinstance(found, str):
            problems.append(_written_at(root, written, value).problem(f"sweep path {written!r} {found}"))
        else:
            tree = _with(tree, found, value)
    return tree


def _written_at(root: Node, path: str, value: Node) -> Place:
    """Return where a path of a sweep is written: a grid's once for all its values, a list's in each of its cases."""
    sweep = root.child("sweep")
    grid = None if sweep is None else sweep.child("grid")
    return value.place if grid is None else grid.keys.get(path, value.place)


def _combinations(sweep: Node) -> Iterator[dict[str, Node]]:
    grid, listed = sweep.child("grid"), sweep.child("list")
    if grid is not None:
        paths = list(grid.mapping)
        for values in itertools.product(*(_values(grid.mapping[path]) for path in paths)):
            yield dict(zip(paths, values, strict=True))
    elif listed is not None:
        for entry in listed.sequence:
            yield dict(entry.mapping)


def _values(node: Node) -> list[Node]:
    """Return the values of a path in a grid: those of a list, or the numbers that are counted."""
    first, number = (node.child(key) for key in ("from", "count"))
    if first is None or number is None:
        return node.sequence
    assert isinstance(first.value, int) and isinstance(number.value, int)
    counted = range(first.value, first.value + number.value)
    return [Node(node.place, value, text=str(value)) for value in counted]


def _nodes(node: Node) -> int:
    """Return how many values a tree has, with those that aliases share counted each time."""
    return 1 + sum(map(_nodes, (*node.mapping.values(), *node.sequence)))


def _labels(paths: Sequence[str]) -> dict[str, str]:
    """Return the shortest end of each path, in whole steps, that is not the end of another one."""
    steps = {path: re.split(r"\.|(?=\[)", path) for path in paths}
    ends = {path: [tuple(mine[-count:]) for count in range(1, len(mine) + 1)] for path, mine in steps.items()}
    shared = Counter(end for mine in ends.values() for end in mine)
    return {
        path: _safe(".".join(next((end for end in mine if shared[end] == 1), mine[-1]))) for path, mine in ends.items()
    }


def _label(node: Node) -> str:
    if isinstance(node.value, list):
        return "_".join(_label(item) for item in node.value)
    if isinstance(node.value, dict):
        return "_".join(f"{key}={_label(item)}" for key, item in node.value.items())
    return _safe(str(node.value) if isinstance(node.value, str) else node.text or "null")


def _safe(text: str) -> str:
    return _UNSAFE.sub("_", text.replace(" ", "").replace("[", "").replace("]", ""))


def _resolve(root: Node, written: str) -> KeyPath | str:
    """Return the path that a text stands for, or the rule that it breaks; names may hold dots, so the longest wins."""
    from replay.scenario.problems import did_you_mean

    node, rest = root, written
    path: list[str | int] = []
    while rest:
        if isinstance(node.value, list):
            index = re.match(r"\[([0-9]+)\]\.?", rest)
            if index is None or int(index[1]) >= len(node.value):
                return f"names nothing: {dotted(tuple(path))} is a list of {len(node.value)}, from [0] on"
            path.append(int(index[1]))
            node, rest = node.value[int(index[1])], rest[index.end() :]
            continue
        if not isinstance(node.value, dict):
            return f"names nothing: {dotted(tuple(path))} = {node.shown()} has no parts"
        known = [key for key in node.mapping if rest == key or rest.startswith((f"{key}.", f"{key}["))]
        key = max(known, key=len, default=re.split(r"\.|\[", rest)[0])
        rest = rest[len(key) :].removeprefix(".")
        path.append(key)
        if path[0] in _FIXED:
            return f"cannot be swept: {path[0]} belongs to the file"
        if key not in node.mapping:
            if rest and tuple(path) not in _MAY_BE_LEFT_OUT:
                return f"names nothing: there is no {dotted(tuple(path))}; {did_you_mean(key, node.mapping)}"
            node = Node(node.place, {} if rest else None)
        else:
            node = node.mapping[key]
    return tuple(path)


def _with(node: Node, path: KeyPath, value: Node) -> Node:
    """Return a tree in which the value at a path is another one."""
    if not path:
        return value
    step, *rest = path
    if isinstance(step, int):
        items = list(node.sequence)
        items[step] = _with(items[step], tuple(rest), value)
        return Node(node.place, items)
    below = node.mapping.get(step, Node(value.place, {}))
    mapping = {**node.mapping, step: _with(below, tuple(rest), value)}
    return Node(node.place, mapping, {**node.keys, step: value.place if not rest else node.keys.get(step, value.place)})
