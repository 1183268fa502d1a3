"""Which tests are about a module: its mirror, those that import it, and those that import what imports it."""

from __future__ import annotations

import ast
from collections import deque
from pathlib import Path

LATE = ("tests/test_architecture.py", "tests/test_wheel.py", "tests/scenarios/", "tests/bench/", "tests/fuzz/")
"""Tests that reach everything: asked last."""


class Targets:
    """The imports of a tree: of the package's modules, of tests, and of what tests share."""

    def __init__(self, root: Path) -> None:
        self._tests = sorted(str(path.relative_to(root)) for path in (root / "tests").rglob("test_*.py"))
        files = [*(root / "replay").rglob("*.py"), *(root / "tests").rglob("*.py")]
        modules = {_module(path.relative_to(root)): str(path.relative_to(root)) for path in files}
        self._imported_by: dict[str, set[str]] = {}
        for path in files:
            for name in _imports(path, ".".join(path.relative_to(root).parent.parts)):
                if name in modules:
                    self._imported_by.setdefault(modules[name], set()).add(str(path.relative_to(root)))

    def of(self, file: str) -> list[str]:
        """Return the test files that are about a module, given from the root: the nearest first."""
        distance = {file: 0}
        queue = deque([file])
        while queue:
            for other in self._imported_by.get(at := queue.popleft(), ()):
                if other not in distance:
                    distance[other] = distance[at] + 1
                    queue.append(other)
        folder, _, name = file.removeprefix("replay/").rpartition("/")
        mirror = str(Path("tests", folder, f"test_{name}"))
        known = [test for test in self._tests if test in distance or test == mirror]

        def order(test: str) -> tuple[bool, int, bool]:
            return (
                test.startswith(LATE),
                0 if test == mirror else distance[test],
                Path(test).parent != Path("tests", folder),
            )

        return sorted(known, key=order)

    def importers(self, file: str) -> set[str]:
        """Return the files that import a module themselves."""
        return self._imported_by.get(file, set())

    @property
    def tests(self) -> list[str]:
        """All test files."""
        return self._tests


def _module(path: Path) -> str:
    name = ".".join(path.with_suffix("").parts)
    return name.removesuffix(".__init__")


def _imports(path: Path, package: str) -> set[str]:
    """Return the modules that one names: also by a text, as those are imported by that are imported when first used."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            found |= {node.module} | {f"{node.module}.{alias.name}" for alias in node.names}
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and node.value.isidentifier():
            found |= {f"{package}.{node.value}", f"{package}.{node.value}_"}
    return found
