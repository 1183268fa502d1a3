"""Mesh import: what files hold, what is repaired and noted, what is refused in one line."""

from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
import trimesh

from replay.errors import InvalidValue, MeshError
from replay.geometry import primitives
from replay.geometry.containment import contains
from replay.geometry.convex import convex_sets
from replay.geometry.mesh import load_mesh, solid_from_triangles
from replay.geometry.solid import Solid
from replay.numerics import transforms

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
    sheet = solid_from_triangles(cube.triangles[:2])
    assert not convex_sets(sheet).surface and "it has no inside, only a surface" in sheet.notes[0]

    point, line = np.ones((1, 3, 3)), np.array([[[0.0, 0, 0], [1, 1, 1], [3, 3, 3]]])
    padded = solid_from_triangles(np.concatenate([cube.triangles, point]))
    assert padded.dropped == 1 and padded.watertight and len(padded.triangles) == 12
    assert solid_from_triangles(np.concatenate([cube.triangles, line])).dropped == 1


BOX = primitives.cube(2.0).triangles


def boxes(*parts: tuple[float, float, int]) -> np.ndarray:
    """Boxes of half the size about (x, 0, 0), wound outwards (1) or inwards (-1)."""
    return np.concatenate([half * BOX[:, ::sense] + np.array([x, 0.0, 0.0]) for x, half, sense in parts])


@pytest.mark.parametrize(
    ("parts", "volume", "inside", "outside", "note"),
    [
        ([(0, 1, 1), (4, 1, -1)], 16, [0, 4], [2], "1 of 2 parts were inside out"),
        ([(0, 1, -1), (4, 0.5, 1)], 9, [0, 4], [2], "1 of 2 parts were inside out"),
        ([(0, 1, -1), (4, 1, -1), (8, 1, 1)], 24, [0, 4, 8], [2, 6], "2 of 3 parts were inside out"),
        ([(0, 1, 1), (1.5, 1, -1)], 16, [-0.5, 0.75, 2], [3], "1 of 2 parts were inside out"),  # overlap
        ([(0, 3, -1), (0, 2, 1)], 152, [2.5], [0, 1.5], "inside out (its volume"),  # a cavity
        ([(0, 3, 1), (0, 2, 1)], 280, [0, 2.5], [4], ""),  # solid in solid
        ([(0, 3, -1), (0, 2, 1), (0, 1, -1)], 160, [0, 2.5], [1.5], "inside out (its volume"),
        ([(0, 3, -1), (0, 2, 1), (9, 3, 1), (9, 2, -1)], 304, [2.5, 11.5], [0, 9], "1 of 2 parts were inside out"),
        ([(0, 1, 1), (2, 1, -1)], 16, [0, 2], [3.5], "1 of 2 parts were inside out"),  # they share a wall
    ],
)
def test_each_outermost_part_is_turned_by_itself(parts, volume, inside, outside, note) -> None:
    for turned in (False, True):
        mesh = boxes(*parts)
        solid = solid_from_triangles(mesh[::-1] if turned else mesh)
        assert solid.watertight and solid.volume == pytest.approx(volume)
        assert note in "".join(solid.notes) and bool(solid.notes) == bool(note)
        points = np.array([[x + 0.01, 0.02, 0.03] for x in [*inside, *outside]])
        assert contains(solid.triangles, points).tolist() == [True] * len(inside) + [False] * len(outside)


def test_bodies_that_touch_along_an_edge_or_a_corner_are_turned_each_by_itself() -> None:
    for way in ((2.0, 2.0, 0.0), (2.0, 2.0, 2.0)):
        solid = solid_from_triangles(np.concatenate([BOX, BOX[:, ::-1] + np.array(way)]))
        assert solid.watertight and solid.volume == pytest.approx(16.0)


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


def t_junctions(rng: np.random.Generator) -> np.ndarray:
    """A box whose faces are cut each for itself, so that hardly an edge of two faces is one."""
    parts = []
    for face in primitives.cube(1.0).triangles:
        for _ in range(3):
            a, b, c = np.roll(face, rng.integers(3), axis=0)
            middle = a + rng.uniform(0.2, 0.8) * (b - a)
            parts.append([a, middle, c])
            face = np.array([middle, b, c])
        parts.append(face)
    return np.array(parts)


def test_a_mesh_that_is_not_closed_has_an_inside_where_it_winds_about_it() -> None:
    cube, ball = primitives.cube(1.0).triangles, primitives.sphere(0.5, 1e-3).triangles
    turned = transforms.apply(transforms.from_rpy(np.array([0.3, 0.4, 0.5])), ball)
    shells = [body[(sign * body[..., 2]).min(axis=1) > -0.1] for sign, body in ((1, ball), (-1, turned))]
    fin = np.array([[[0.0, 0, 0.5], [0.3, 0, 0.5], [0.0, 0, 1.0]]])
    rng = np.random.default_rng(1)
    meshes = {
        "a triangle is missing": (cube[1:], 0.05, 0.15),
        "small holes": (np.delete(ball, rng.integers(len(ball), size=20), axis=0), 0.001, 0.5),
        "T-junctions": (t_junctions(rng), 0.0, 1e-9),
        "overlapping shells": (np.concatenate(shells), 0.0, 0.5),
        "a fin": (np.concatenate([cube, fin]), 0.45, 0.5),
        "inside out": (cube[1:, ::-1], 0.05, 0.15),
        "a triangle is wound the other way": (np.concatenate([cube[1:5], cube[5:6, ::-1], cube[6:]]), 0.05, 0.15),
    }
    points = rng.uniform(-0.7, 0.7, (1000, 3))
    for name, (mesh, least, most) in meshes.items():
        solid = solid_from_triangles(mesh)
        assert not solid.watertight and solid.has_inside, name
        note = solid.notes[-1]
        assert "inside is where the winding number is above 1/2; its largest defect" in note, name
        assert least <= float(note.rsplit(" ", 1)[1]) <= most, note
        winding = np.array([solid_angles(solid.triangles, point) for point in points])
        sure = np.abs(winding - 0.5) > 1e-9
        expected = winding > 0.5
        assert 0.1 < expected.mean() < 0.7
        np.testing.assert_array_equal(contains(solid.triangles, points)[sure], expected[sure], err_msg=name)
        moved = solid.transformed(transforms.from_rpy(np.array([0.3, -0.2, 1.0])))
        turned = transforms.apply(transforms.from_rpy(np.array([0.3, -0.2, 1.0])), points)
        found = contains(moved.triangles, turned, closing=moved.closing)
        np.testing.assert_array_equal(found[sure], expected[sure], err_msg=name)
        assert convex_sets(solid).surface


def solid_angles(triangles: np.ndarray, point: np.ndarray) -> float:
    """The winding number, by spherical triangles: the sum of the angles between great circles, less pi."""
    a, b, c = np.moveaxis((triangles - point) / np.linalg.norm(triangles - point, axis=2)[..., None], 1, 0)

    def angle(p: np.ndarray, q: np.ndarray, r: np.ndarray) -> np.ndarray:
        u, v = np.cross(p, q), np.cross(p, r)
        return np.arctan2(np.linalg.norm(np.cross(u, v), axis=1), np.sum(u * v, axis=1))

    area = angle(a, b, c) + angle(b, c, a) + angle(c, a, b) - np.pi
    return float(np.sum(np.sign(np.sum(a * np.cross(b, c), axis=1)) * area) / (4.0 * np.pi))


def test_a_sheet_has_no_inside() -> None:
    x, y = np.meshgrid(np.linspace(-1, 1, 9), np.linspace(-1, 1, 9))
    grid = np.stack([x, y, 0.2 * np.sin(3 * x)], axis=2)
    corners = [grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]]
    wavy = np.concatenate([np.stack(corners[:3], axis=2), np.stack([corners[k] for k in (0, 2, 3)], axis=2)])
    points = np.random.default_rng(1).uniform(-1.0, 1.0, (500, 3))
    for sheet in (primitives.cube(1.0).triangles[:1], primitives.cube(1.0).triangles[:2], wavy.reshape(-1, 3, 3)):
        solid = solid_from_triangles(sheet)
        assert not solid.has_inside and "it has no inside, only a surface" in solid.notes[-1]
        on_it = solid.triangles.mean(axis=1)
        assert not contains(solid.triangles, np.concatenate([points, on_it])).any()


def test_notes_say_what_keeps_a_mesh_from_being_closed() -> None:
    cube = primitives.cube(1.0).triangles
    fin = np.array([[[-0.5, -0.5, 0.5], [0.5, -0.5, 0.5], [0.0, -0.5, 1.0]]])
    wall = np.array([cube[0, 0], cube[0, 1], [0.3, 0.1, 0.2]])[None]
    assert (
        "2 edges are open, 1 edge belongs to more than two triangles, an odd number;"
        in (solid_from_triangles(np.concatenate([cube, fin])).notes[0])
    )
    assert "edges are open, 1 edge belongs to" in solid_from_triangles(np.concatenate([cube, wall])).notes[0]


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


ONE_CORNER_FAR_AWAY = b"""
v -3.15267548e+28 -1.64735003e+21 -8.87158197e+19
v -0.5 -0.5 -0.5
v -0.5 -0.5 0.5
v -0.5 0.5 9.77601875e+12
v -3.62209610e-18 5.08598007e-35 -1.17151140e+27
v 9.55788053e-21 -0.5 -0.5
v 0.5 0.5 0.5
f 3 1 2
f 5 3 2
f 2 1 4
f 4 5 2
f 3 3 1
f 6 3 5
f 6 3 3
f 1 3 4
f 7 5 4
f 4 3 7
f 7 6 5
f 3 6 7
"""


@pytest.mark.parametrize(
    "name, data, words",
    [
        ("body.step", b"", "not one of .stl"),
        ("body.stl", b"\0" * 84, "holds no triangles"),
        ("body.ply", b"ply\nformat ascii 1.0\nend_header\n", "not a usable PLY|holds no triangles"),
        ("body.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\n", "holds no triangles"),
        ("body.obj", b"v 0 0 0\nv 1 0 0\nv 0 nan 0\nf 1 2 3\n", "1 of 1 triangles have a corner that is not finite"),
        ("body.obj", b"v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n", "none of its 1 triangles has an area"),
        ("body.obj", ONE_CORNER_FAR_AWAY, "have no area that is not lost beside the largest of their coordinates"),
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


def test_what_is_closed_as_it_is_wound_stays() -> None:
    """Where four triangles meet at many edges, which are neighbours is a guess, and no reason to turn any."""
    unit = primitives.cube(1.0).triangles
    rng = np.random.default_rng(9)
    for _ in range(20):  # cubes of a grid, touching in corners, edges and walls
        cells = rng.permutation(np.array(list(np.ndindex(3, 3, 3))))[: rng.integers(4, 20)]
        whole = np.concatenate([unit + cell for cell in cells])
        for mesh in (whole, whole[rng.permutation(len(whole))]):
            solid = solid_from_triangles(mesh)
            assert solid.watertight and solid.notes == () and solid.volume == pytest.approx(len(cells))
            assert contains(solid.triangles, cells + 0.01).all()


def test_a_scale_along_each_axis_mirrors_where_it_is_negative(tmp_path):
    path = tmp_path / "tetrahedron.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n")
    for scale, turned in (((2.0, 3.0, 4.0), False), ((2.0, -3.0, 4.0), True), ((-2.0, -3.0, 4.0), False)):
        solid = load_mesh(path, scale=scale)
        assert solid.notes == ()  # nothing is inside out
        assert solid.volume == pytest.approx(4.0, rel=1e-15)
        first = solid.triangles[0].tolist()
        x, y, _ = scale
        b, c = [0.0, y, 0.0], [x, 0.0, 0.0]
        assert first == [[0.0, 0.0, 0.0], *((c, b) if turned else (b, c))]
    for scale in ((1.0, 0.0, 1.0), (1.0, 2.0), (1.0, float("nan"), 1.0), -1.0):
        with pytest.raises(InvalidValue, match="scale"):
            load_mesh(path, scale=scale)
