"""Triangles that a mesh holds more than once: in either sense, cut otherwise, parted by rounding."""

import numpy as np
import pytest

from replay.geometry import primitives
from replay.geometry.mesh import solid_from_triangles
from replay.numerics import transforms


def test_repeated_triangles_count_once() -> None:
    # one repeat left a box without an inside, and each one was summed twice by plates
    cube = primitives.cube(1.0).triangles
    for more in (cube[3:4], cube[[0, 5, 5]], cube[:, [1, 2, 0]]):
        solid = solid_from_triangles(np.concatenate([cube, more]))
        np.testing.assert_array_equal(solid.triangles, cube)
        assert solid.watertight and solid.is_convex and solid.dropped == len(more)
        assert solid.notes == (
            f"{len(more)} of {12 + len(more)} triangles repeat another one, in either sense, and were dropped",
        )


@pytest.mark.parametrize("copies", [1, 2, 3])
def test_copies_in_the_other_sense_count_once_too(copies: int) -> None:
    # a sheet or a box exported double-sided read exactly twice the capacitance, and the box lost its inside
    cube = primitives.cube(1.0).triangles
    for single in (cube[:2], cube[:7], cube, cube[[0, 3, 6, 9]]):
        for part in (slice(None), slice(0, 1), slice(1, None)):
            several = np.concatenate([single, *[single[part, :: (-1) ** (k + 1)] for k in range(copies)]])
            solid = solid_from_triangles(several)
            np.testing.assert_array_equal(solid.triangles, solid_from_triangles(single).triangles)
            assert "in either sense" in solid.notes[0]


def test_closed_bodies_that_share_a_face_keep_both() -> None:
    # one less, and three triangles met at each of its edges: the mesh had no inside
    low, high = primitives.cuboid((1.0, 1.0, 1.0)).triangles, primitives.cuboid((1.0, 1.0, 2.0)).triangles
    pair = solid_from_triangles(np.concatenate([low + np.array([0.0, 0.0, 0.5]), high + np.array([0.0, 0.0, 1.0])]))
    assert pair.watertight and len(pair.triangles) == 24 and pair.volume == pytest.approx(3.0)
    twice = solid_from_triangles(np.concatenate([low, low]))
    assert twice.watertight and len(twice.triangles) == 12
    beside = low + np.array([1.0, 0.0, 0.0])
    row = np.concatenate([low, beside, beside + np.array([1.0, 0.0, 0.0])])
    rng = np.random.default_rng(3)
    for bodies in (row, np.concatenate([row, row[:, ::-1]]), np.concatenate([row, row])):
        for order in (np.arange(len(bodies)), rng.permutation(len(bodies))):
            solid = solid_from_triangles(bodies[order])
            assert solid.watertight and len(solid.triangles) == 36 and solid.volume == pytest.approx(3.0)


def cut_otherwise(triangles: np.ndarray) -> np.ndarray:
    """Quads (two triangles each, the first corner of both and the last of the first on the diagonal) cut otherwise."""
    (a, b, c), (_, _, d) = np.moveaxis(triangles[0::2], 1, 0), np.moveaxis(triangles[1::2], 1, 0)
    return np.concatenate([np.stack([a, b, d], axis=1), np.stack([b, c, d], axis=1)])


def quads(corners: np.ndarray) -> np.ndarray:
    """A grid of corners (n, m, 3) as quads, two triangles each."""
    a, b, c, d = corners[:-1, :-1], corners[1:, :-1], corners[1:, 1:], corners[:-1, 1:]
    return np.stack([np.stack([a, b, c], axis=2), np.stack([a, c, d], axis=2)], axis=2).reshape(-1, 3, 3)


def turned_box() -> np.ndarray:
    """A box of quads, five by five on each side, in no special place."""
    sides = []
    for axis in range(3):
        for end in (0.0, 1.0):
            x, y = np.meshgrid(np.linspace(0, 1, 6), np.linspace(0, 1, 6))
            grid = np.roll(np.stack([x, y, np.full_like(x, end)], axis=2), axis, axis=2)
            sides.append(quads(grid.swapaxes(0, 1) if end else grid))
    T = transforms.from_rpy(np.array([0.3, -0.8, 0.4]))
    T[:3, 3] = 2.0, -3.0, 1.0
    return transforms.apply(T, np.concatenate(sides) * np.array([1.0, 0.7, 0.4]))


@pytest.mark.parametrize("single", [False, True], ids=["as they are", "in single precision"])
@pytest.mark.parametrize("sense", [1, -1])
def test_a_flat_piece_cut_by_other_diagonals_is_the_same(single, sense) -> None:
    whole = turned_box()
    whole = whole.astype(np.float32).astype(np.float64) if single else whole
    for part in (whole, whole[:50], whole[:2]):
        for order in (slice(None), np.random.default_rng(4).permutation(2 * len(part))):
            solid = solid_from_triangles(np.concatenate([part, cut_otherwise(part)[:, ::sense]])[order])
            once = solid_from_triangles(part)
            assert solid.watertight == once.watertight and len(solid.triangles) == len(part)
            assert solid.volume == pytest.approx(once.volume, rel=1e-6, abs=1e-7)
            assert f"{len(part)} of {2 * len(part)} triangles repeat another one" in solid.notes[0]


def test_any_cut_of_a_flat_piece_is_the_same() -> None:
    turn = np.linspace(0.0, 2.0 * np.pi, 9)[:-1]
    rim = np.stack([np.cos(turn), 0.5 * np.sin(turn), np.ones(8)], axis=1)
    fans = [[rim[k], rim[(k + j) % 8], rim[(k + j + 1) % 8]] for k in (0, 3) for j in range(1, 7)]
    middle = [[rim[k], rim[(k + 1) % 8], [0.1, 0.0, 1.0]] for k in range(8)]
    for several in (fans, fans[:6] + middle, middle + fans[:6]):
        solid = solid_from_triangles(np.array(several))
        assert len(solid.triangles) == 6
    bodies = [np.array(fans[:6]), np.array(fans[6:])[:, ::-1]]  # with walls down to two tips, they share the piece
    for tip, fan in zip(([0.0, 0, 3], [0.0, 0, -3]), bodies[:2], strict=True):
        sense = 1 if tip[2] > 0 else -1
        walls = [[rim[k], rim[(k + 1) % 8], tip][::sense] for k in range(8)]
        bodies.append(np.concatenate([fan[:, ::-1], walls]))
    both = solid_from_triangles(np.concatenate(bodies[2:]))
    assert both.watertight and len(both.triangles) == 28
    assert both.volume == pytest.approx(sum(solid_from_triangles(body).volume for body in bodies[2:]))


def test_quads_that_are_not_flat_are_two_surfaces() -> None:
    """Both cuts of a bent quad close a body."""
    for height in (1e-3, 0.1):
        corners = np.array([[[0.0, 0, 0], [0, 1, height]], [[1, 0, height], [1, 1, 0]]])
        part = quads(corners)
        solid = solid_from_triangles(np.concatenate([part, cut_otherwise(part)[:, ::-1]]))
        assert solid.watertight and len(solid.triangles) == 4 and solid.volume == pytest.approx(height / 3.0)
    small = 1e-9 * primitives.cube(1.0).triangles + np.array([1.0, 0.0, 0.0])  # a crumb is no rounding
    solid = solid_from_triangles(np.concatenate([small, primitives.cube(0.1).triangles]))
    assert solid.watertight and len(solid.triangles) == 24


@pytest.mark.parametrize("sense", [1, -1])
@pytest.mark.compiled
def test_copies_that_rounding_has_parted_are_seen(sense) -> None:
    # two closed copies had no open edge that welding could close, and their capacitance was twice what it is
    rng = np.random.default_rng(5)
    ball = primitives.sphere(0.5, 1e-3).triangles + 0.25
    sheet = quads(np.stack(np.meshgrid(np.linspace(0, 1, 6), np.linspace(0, 1, 5), 0.0), axis=-1)[:, :, 0])
    for part, other in ((ball, ball), (sheet, sheet), (turned_box(), cut_otherwise(turned_box()))):
        points = np.unique(other.reshape(-1, 3), axis=0, return_inverse=True)
        moved = points[0] + rng.choice([0.0, 1e-16, -1e-15], points[0].shape)
        parted = moved[points[1].ravel()].reshape(-1, 3, 3)[:, ::sense]
        solid = solid_from_triangles(np.concatenate([part, parted]))
        once = solid_from_triangles(part)
        assert len(solid.triangles) == len(once.triangles) and solid.watertight == once.watertight
        told = " ".join(solid.notes)
        assert "taken for it" in told and "triangles repeat another one" in told
    apart = solid_from_triangles(np.concatenate([ball, ball + 1e-9]))  # a thin wall stays
    assert len(apart.triangles) == 2 * len(ball)


@pytest.mark.parametrize(("apart", "sheets"), [(0.9e-9, 1), (1.1e-9, 2)])
def test_copies_are_one_up_to_a_billionth_of_the_extent(apart, sheets) -> None:
    box = primitives.cube(1.0).triangles  # without its lid, and with a floor that is there twice
    solid = solid_from_triangles(np.concatenate([box[:2], box[4:], box[:2] - [0.0, 0.0, apart]]))
    assert len(solid.triangles) == 8 + 2 * sheets


def test_a_copy_parted_by_a_few_products_leaves_a_body_closed() -> None:
    # a robot's body was "open": two corners of a quad that was there twice were 8e-12 of its extent apart
    cube = primitives.cube(1.0).triangles
    points, faces = np.unique(cube.reshape(-1, 3), axis=0, return_inverse=True)
    faces = faces.reshape(-1, 3)
    for side in (faces[:2], faces[4:6], faces[:4]):
        named = np.unique(side)
        for moved in (named[:2], named[-2:], named[:1]):
            corners = points.copy()
            corners[moved] += 8e-12
            solid = solid_from_triangles(np.concatenate([cube, corners[side]]))
            assert solid.watertight and len(solid.triangles) == 12 and solid.volume == pytest.approx(1.0)
            assert "triangles repeat another one" in " ".join(solid.notes)
