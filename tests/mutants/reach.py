"""Which tests execute a line: learned from one run of each test file under `coverage`, and kept until the file changes.

Compiled kernels are not seen by `coverage`. Of a line that no test executes those tests are taken that execute what
names it: the caller of a kernel, the user of a constant.
"""

from __future__ import annotations

import ast
import hashlib
import json
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from tests.mutants.mutations import Mutation
from tests.mutants.targets import LATE, Targets
from tests.mutants.trial import Tree

ENOUGH = 12
"""Tests that execute a line; then no further file is asked which of its tests do."""
_LONGEST = 30.0  # seconds of a single test, and
_ALL = 240.0  # of all tests of a file, while it is learned which lines they execute
_SURE = 2  # of the nearest files it is always learned


@dataclass
class _Known:
    """What is known of a test file: seconds of each test that passes, and by module and line a set of them as bits."""

    seconds: dict[str, float]
    lines: dict[str, dict[int, int]]
    tests: list[str] = field(init=False)

    def __post_init__(self) -> None:
        self.tests = list(self.seconds)

    def of(self, file: str, begin: int, end: int) -> list[str]:
        """Return the tests that execute a line of a module from `begin` to `end`."""
        found = 0
        for line, bits in self.lines.get(file, {}).items():
            if begin <= line <= end:
                found |= bits
        return [test for number, test in enumerate(self.tests) if found >> number & 1]


class Reach:
    """Asks which tests execute a line, and learns it of test files as it goes."""

    def __init__(self, tree: Tree, targets: Targets, folder: Path) -> None:
        self._tree = tree
        self._targets = targets
        self._folder = folder
        self._known: dict[str, _Known] = {}
        self._names = _Names(tree.root, targets)
        folder.mkdir(parents=True, exist_ok=True)

    def tests(self, mutation: Mutation) -> dict[str, float]:
        """Return the tests that may notice a fault, with their seconds, those that most probably do first.

        First come those that execute the line, the nearest file's first and in it the quickest; then the others of
        these files, which may share what was computed by the first that asked for it.
        """
        places = list(self._names.places(mutation))
        first: dict[str, float] = {}
        then: dict[str, float] = {}
        for number, file in enumerate(self._targets.of(mutation.file)):
            if len(first) >= ENOUGH and number >= _SURE:
                break
            known = self._learned(file)
            # the nearest place of which tests are known: the line itself, else what names it
            found = next((of for level in places if (of := [t for p in level for t in known.of(*p)])), [])
            for test in sorted(dict.fromkeys(found), key=known.seconds.__getitem__):
                first[test] = known.seconds[test]
            if found:
                then |= known.seconds
        late = {test: seconds for test, seconds in first.items() if test.startswith(LATE)}
        return (
            {test: s for test, s in first.items() if test not in late}
            | late
            | {test: seconds for test, seconds in then.items() if test not in first}
        )

    def is_sound(self, test: str) -> bool:
        """Return whether a test passed when its file was learned."""
        return test in self._learned(test.partition("::")[0]).seconds

    def _learned(self, test_file: str) -> _Known:
        """Return what is known of a test file; run it when it is new or has changed."""
        if test_file in self._known:
            return self._known[test_file]
        text = (self._tree.root / test_file).read_bytes()
        stored = self._folder / f"{test_file.replace('/', '.')}.json"
        key = hashlib.sha256(text).hexdigest()
        found = json.loads(stored.read_text()) if stored.exists() else {}
        if found.get("key") != key:
            outcome = self._tree.run([test_file], _ALL, compiled=True, faultless=True, each=_LONGEST, reach=True)
            found = {"key": key, "seconds": outcome.by_test, "lines": outcome.lines}
            stored.write_text(json.dumps(found))
        lines = {file: {int(line): int(bits, 16) for line, bits in of.items()} for file, of in found["lines"].items()}
        self._known[test_file] = _Known(found["seconds"], lines)
        return self._known[test_file]


Place = tuple[str, int, int]
"""A module and its lines from one to another."""


class _Names:
    """Who names what: functions, classes and constants of the package and of the tests, found by their names."""

    def __init__(self, root: Path, targets: Targets) -> None:
        self._targets = targets
        self._files: dict[str, ast.Module] = {}
        self._users: dict[str, set[tuple[str, str]]] = {}
        self._spans: dict[tuple[str, str], Place] = {}
        for path in [*sorted((root / "replay").rglob("*.py")), *sorted((root / "tests").rglob("*.py"))]:
            file = str(path.relative_to(root))
            tree = self._files[file] = ast.parse(path.read_text(encoding="utf-8"))
            for name, node in _symbols(tree):
                self._spans[file, name] = (file, node.lineno, node.end_lineno or node.lineno)
                for used in _used(node):
                    self._users.setdefault(used, set()).add((file, name))

    def places(self, mutation: Mutation) -> Iterator[list[Place]]:
        """Yield the lines of a mutation, then those of what names its symbol, of what names that, and so on."""
        yield [self._statement(mutation)]
        at = {(mutation.file, self._symbol(mutation))}
        seen = set(at)
        while at:
            yield [self._spans[symbol] for symbol in at if symbol in self._spans]
            at = {user for file, name in at for user in self._users.get(name, ()) if self._sees(user[0], file)} - seen
            seen |= at

    def _sees(self, user: str, file: str) -> bool:
        return user == file or user in self._targets.importers(file)

    def _symbol(self, mutation: Mutation) -> str:
        for name, node in _symbols(self._files[mutation.file]):
            if node.lineno <= mutation.line <= (node.end_lineno or node.lineno):
                return name
        return ""

    def _statement(self, mutation: Mutation) -> Place:
        """Return the lines of the innermost statement, of one with a body those of its head."""
        spans = [(mutation.line, mutation.line)]
        for node in ast.walk(self._files[mutation.file]):
            if isinstance(node, ast.stmt) and node.lineno <= mutation.line <= (node.end_lineno or node.lineno):
                body = getattr(node, "body", None)
                spans.append((node.lineno, body[0].lineno - 1 if body else node.end_lineno or node.lineno))
        begin, end = max((s for s in spans if s[0] <= mutation.line <= s[1]), key=lambda s: (s[0], s[1]))
        return mutation.file, begin, end


def _symbols(tree: ast.Module) -> Iterator[tuple[str, ast.stmt]]:
    """Yield what a module defines: functions, classes, constants."""
    for node in tree.body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            yield node.name, node
        elif isinstance(node, ast.Assign | ast.AnnAssign):
            for target in node.targets if isinstance(node, ast.Assign) else [node.target]:
                yield ast.unparse(target), node


def _used(node: ast.AST) -> set[str]:
    names = {one.id for one in ast.walk(node) if isinstance(one, ast.Name)}
    return names | {one.attr for one in ast.walk(node) if isinstance(one, ast.Attribute)}
