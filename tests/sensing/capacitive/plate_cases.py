"""Random triangles and plates, family by family, each a way in which a plate integral can go wrong."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Case = tuple[NDArray[np.float64], NDArray[np.float64], str]

FAMILIES = [
    "random",
    "region1",
    "parallel",
    "nearly_parallel",
    "two_equal",
    "far",
    "close",
    "sliver",
    "spans_all",
    "crosses_plane",
    "edge_parallel",
    "on_border",
    "coplanar_line",
    "tiny",
    "near_edge_line",
    "near_corner",
    "corner_contact",
    "vertex_on_border",
    "sliver_across",
    "small_plate",
    "both_crossing",
    "edge_over_corner",
]


def case(family: str, rng: np.random.Generator) -> Case:
    """Return corners (3, 3), half size (2,) and side of one random case."""
    half = 10 ** rng.uniform(-2.3, -0.5, 2)
    side = "both" if rng.random() < 0.25 else "front"
    size = 10 ** rng.uniform(-2, 0.3)
    p = rng.uniform(-1, 1, (3, 3)) * size
    p[:, 2] = np.abs(p[:, 2])
    k = int(rng.integers(2))
    border = half[k] * rng.choice([-1, 1])
    if family == "region1":
        p[:, :2] = rng.uniform(-1, 1, (3, 2)) * half
    elif family == "parallel":
        p[:, 2] = p[0, 2]
    elif family == "nearly_parallel":
        p[:, 2] = p[0, 2] * (1 + 10 ** rng.uniform(-13, -3) * rng.uniform(-1, 1, 3))
    elif family == "two_equal":
        p[1, 2] = p[0, 2]
    elif family == "far":
        direction = rng.normal(size=3)
        direction[2] = abs(direction[2])
        p += direction / np.linalg.norm(direction) * 10 ** rng.uniform(0.5, 3.5)
        p[:, 2] = np.abs(p[:, 2])
    elif family == "close":
        p[:, 2] = 10 ** rng.uniform(-10, -3, 3)
    elif family in ("sliver", "sliver_across"):
        p[2] = p[0] + rng.uniform() * (p[1] - p[0]) + 10 ** rng.uniform(-9, -2) * size * rng.normal(size=3)
        p[:, 2] = np.abs(p[:, 2])
        if family == "sliver_across":
            p[0, k], p[1, k] = -abs(p[0, k]) - half[k], abs(p[1, k]) + half[k]
    elif family == "spans_all":
        p[:, :2] = rng.uniform(0.5, 8, (3, 1)) * np.array([[1, 0.3], [-0.6, 0.8], [-0.5, -0.9]]) @ _turn(rng) * size
    elif family in ("crosses_plane", "both_crossing"):
        p[:, k] = np.sign(border) * (half[k] + np.abs(p[:, k]) + 10 ** rng.uniform(-6, -1))
        p[:, 2] = size * rng.uniform(-1, 1, 3)
        side = "both" if family == "both_crossing" else side
    elif family == "edge_parallel":
        p[:, 1 - k] = p[0, 1 - k]
    elif family == "on_border":
        p[:2, k] = border
    elif family == "coplanar_line":
        # the triangle's plane holds the line of the plate's edge x_k = border
        slope = rng.uniform(0.2, 3)
        reach = rng.uniform(0.05, 1, 3) * size
        p[:, k], p[:, 2] = border + np.sign(border) * reach, slope * reach
    elif family == "tiny":
        p = p[0] + 10 ** rng.uniform(-9, -5) * rng.normal(size=(3, 3))
        p[:, 2] = np.abs(p[:, 2])
    elif family == "near_edge_line":
        p[:, k] = border + np.sign(border) * 10 ** rng.uniform(-11, 0, 3) * size
        p[:, 2] = 10 ** rng.uniform(-11, 0, 3) * size
    elif family == "near_corner":
        corner = half * rng.choice([-1, 1], 2)
        p[:, :2] = corner * (1 + 10 ** rng.uniform(-11, 0, (3, 1)) * rng.uniform(-0.3, 1, (3, 2)))
        p[:, 2] = 10 ** rng.uniform(-11, 0, 3) * size
    elif family == "corner_contact":
        p[0] = [half[0] * rng.choice([-1, 1]), half[1] * rng.choice([-1, 1]), 0.0]
    elif family == "vertex_on_border":
        p[0, 2] = 0.0
        p[0, k], p[0, 1 - k] = border, rng.uniform(-1, 1) * half[1 - k]
    elif family == "edge_over_corner":
        p = before_a_corner(half, rng)
    elif family == "small_plate":
        half = half * 10 ** rng.uniform(-3, -1)
    return p[rng.permutation(3)], half, side


def before_a_corner(half: NDArray[np.float64], rng: np.random.Generator) -> NDArray[np.float64]:
    """Return a triangle parallel to the plate but for last digits, an edge of which passes before corners of it.

    So stand the walls and boxes of scenes before a plate that looks along an axis.
    """
    corner = half * rng.choice([-1, 1], 2)
    near, far = rng.choice([5.0, 7.0, 10.0, 13.0], 2)
    p = np.full((3, 3), rng.uniform(0.2, 2.0) * half.max() * near)
    p[0, :2], p[1, :2] = near * corner, -far * corner
    p[2, :2] = p[0, 0], p[1, 1]
    return p + np.spacing(p) * rng.integers(-1, 2, (3, 3))


def _turn(rng: np.random.Generator) -> NDArray[np.float64]:
    angle = rng.uniform(0, 2 * np.pi)
    return np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
