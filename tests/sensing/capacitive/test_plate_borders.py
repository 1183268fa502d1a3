"""Triangles that lie in a border plane or in z = 0, or have an edge there: every piece of them counts exactly once."""

import itertools

import numpy as np
import pytest

from replay.geometry.tree import triangle_tree
from replay.numerics import transforms
from replay.numerics.double_double import triangle_area
from replay.sensing.capacitive import exact, plate_integral
from replay.sensing.capacitive.area_share import share
from replay.sensing.capacitive.tree.clusters import make_clusters
from replay.sensing.capacitive.tree.tree_sum import COUNTS, sum_tree
from tests.amounts import cases
from tests.sensing.capacitive import plate_reference

_HALVES = [(1.0, 1.0), (1.0, 3.0), (0.25, 0.5), (0.3, 0.7)]
_SPANS = [(-2.0, 2.0), (-0.5, 2.0), (-2.0, 0.5), (-1.0, 1.0), (-0.5, 0.5), (1.0, 2.0), (-3.0, -1.0), (1.5, 2.0)]


def _upright(axis: int, border: float, span: tuple[float, float], heights: tuple[float, float, float]):
    """A triangle in the plane x_axis = border, from span[0] to span[1] along the other axis, in units of that half."""
    triangle = np.zeros((3, 3))
    triangle[:, axis] = border
    triangle[:, 1 - axis] = span[0], span[1], 0.5 * (span[0] + span[1])
    triangle[:, 2] = heights
    return triangle


def _in_borders():
    for half, axis, sign, span in itertools.product(_HALVES, range(2), (1.0, -1.0), _SPANS):
        across = half[1 - axis]
        for heights in ((1.0, 1.0, 2.0), (0.5, 2.0, 1.0), (-1.0, -2.0, -1.0)):
            yield _upright(axis, sign * half[axis], (span[0] * across, span[1] * across), heights), half
        if min(abs(span[0]), abs(span[1])) >= 1.0 and span[0] * span[1] > 0.0:
            # beside the plate it may cross z = 0
            heights = (-1.0, 1.0, 0.5) if abs(span[0]) > 1.0 else (0.5, -1.0, 1.0)
            yield _upright(axis, sign * half[axis], (span[0] * across, span[1] * across), heights), half


def _in_plate_plane():
    """Triangles in z = 0 beside the plate, with edges and corners on the border lines."""
    for half in _HALVES:
        for corners in (
            [[2, -2, 0], [2, 2, 0], [3, 0, 0]],
            [[1.5, -9, 0], [1.5, 9, 0], [2, 1, 0]],
            [[1, 1.5, 0], [1, 4, 0], [3, 1, 0]],
            [[1, 2, 0], [-1, 2, 0], [0, 5, 0]],
            [[-1, 2, 0], [-5, 2, 0], [-1, 7, 0]],
            [[1.25, -1, 0], [1.25, 1, 0], [4, 1, 0]],
            [[-3, -2, 0], [3, -2, 0], [0, -4, 0]],
        ):
            yield np.array(corners) * [*half, 0.0], half


def _orders(triangle):
    return np.array([triangle, triangle[::-1], triangle[[1, 2, 0]]])


@pytest.mark.parametrize("side", ["front", "both"])
def test_triangles_in_a_border_plane_agree_with_60_digits(side):
    for triangle, half in itertools.islice(_in_borders(), 0, None, 3):
        expected = float(plate_reference.plate_integral(triangle.tolist(), half, side))
        np.testing.assert_allclose(plate_integral(_orders(triangle), half, side=side), expected, rtol=1e-14)


def test_triangles_in_the_plane_of_the_plate_count_once():
    for triangle, half in _in_plate_plane():
        expected = float(plate_reference.plate_integral(triangle.tolist(), half, "both"))
        np.testing.assert_allclose(plate_integral(_orders(triangle), half, side="both"), expected, rtol=1e-14)
        assert (plate_integral(_orders(triangle), half, side="front") == 0.0).all()


def test_the_areas_of_the_pieces_add_up_to_the_triangle():
    rng = np.random.default_rng(4)
    scratch = np.empty(exact.SCRATCH)
    triangles = [*_in_borders(), *_in_plate_plane()]
    for lattice in range(cases(300)):
        half = _HALVES[lattice % len(_HALVES)]
        corners = rng.choice([-2.0, -1.0, 0.0, 1.0, 2.0], (3, 2)) * half
        triangles.append((np.column_stack([corners, rng.choice([0.0, 0.5, 1.0], 3)]), half))
    for triangle, half in triangles:
        if triangle_area(triangle) == 0.0:
            continue
        sides = (1.0, -1.0) if triangle[:, 2].min() < 0.0 < triangle[:, 2].max() else (1.0,)
        sides = sides if triangle[:, 2].max() > 0.0 or not triangle[:, 2].any() else (-1.0,)
        assert sum(_covered(triangle, sign, half, scratch) for sign in sides) == pytest.approx(1.0, rel=4e-16 * 9)


def _covered(triangle, sign, half, scratch) -> float:
    """The shares of all pieces that are summed."""
    polygon, slab, piece, spare = scratch
    count = exact._cut_by_plate_plane(triangle, sign, *half, polygon)
    total = 0.0
    for u in (exact.EAST, exact.WEST, exact.NONE):
        in_slab = exact._region(polygon, count, u, exact.EAST, 2.0 * half[0], slab, spare)
        for v in (exact.NORTH, exact.SOUTH, exact.NONE) if in_slab >= 3 else ():
            corners = exact._region(slab, in_slab, v, exact.NORTH, 2.0 * half[1], piece, spare)
            total += sum(share(piece, 0, k, k + 1, triangle) for k in range(1, corners - 1))
    return total


def test_a_wall_before_a_plate_that_looks_along_an_axis():
    # the diagonal of the wall passes before two corners of the plate, and the wall leans by the last digit: of a piece
    # that only rounding made, the share of the area was 0.45
    wall = [[-0.5, -0.49999999999999994, 0.84], [-0.5, 0.49999999999999994, 0.84]]
    wall.append([0.49999999999999994, 0.49999999999999994, 0.8400000000000001])
    expected = float(plate_reference.plate_integral(wall, [0.05, 0.05], "front"))
    assert plate_integral([wall], [0.05, 0.05])[0] == pytest.approx(expected, rel=1e-15)


def test_a_triangle_cut_along_the_borders_is_the_sum_of_its_parts():
    # x = 1, y from -2 to 2, cut by hand at the corners of the cells
    whole = [[1, -2, 1], [1, 2, 1], [1, 0, 2]]
    parts = [
        [[1, -2, 1], [1, -1, 1], [1, -1, 1.5]],
        [[1, 1, 1], [1, 2, 1], [1, 1, 1.5]],
        [[1, -1, 1], [1, 1, 1], [1, 1, 1.5]],
        [[1, -1, 1], [1, 1, 1.5], [1, -1, 1.5]],
        [[1, -1, 1.5], [1, 1, 1.5], [1, 0, 2]],
    ]
    assert plate_integral([whole], [1, 1])[0] == pytest.approx(1.519507398891136771947989, rel=1e-15)
    assert plate_integral(parts, [1, 1]).sum() == pytest.approx(1.519507398891136771947989, rel=1e-15)


@pytest.mark.parametrize("side", ["front", "both"])
def test_no_jump_where_a_triangle_passes_through_a_border_plane(side):
    shifts = np.concatenate([-(10.0 ** np.arange(-9, -16, -1.0)), [0.0], 10.0 ** np.arange(-15, -8, 1.0)])
    for triangle, half in itertools.islice(_in_borders(), 0, None, 5):
        axis = int(np.ptp(triangle[:, 1]) == 0.0)
        heights = np.abs(triangle[:, 2]).min()
        shifted = triangle + shifts[:, None, None] * np.eye(3)[axis]
        values = plate_integral(shifted, half, side=side)
        middle = values[len(shifts) // 2]
        # 1/dist changes by at most |shift|/dist^2; beside the plate a triangle in z = 0 is at least half a plate away
        nearest = min(heights, 0.25)
        assert (np.abs(values - middle) <= middle * (np.abs(shifts) / nearest * 4.0 + 1e-14)).all()


@pytest.mark.parametrize("both", [False, True])
def test_the_tree_counts_pieces_in_border_planes_once(both):
    T = transforms.identity()[None, None]
    for half in _HALVES:
        body = np.array([triangle for triangle, of in [*_in_borders(), *_in_plate_plane()] if of == half])
        expected = plate_integral(body, half, side="both" if both else "front")
        for rtol in (1e-2, 1e-6, 1e-12):
            tree = triangle_tree(body)
            value, _, bound = sum_tree(
                make_clusters(body, tree),
                T,
                np.zeros(len(T)),
                np.array([half]),
                both,
                False,
                rtol,
                np.zeros(COUNTS, np.int64),
            )
            assert value[0, 0] == pytest.approx(expected.sum(), rel=rtol)
            assert abs(value[0, 0] - expected.sum()) <= bound[0, 0] + 1e-13 * expected.sum()
        for triangle, value in zip(body, expected, strict=True):
            tree = triangle_tree(triangle[None])
            clusters = make_clusters(triangle[None], tree)
            for rtol in (1e-3, 1e-8):
                alone = sum_tree(
                    clusters, T, np.zeros(len(T)), np.array([half]), both, False, rtol, np.zeros(COUNTS, np.int64)
                )[0][0, 0]
                assert alone == pytest.approx(value, rel=rtol)
