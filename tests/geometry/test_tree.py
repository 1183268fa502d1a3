"""The box tree: every part once, boxes exact, depth bounded, the same tree every time."""

import time

import numpy as np
import pytest

from replay.errors import InvalidValue
from replay.geometry.tree import MAX_DEPTH, Tree, build_tree, triangle_tree


def check(tree: Tree, lower: np.ndarray, upper: np.ndarray, leaf_size: int) -> int:
    """Assert every promise of `Tree` and return the number of levels."""
    assert sorted(tree.order) == list(range(len(lower)))
    assert (tree.begin[0], tree.end[0]) == (0, len(lower))
    deepest, seen = 0, 0
    waiting = [(0, 1)]
    while waiting:
        assert len(waiting) <= MAX_DEPTH
        node, depth = waiting.pop()
        seen += 1
        deepest = max(deepest, depth)
        parts = tree.order[tree.begin[node] : tree.end[node]]
        assert len(parts) > 0
        np.testing.assert_array_equal(tree.lower[node], lower[parts].min(axis=0))
        np.testing.assert_array_equal(tree.upper[node], upper[parts].max(axis=0))
        if tree.second[node] < 0:
            assert len(parts) <= leaf_size
            continue
        first, second = node + 1, tree.second[node]
        assert tree.begin[first] == tree.begin[node] and tree.end[first] == tree.begin[second]
        assert tree.end[second] == tree.end[node]
        waiting += [(second, depth + 1), (first, depth + 1)]
    assert seen == len(tree.second)
    return deepest


def scenes() -> dict[str, np.ndarray]:
    rng = np.random.default_rng(1)
    return {
        "one": rng.normal(size=(1, 3)),
        "equal": np.ones((300, 3)),
        "line": np.outer(np.arange(300.0), [1.0, 0.0, 0.0]),
        "geometric": np.outer(2.0 ** np.arange(-500, 500), [1.0, 1.0, 1.0]),
        "cloud": rng.normal(size=(2000, 3)),
        "far": rng.normal(size=(200, 3)) + 1e9,
        "tiny": rng.normal(size=(200, 3)) * 1e-200,
        "huge": rng.normal(size=(200, 3)) * 1e307,
    }


@pytest.mark.parametrize("name", scenes())
@pytest.mark.parametrize("leaf_size", [1, 4])
def test_promises(name: str, leaf_size: int) -> None:
    centres = scenes()[name]
    half = np.random.default_rng(2).uniform(0, 1e-3, centres.shape) * np.abs(centres)
    lower, upper = centres - half, centres + half
    tree = build_tree(lower, upper, leaf_size=leaf_size)
    assert check(tree, lower, upper, leaf_size) <= MAX_DEPTH
    for again, array in zip(build_tree(lower, upper, leaf_size=leaf_size), tree, strict=True):
        np.testing.assert_array_equal(again, array)


def test_triangles_quickly() -> None:
    rng = np.random.default_rng(3)
    corners = rng.uniform(size=(100_000, 1, 3)) + 0.01 * rng.normal(size=(100_000, 3, 3))
    triangle_tree(corners[:10])
    start = time.process_time()
    tree = triangle_tree(corners)
    assert time.process_time() - start < 1.0  # 0.06 s alone; a shared machine may be slower
    check_every = rng.integers(len(tree.second), size=50)
    for node in check_every:
        parts = corners[tree.order[tree.begin[node] : tree.end[node]]]
        np.testing.assert_array_equal(tree.lower[node], parts.min(axis=(0, 1)))
        np.testing.assert_array_equal(tree.upper[node], parts.max(axis=(0, 1)))


@pytest.mark.parametrize(
    "lower, upper, leaf_size",
    [
        (np.zeros((0, 3)), np.zeros((0, 3)), 4),
        (np.zeros((2, 2)), np.zeros((2, 2)), 4),
        (np.zeros((2, 3)), np.zeros((1, 3)), 4),
        (np.ones((2, 3)), np.zeros((2, 3)), 4),
        (np.full((2, 3), np.nan), np.zeros((2, 3)), 4),
        (np.zeros((2, 3)), np.full((2, 3), np.inf), 4),
        (np.zeros((2, 3)), np.zeros((2, 3)), 0),
    ],
)
def test_bad_input(lower: np.ndarray, upper: np.ndarray, leaf_size: int) -> None:
    with pytest.raises(InvalidValue):
        build_tree(lower, upper, leaf_size=leaf_size)
