"""One concept, one place: no name stands for two things, and what several rooms use is written once."""

import ast
from collections import defaultdict
from pathlib import Path

import pytest

import replay

PACKAGE = Path(replay.__file__).parent
TREES = {str(path.relative_to(PACKAGE)): ast.parse(path.read_text()) for path in sorted(PACKAGE.rglob("*.py"))}


def names_in(tree: ast.Module) -> set[str]:
    """Return names, attributes and what is imported."""
    found = {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)}
    found |= {node.attr for node in ast.walk(tree) if isinstance(node, ast.Attribute)}
    imports = [node for node in ast.walk(tree) if isinstance(node, ast.Import | ast.ImportFrom)]
    found |= {alias.name for node in imports for alias in node.names}
    return found | {node.module for node in imports if isinstance(node, ast.ImportFrom) and node.module}


def test_no_two_classes_have_the_same_name():
    """Else give one a longer name: what is written in YAML ends in Part, what is in a file begins with its format."""
    places = defaultdict(list)
    for path, tree in TREES.items():
        for node in ast.walk(tree):
            if isinstance(node, ast.ClassDef):
                places[node.name].append(f"{path}:{node.lineno}")
    assert {name: where for name, where in places.items() if len(where) > 1} == {}


@pytest.mark.parametrize(
    ("name", "home"),
    [
        ("fnmatch", "language/globs.py"),
        ("fnmatchcase", "language/globs.py"),
    ],
)
def test_what_several_rooms_need_is_taken_from_its_one_place(name, home):
    assert [path for path, tree in TREES.items() if name in names_in(tree) and path != home] == []


@pytest.mark.parametrize("name", ["PairRules", "CollisionEntries", "contacts"])
def test_sparse_results_stay_inside_collision_and_bench(name):
    """Pairs by rule and contacts alone are for benchmarks: no scenario makes them, and none is advised to."""
    outside = [path for path in TREES if path.split("/")[0] not in ("collision", "bench")]
    assert [path for path in outside if name in names_in(TREES[path])] == []
    texts = [PACKAGE / "README.md", PACKAGE.parent / "README.md", *sorted((PACKAGE.parent / "schemas").iterdir())]
    assert [str(path) for path in texts if name in ("PairRules", "CollisionEntries") and name in path.read_text()] == []
