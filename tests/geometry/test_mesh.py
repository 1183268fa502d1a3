"""Mesh import: what files hold, what is repaired and noted, what is refused in one line."""

from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
import trimesh

from replay.errors import InvalidValue, MeshError
from replay.geometry import primitives
from replay.geometry.convex import convex_sets
from replay.geometry.mesh import load_mesh, solid_from_triangles
from replay.geometry.solid import Solid

PHANTOMS = Path(find_spec("pyskindose").submodule_search_locations[0]) / "phantom_data"


def exported(solid: Solid, ending: str) -> bytes:
    mesh = trimesh.Trimesh(**trimesh.triangles.to_kwargs(solid.triangles), process=False)
    data = mesh.export(file_type=ending)
    return data.encode() if isinstance(data, str) else data


def test_phantom() -> None:
    solid = load_mesh(PHANTOMS / "adult_male.stl", scale=0.01)
    assert solid.triangles.shape == (26_756, 3, 3) and solid.triangles.flags.c_contiguous
    height = np.ptp(solid.vertices, axis=0).max()
    assert 1.5 < height < 2.0
    mesh = trimesh.load_mesh(PHANTOMS / "adult_male.stl", process=False, merge_primitives=False)
    assert solid.volume == pytest.approx(abs(mesh.volume) * 1e-6, rel=1e-9)
    merged = trimesh.load_mesh(PHANTOMS / "adult_male.stl")
    assert solid.watertight == merged.is_watertight
    assert not solid.is_convex and solid.pieces == ()
    sets = convex_sets(solid)
    assert len(sets.first) == 26_757 and sets.surface == solid.watertight


@pytest.mark.parametrize("ending", ["stl", "obj", "ply", "glb", "STL"])
def test_formats_agree(ending: str, tmp_path: Path) -> None:
    solid = primitives.arc(0.8, 2.5, 0.25, 0.125, 0.01)
    path = tmp_path / f"arc.{ending}"
    path.write_bytes(exported(solid, ending.lower()))
    loaded = load_mesh(path, scale=2.0)
    assert loaded.watertight and loaded.notes == () and loaded.dropped == 0 and loaded.pieces == ()
    assert loaded.volume == pytest.approx(8.0 * solid.volume, rel=1e-5)
    again = load_mesh(f"elsewhere.{ending}", scale=2.0, data=path.read_bytes())
    np.testing.assert_array_equal(again.triangles, loaded.triangles)


@pytest.mark.parametrize(
    "solid",
    [primitives.sphere(0.2, 1e-3), primitives.cylinder(0.2, 1.5, 1e-3), primitives.cone(0.3, 0.1, 1e-3)],
    ids=["sphere", "cylinder", "cone"],
)
def test_convex_mesh_is_one_piece(solid: Solid) -> None:
    loaded = load_mesh("body.stl", scale=1.0, data=exported(solid, "stl"))
    assert loaded.is_convex and loaded.watertight
    np.testing.assert_allclose(np.sort(loaded.pieces[0], axis=0), np.sort(solid.pieces[0], axis=0), atol=1e-7)
    two = np.concatenate([solid.triangles, solid.triangles + np.array([5.0, 0, 0])])
    assert not solid_from_triangles(two).is_convex


def test_scene_is_flattened_in_place() -> None:
    box = trimesh.creation.box()
    scene = trimesh.Scene()
    scene.add_geometry(box)
    scene.add_geometry(box, transform=trimesh.transformations.translation_matrix([3.0, 0, 0]))
    solid = load_mesh("two.glb", scale=1.0, data=scene.export(file_type="glb"))
    assert len(solid.triangles) == 24 and solid.watertight and not solid.is_convex
    assert solid.volume == pytest.approx(2.0)
    assert solid.triangles[..., 0].max() == pytest.approx(3.5)


def test_repairs_are_noted() -> None:
    cube = primitives.cube(1.0)
    inside_out = solid_from_triangles(cube.triangles[:, ::-1])
    assert inside_out.volume == pytest.approx(1.0) and inside_out.is_convex
    assert "inside out" in inside_out.notes[0]

    hole = solid_from_triangles(cube.triangles[1:])
    assert not hole.watertight and "3 edges are open" in hole.notes[0] and hole.pieces == ()
    assert not convex_sets(hole).surface

    point, line = np.ones((1, 3, 3)), np.array([[[0.0, 0, 0], [1, 1, 1], [3, 3, 3]]])
    padded = solid_from_triangles(np.concatenate([cube.triangles, point]))
    assert padded.dropped == 1 and padded.watertight and len(padded.triangles) == 12
    assert solid_from_triangles(np.concatenate([cube.triangles, line])).dropped == 1


def test_repeated_triangles_count_once() -> None:
    # one repeat left a box without an inside, and each one was summed twice by plates
    cube = primitives.cube(1.0).triangles
    for more in (cube[3:4], cube[[0, 5, 5]], cube[:, [1, 2, 0]]):
        solid = solid_from_triangles(np.concatenate([cube, more]))
        np.testing.assert_array_equal(solid.triangles, cube)
        assert solid.watertight and solid.is_convex and solid.dropped == len(more)
        assert solid.notes == (f"{len(more)} of {12 + len(more)} triangles repeat another one and were dropped",)
    sheet = np.concatenate([cube[:2], cube[:2, ::-1]])  # the two sides of a sheet repeat nothing
    assert len(solid_from_triangles(sheet).triangles) == 4


def test_closed_bodies_that_share_a_face_keep_both() -> None:
    # one less, and three triangles met at each of its edges: the mesh had no inside
    low, high = primitives.cuboid((1.0, 1.0, 1.0)).triangles, primitives.cuboid((1.0, 1.0, 2.0)).triangles
    pair = solid_from_triangles(np.concatenate([low + np.array([0.0, 0.0, 0.5]), high + np.array([0.0, 0.0, 1.0])]))
    assert pair.watertight and len(pair.triangles) == 24 and pair.volume == pytest.approx(3.0)
    twice = solid_from_triangles(np.concatenate([low, low]))
    assert twice.watertight and len(twice.triangles) == 12


def test_winding_is_repaired() -> None:
    rng = np.random.default_rng(2)
    ring = primitives.arc(0.8, 2 * np.pi, 0.2, 0.1, 1e-3)
    cavity = primitives.sphere(1.0, 0.01).triangles[:, ::-1]
    ball = primitives.sphere(2.0, 0.01).triangles
    for whole in (ring.triangles, np.concatenate([ball, cavity])):
        mixed = whole.copy()
        turned = rng.uniform(size=len(mixed)) < 0.3
        mixed[turned] = mixed[turned, ::-1]
        solid = solid_from_triangles(mixed)
        assert solid.watertight and f"{turned.sum()} triangles were wound against" in solid.notes[0]
        assert solid.volume == pytest.approx(solid_from_triangles(whole).volume, rel=1e-12)


def test_one_sided_surface_is_not_watertight() -> None:
    """A projective plane of six corners: closed, but no winding fits."""
    faces = [
        (0, 1, 2),
        (0, 2, 3),
        (0, 3, 4),
        (0, 4, 5),
        (0, 5, 1),
        (1, 2, 4),
        (2, 3, 5),
        (3, 4, 1),
        (4, 5, 2),
        (5, 1, 3),
    ]
    corners = np.random.default_rng(1).normal(size=(6, 3))
    solid = solid_from_triangles(corners[np.array(faces)])
    assert not solid.watertight and "wound against each other" in solid.notes[0]


def test_flat_stitch_keeps_the_surface_closed() -> None:
    cube = primitives.cube(1.0).triangles
    a, b, c = cube[0]
    middle = 0.5 * (a + b)  # the neighbour keeps the whole edge a-b
    stitched = np.concatenate([cube[1:], [[a, middle, c], [middle, b, c], [a, b, middle]]])
    solid = solid_from_triangles(stitched)
    assert solid.dropped == 1 and solid.watertight and solid.volume == pytest.approx(1.0)


@pytest.mark.parametrize(
    "name, data, words",
    [
        ("body.step", b"", "not one of .stl"),
        ("body.stl", b"\0" * 84, "holds no triangles"),
        ("body.ply", b"ply\nformat ascii 1.0\nend_header\n", "not a usable PLY|holds no triangles"),
        ("body.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\n", "holds no triangles"),
        ("body.obj", b"v 0 0 0\nv 1 0 0\nv 0 nan 0\nf 1 2 3\n", "1 of 1 triangles have a corner that is not finite"),
        ("body.obj", b"v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n", "none of its 1 triangles has an area"),
    ],
)
def test_refused_in_one_line(name: str, data: bytes, words: str) -> None:
    with pytest.raises(MeshError, match=words) as caught:
        load_mesh(name, scale=1.0, data=data)
    assert "\n" not in str(caught.value) and str(caught.value).startswith(name)


def test_refuses_bad_paths_and_scales(tmp_path: Path) -> None:
    with pytest.raises(MeshError, match="No such file"):
        load_mesh(tmp_path / "none.stl", scale=1.0)
    for scale in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(InvalidValue):
            load_mesh("body.stl", scale=scale, data=exported(primitives.cube(1.0), "stl"))
    with pytest.raises(MeshError, match="times scale"):
        load_mesh("body.stl", scale=1e308, data=exported(primitives.cube(1e6), "stl"))


def test_random_damage_never_escapes() -> None:
    """Flipped bytes give a solid or a MeshError, nothing else."""
    rng = np.random.default_rng(5)
    for ending in ("stl", "ply", "glb", "obj"):
        whole = exported(primitives.cone(1.0, 1.0, 0.1), ending)
        for _ in range(60):
            data = bytearray(whole)
            for place in rng.integers(len(data), size=3):
                data[place] = rng.integers(256)
            try:
                load_mesh(f"body.{ending}", scale=1.0, data=bytes(data))
            except MeshError as error:
                assert "\n" not in str(error)
