"""Include files: fragments of the language merged into one tree before it is validated."""

from __future__ import annotations

from typing import Final

from replay import limits
from replay.errors import Problem
from replay.language.node import Node
from replay.scenario.model import Scenario
from replay.scenario.source import Library, SourceRule, dotted, problem_at, resolve_name
from replay.scenario.yaml_text import parse
from replay.sensing.kinds import KINDS

MAX_INCLUDE_DEPTH: Final = 8
FRAGMENT_KEYS: Final = ("include", "links", "poses", "motion", "collision", "sensors", "guards", "model", "expect")

_MERGED_MAPS: Final = {
    ("links",),
    ("poses",),
    ("motion",),
    ("motion", "points"),
    ("motion", "free"),
    ("collision",),
    ("sensors",),
    *(("sensors", kind) for kind in KINDS),
    ("guards",),
}
_MERGED_LISTS: Final = {("motion", "moves"), ("collision", "disable"), ("expect",)}


class ScenarioText:
    """All text files of one scenario: read once, merged, with every problem found.

    Attributes:
        sources: bytes by name of every file read.
        names: source name by the name that places carry.
        whole: whether nothing was left out; else names may be missing that were meant to be there.
    """

    def __init__(self, library: Library, problems: list[Problem]) -> None:
        self.library = library
        self.problems = problems
        self.sources: dict[str, bytes] = {}
        self.names: dict[str, str] = {}
        self.whole = True

    def read(self) -> Node | None:
        """Return the merged tree of the main file, or None when that file cannot be read at all."""
        try:
            data = self.library.read(self.library.main)
        except SourceRule as error:
            self.problems.append(Problem(str(error), file=self.library.shown(self.library.main)))
            return None
        return self._tree(self.library.main, data, ())

    def _tree(self, name: str, data: bytes, above: tuple[str, ...]) -> Node | None:
        self.sources[name] = data
        shown = self.library.shown(name)
        if sum(map(len, self.sources.values())) > limits.YAML_TOTAL:
            rule = f"with what was included before it has more than the {limits.YAML_TOTAL} bytes that are read"
            self.problems.append(Problem(rule, file=shown))
            self.whole = False
            return None
        self.names[shown] = name
        root = parse(data, shown, self.problems)
        self.whole &= root is not None and root.whole
        if root is None:
            return None
        if not isinstance(root.value, dict):
            what = "a scenario" if not above else "an included file"
            self.problems.append(root.place.problem(f"{what} is a mapping (key: value), not {root.shown()}"))
            self.whole = False
            return None
        if above:
            for key in [key for key in root.mapping if key not in FRAGMENT_KEYS]:
                self.whole &= key in Scenario.model_fields
                rule = f"{key} does not belong in an included file; it may hold {', '.join(FRAGMENT_KEYS)}"
                self.problems.append(root.keys[key].problem(rule))
                del root.mapping[key]
        include = root.child("include")
        if include is None:
            return root
        merged = Node(root.place, {}, {})
        for index, entry in enumerate(include.sequence):
            if isinstance(entry.value, str):
                part = self._included(root, index, entry.value, name, (*above, name))
                if part is not None:
                    self._merge(merged, part, ())
        self._merge(merged, root, ())
        return merged

    def _included(self, root: Node, index: int, written: str, base: str, above: tuple[str, ...]) -> Node | None:
        try:
            name = resolve_name(written, base)
            if name in above:
                raise SourceRule(f"includes itself: {' -> '.join((*above[above.index(name) :], name))}")
            if len(above) > MAX_INCLUDE_DEPTH:
                raise SourceRule(f"is included more than {MAX_INCLUDE_DEPTH} files deep")
            if name in self.sources:
                return None  # two files may include the same third one; it counts once
            data = self.library.read(name)
        except SourceRule as error:
            self.problems.append(problem_at(root, ("include", index), str(error)))
            self.whole = False
            return None
        part = self._tree(name, data, above)
        if part is not None:
            part.mapping.pop("include", None)
        return part

    def _merge(self, into: Node, part: Node, path: tuple[str, ...]) -> None:
        """Merge a mapping into another: sections by their entries, lists one after the other, no name twice."""
        for key, node in part.mapping.items():
            here = (*path, key)
            there = into.mapping.get(key)
            if there is None:
                into.keys[key] = part.keys[key]
                if isinstance(node.value, dict) and here in _MERGED_MAPS:
                    into.mapping[key] = Node(node.place, dict(node.value), dict(node.keys))
                elif isinstance(node.value, list) and here in _MERGED_LISTS:
                    into.mapping[key] = Node(node.place, list(node.value))
                else:
                    into.mapping[key] = node
            elif here in _MERGED_MAPS and isinstance(there.value, dict) and isinstance(node.value, dict):
                self._merge(there, node, here)
            elif here in _MERGED_LISTS and isinstance(there.value, list) and isinstance(node.value, list):
                there.value.extend(node.value)
            else:
                rule = f"{dotted(here)} is defined twice; the first is at {into.keys[key]}"
                self.problems.append(part.keys[key].problem(rule))
                self.whole = False
