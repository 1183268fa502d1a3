"""Frames between those that are solved, beside functions that are known everywhere."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from replay.sensing.electrostatics.bem import BemReading
from replay.sensing.electrostatics.keyframes import Followed, between_keys, pieces
from replay.sensing.electrostatics.spline import spline

Floats = NDArray[np.float64]


def line(x: Floats) -> Floats:
    """Return points (n, 1, 3) that move along x."""
    return np.stack([x, 0 * x, 0 * x], axis=1)[:, None]


def follow(
    values: Callable[[int], Floats], frames: int, proxy: Floats, tolerance: float = 5e-3
) -> tuple[Followed, list[int]]:
    asked: list[int] = []

    def solve(frame: int) -> BemReading:
        asked.append(frame)
        value = values(frame)
        return BemReading(value, 1e-3 * np.abs(value), value[None])

    found = between_keys(solve, proxy, [(0, frames - 1)], tolerance)
    assert found is not None and sorted(set(asked)) == np.flatnonzero(found.solved).tolist()
    return found, asked


def two(distance: float) -> Floats:
    """Return an increase like that of two plates before a body that comes near."""
    a, b = 1.0 / (distance * (1.0 + 3.0 * distance)), 0.3 / (0.4 + distance) ** 2
    return np.array([[a, 0.4 * np.sqrt(a * b)], [0.4 * np.sqrt(a * b), b]])


@pytest.mark.parametrize("n", [1, 2, 3, 4, 5, 9])
def test_a_spline_through_a_cubic_is_the_cubic(n: int) -> None:
    keys = np.cumsum(np.arange(1.0, n + 1.0))
    degree = min(n - 1, 3)
    weights = np.array([[1.0, -2.0], [0.3, 0.7], [-0.1, 0.02], [0.01, 0.005]])[: degree + 1]
    at = np.linspace(keys[0], keys[-1], 40)
    powers = at[:, None] ** np.arange(degree + 1)
    found = spline(keys, keys[:, None] ** np.arange(degree + 1) @ weights, at)
    assert found == pytest.approx(powers @ weights, rel=1e-9, abs=1e-9)


def test_a_smooth_motion_takes_few_solutions_and_every_frame_is_within_its_error() -> None:
    distance = 0.3 - 0.29 * np.sin(np.linspace(0.0, np.pi / 2, 257)) ** 2
    found, asked = follow(lambda k: two(distance[k]), 257, np.stack([1 / distance, 0 * distance + 1.0], axis=1))
    truth = np.stack([two(d) for d in distance])
    assert len(asked) < 40
    assert (np.abs(found.increase - truth) <= found.error + 1e-12)[~found.solved].all()
    assert found.increase == pytest.approx(truth, rel=5e-3)
    assert found.shares[:, 0] == pytest.approx(truth, rel=5e-3)
    jumps = np.abs(np.diff(np.log(found.increase[:, 0, 0])) - np.diff(np.log(truth[:, 0, 0])))
    assert jumps.max() < 2e-3


@pytest.mark.parametrize("seed", range(10))
def test_random_motions_keep_the_tolerance(seed: int) -> None:
    random = np.random.default_rng(seed)
    t = np.linspace(0.0, 1.0, 200)
    distance = 0.15 + 0.1 * np.cos(2 * np.pi * random.uniform(0.3, 3.0) * t + random.uniform(0.0, 6.0))
    found, _ = follow(lambda k: two(distance[k]), 200, np.ones((200, 2)))
    assert found.increase == pytest.approx(np.stack([two(d) for d in distance]), rel=1e-2)


def test_stops_jumps_and_kinks_are_ends_of_pieces() -> None:
    x = np.concatenate([np.linspace(0.0, 1.0, 11), np.full(5, 1.0), 3.0 + np.linspace(0.0, 0.5, 11)])
    state = np.zeros(len(x), np.int64)
    assert pieces(line(x), state) == [(0, 10), (10, 15), (16, 26)]
    bent = np.concatenate([np.linspace(0.0, 1.0, 11), 1.0 - np.linspace(0.1, 0.4, 4)])
    assert pieces(line(bent), np.zeros(15, np.int64)) == [(0, 10), (10, 14)]
    smooth = np.sin(np.linspace(0.0, 6.0, 100))
    assert pieces(line(smooth), np.zeros(100, np.int64)) == [(0, 99)]
    assert pieces(line(smooth), np.repeat([0, 1], 50)) == [(0, 49), (50, 99)]


def test_where_a_frame_has_no_answer_there_is_none_between() -> None:
    assert between_keys(lambda frame: None, np.ones((20, 1)), [(0, 19)], 1e-2) is None
