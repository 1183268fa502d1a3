"""The farthest vertex of a set by its table of directions, against all vertices."""

from __future__ import annotations

import itertools

import numba
import numpy as np
import pytest

from replay.collision.support import FEW, MARGIN, candidates, farthest, make_sets
from replay.geometry import primitives
from tests.amounts import COMPILED, cases


@numba.njit
def find(sets, k, x, y, z):
    return farthest(sets, sets.first[k], sets.first[k + 1], sets.table[k], sets.side[k], x, y, z)


@numba.njit
def listed(sets, k, x, y, z):
    return candidates(sets, sets.table[k], sets.side[k], x, y, z)


def bodies():
    rng = np.random.default_rng(1)
    ball = rng.normal(size=(max(40, cases(400)), 3))
    ball /= np.linalg.norm(ball, axis=1)[:, None]
    return [
        primitives.cube(1.0).vertices,
        0.5 * ball + (3.0, -2.0, 1.0),
        ball * (1.0, 0.01, 5.0),
        primitives.cylinder(0.3, 2.0, 1e-3 if COMPILED else 0.05).vertices,
        rng.normal(size=(FEW, 3)),
        rng.normal(size=(FEW + 1, 3)),
    ]


def directions(rng):
    """Any way, those along axes, diagonals and borders of cells, short and long ones."""
    yield from (np.array(way, dtype=float) for way in itertools.product((-1, 0, 1), repeat=3) if any(way))
    for _ in range(cases(300)):
        yield rng.normal(size=3) * 10.0 ** rng.integers(-8, 8)
        share = rng.integers(0, 9, size=3) / 8.0
        if share.any():
            yield share * rng.choice((-1.0, 1.0), size=3)


def test_the_vertex_found_is_as_far_as_any():
    shapes = bodies()
    first = np.cumsum([0, *map(len, shapes)])
    rng = np.random.default_rng(2)
    with_tables, without = (make_sets(np.concatenate(shapes), first, tables=tables) for tables in (True, False))
    assert (with_tables.side > 0).tolist() == [len(shape) > FEW for shape in shapes]
    assert not without.side.any() and len(without.candidates) == 0
    for way in directions(rng):
        for k, shape in enumerate(shapes):
            highest = float((shape @ way).max())
            for sets in (with_tables, without):
                row = find(sets, k, *way)
                assert first[k] <= row < first[k + 1]
                assert sets.vertices[row] @ way >= highest - 4e-16 * np.abs(shape).max() * np.abs(way).sum()


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_a_cell_leaves_out_only_what_is_lower_by_the_margin_and_is_short(scale):
    shapes = [scale * shape for shape in bodies()]
    first = np.cumsum([0, *map(len, shapes)])
    sets = make_sets(np.concatenate(shapes), first)
    rng = np.random.default_rng(3)
    lengths = []
    for way in directions(rng):
        for k in np.flatnonzero(sets.side):
            begin, end = listed(sets, k, *way)
            rows = sets.candidates[begin:end]
            assert first[k] <= rows.min() and rows.max() < first[k + 1]
            left_out = np.setdiff1d(np.arange(first[k], first[k + 1]), rows)
            heights = sets.vertices @ way
            if len(left_out):
                gap = heights[rows].max() - heights[left_out].max()
                assert gap >= sets.margin[k] * np.abs(way).sum() * (1 - 1e-6)
            lengths.append(len(rows))
        assert sets.margin[1] == MARGIN * np.abs(shapes[1]).max()
    assert np.mean(lengths) < 40


@pytest.mark.parametrize("way", [(np.nan, 1.0, 0.0), (0.0, 0.0, 0.0), (1e300, 1e300, 0.0), (1e-300, 0.0, 0.0)])
def test_what_is_no_direction_gives_a_vertex_all_the_same(way):
    shapes = bodies()
    first = np.cumsum([0, *map(len, shapes)])
    sets = make_sets(np.concatenate(shapes), first)
    for k in range(len(shapes)):
        assert first[k] <= find(sets, k, *way) < first[k + 1]


def test_centres_are_the_means_of_the_vertices():
    shapes = bodies()
    sets = make_sets(np.concatenate(shapes), np.cumsum([0, *map(len, shapes)]))
    np.testing.assert_allclose(sets.center, [shape.mean(axis=0) for shape in shapes], rtol=0, atol=1e-13)
    np.testing.assert_array_equal(sets.flat.reshape(-1, 3), sets.vertices)
