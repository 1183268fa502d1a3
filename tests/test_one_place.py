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


INSIDE = {
    "numba": [
        "numerics/jit/compiler.py",
        "numerics/jit/front_end.py",
        "numerics/jit/linking.py",
        "numerics/jit/records.py",
    ],
    "rerun": ["recording/rerun_inside.py"],
}
"""Where names of a library that are not public may stand; the text of the first says what to do about a release."""

PRIVATE = {
    "numba": {"_nrt", "_config_fname", "_library_class", "_cache", "_linking_libraries"},
    "rerun": {"rerun_bindings", "ChunkInternal", "_log_to_stream", "_internal"},
}
"""Names that are not public, besides those that are imported; numba documents one module of its core."""


def private_names(tree, library):
    """Return the names of a library that are not public and that a module uses."""
    imports = (node for node in ast.walk(tree) if isinstance(node, ast.ImportFrom) and node.module)
    modules = {f"{node.module}.{alias.name}" for node in imports for alias in node.names}
    inner = {name for name in modules if name.startswith((f"{library}.core.", f"{library}._"))} - {"numba.core.event"}
    texts = {node.value for node in ast.walk(tree) if isinstance(node, ast.Constant) and isinstance(node.value, str)}
    return inner | ((names_in(tree) | texts) & PRIVATE[library])


@pytest.mark.parametrize("library", INSIDE)
def test_what_is_not_public_of_a_library_stands_in_one_place(library):
    found = {path: private_names(tree, library) for path, tree in TREES.items()}
    outside = {path: names for path, names in found.items() if names and path not in INSIDE[library]}
    assert outside == {}, f"move it to {INSIDE[library][0]}, with a public way that does the same"
    assert all(found[path] for path in INSIDE[library])


@pytest.mark.parametrize("name", ["PairRules", "CollisionEntries", "CollisionPipeline.contacts"])
def test_sparse_results_stay_inside_collision_and_bench(name):
    """Pairs by rule and contacts alone are for benchmarks: no scenario makes them, and none is advised to."""
    outside = [path for path in TREES if path.split("/")[0] not in ("collision", "bench")]
    attribute = name.rpartition(".")[2]
    found = {path: [n for n in ast.walk(TREES[path]) if isinstance(n, ast.Attribute)] for path in outside}
    asked = [path for path, attributes in found.items() if any(node.attr == attribute for node in attributes)]
    assert asked + [path for path in outside if name in names_in(TREES[path])] == []
    texts = [PACKAGE / "README.md", PACKAGE.parent / "README.md", *sorted((PACKAGE.parent / "schemas").iterdir())]
    assert [str(path) for path in texts if name in path.read_text()] == []
