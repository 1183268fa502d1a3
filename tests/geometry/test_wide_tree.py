"""The wide tree: every triangle once, boxes that hold what they should, in single precision too."""

import numpy as np
import pytest

from replay.geometry.surface_boxes import AXES, BOX, CENTRE, HALVES, SHORT
from replay.geometry.tree import triangle_tree
from replay.geometry.wide_tree import LANES, MAX_WAITING, WideTree, widen
from tests.sensing.distance.meshes import torus


def lines(count: int) -> np.ndarray:
    """Segments and points: triangles without area."""
    rng = np.random.default_rng(4)
    triangles = rng.normal(size=(count, 3, 3))
    triangles[::2, 2] = triangles[::2, 1]
    triangles[1::2] = triangles[1::2, :1]
    return triangles


def scenes() -> dict[str, np.ndarray]:
    rng = np.random.default_rng(1)
    soup = rng.normal(size=(2000, 1, 3)) + rng.normal(size=(2000, 3, 3)) * np.exp(rng.uniform(-9, 0, (2000, 1, 1)))
    return {
        "one": soup[:1],
        "a leaf": soup[:LANES],
        "a leaf and one": soup[: LANES + 1],
        "soup": soup,
        "torus": torus(60, 30),
        "far": torus(30, 12) * 0.1 + [1e6, -2e5, 3e5],
        "equal": np.ones((300, 3, 3)),
        "lines": lines(300),
        "geometric": np.outer(2.0 ** np.arange(-400, 400), np.ones(9)).reshape(-1, 3, 3) * [1.0, 0.5, 0.25],
        "tiny": soup * 1e-43,
        "huge": soup * 1e200,
    }


def parts_of(tree: WideTree) -> tuple[dict[tuple[int, int], list[int]], int]:
    """Return the triangles under each (node, lane), and most entries that a traversal had waiting."""
    parts: dict[tuple[int, int], list[int]] = {}

    def collect(node: int) -> list[int]:
        everything: list[int] = []
        for lane in range(LANES):
            if tree.boxes[node, LANES * HALVES + lane] == -np.inf:
                continue
            child = tree.children[node, lane]
            below = [int(k) for k in tree.indices[-1 - child] if k >= 0] if child < 0 else collect(child)
            parts[node, lane] = below
            everything += below
        return everything

    everything = collect(0)
    assert sorted(everything) == list(range(len(everything)))
    most, waiting = 0, [0]
    while waiting:
        most = max(most, len(waiting))
        node = waiting.pop()
        if node >= 0:
            waiting += [int(tree.children[node, lane]) for lane in range(LANES) if (node, lane) in parts]
    return parts, most


@pytest.mark.parametrize("name", scenes())
@pytest.mark.filterwarnings("ignore::RuntimeWarning")  # the huge and the geometric overflow single precision
def test_boxes_hold_their_triangles(name: str) -> None:
    triangles = np.ascontiguousarray(scenes()[name])
    tree = widen(triangle_tree(triangles), triangles)
    parts, most = parts_of(tree)
    assert len(parts) == np.sum(tree.boxes[:, LANES * HALVES : LANES * (HALVES + 1)] != -np.inf)
    assert sum(len(below) for below in parts.values()) >= len(triangles)
    assert most <= MAX_WAITING
    rounding = 8 * np.finfo(float).eps * tree.farthest.max()
    boxes = tree.boxes.astype(float).reshape(-1, BOX, LANES)
    for (node, lane), below in parts.items():
        box = boxes[node, :, lane]
        if not np.isfinite(box).all():  # too large for single precision: it must not exclude anything
            assert not (box[HALVES:] < 1e38).any()
            continue
        axes = box[AXES:HALVES].reshape(3, 3)
        np.testing.assert_allclose(axes @ axes.T, np.eye(3), rtol=0, atol=0.25 * SHORT)
        corners = triangles[below].reshape(-1, 3) - (tree.middle + box[CENTRE:AXES])
        assert (np.abs(corners @ axes.T) <= box[HALVES:] + rounding).all()
        # What the padding is for: the ball, and any direction g
        assert (np.linalg.norm(corners, axis=1) <= np.linalg.norm(box[HALVES:]) + rounding).all()
        assert (np.abs(corners) <= np.abs(axes).T @ box[HALVES:] + rounding).all()
    for leaf, indices in enumerate(tree.indices):
        held = indices[indices >= 0]
        stored = tree.corners[leaf].reshape(3, 3, LANES).transpose(2, 0, 1)
        np.testing.assert_array_equal(stored[: len(held)], triangles[held])
        np.testing.assert_array_equal(stored[len(held) :], np.broadcast_to(stored[0], (LANES - len(held), 3, 3)))


def test_equal_input_gives_the_equal_tree() -> None:
    triangles = torus(40, 20)
    first, second = (widen(triangle_tree(triangles), triangles) for _ in range(2))
    for a, b in zip(first, second, strict=True):
        np.testing.assert_array_equal(a, b)


def test_boxes_of_a_smooth_surface_are_flat_to_second_order() -> None:
    triangles = torus(400, 160)
    turn = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))[0]
    triangles = np.ascontiguousarray(triangles @ turn.T)
    tree = widen(triangle_tree(triangles), triangles)
    halves = np.sort(tree.boxes.astype(float).reshape(-1, BOX, LANES)[:, HALVES:], axis=1)
    leaves = (tree.children < 0) & (halves[:, 0] > 0.0)
    thick, wide = halves[:, 0][leaves], halves[:, 2][leaves]
    curvature = 1.0 / 0.4
    assert np.mean(thick < curvature * wide**2) > 0.98  # the rest face an axis, where an upright box is smaller
    assert np.median(thick / wide) < 0.03  # an upright box around a patch that faces anywhere: 0.5
