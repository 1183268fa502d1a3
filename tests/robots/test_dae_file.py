"""COLLADA meshes: unit, axis that points up, nodes within nodes, and files that cannot be used."""

import numpy as np
import pytest

from replay.errors import RobotError
from replay.geometry.mesh_file import read_faces
from replay.robots import dae_file
from replay.robots.importing import Options, run
from tests.robots import made

SINGLE = 2.0**-23
"""Rounding of the matrices of nodes, which pycollada keeps in single precision."""

ASSET = '<asset><unit name="x" meter="{unit}"/><up_axis>{up}</up_axis></asset>'
GEOMETRY = """<library_geometries><geometry id="g"><mesh>
<source id="p"><float_array id="pa" count="12">0 0 0 1000 0 0 0 2000 0 0 0 3000</float_array>
<technique_common><accessor source="#pa" count="4" stride="3"><param name="X" type="float"/>
<param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
{faces}</mesh></geometry></library_geometries>"""
TRIANGLES = """<triangles count="4"><input semantic="VERTEX" source="#v" offset="0"/>
<p>0 2 1 0 1 3 0 3 2 1 2 3</p></triangles>"""
POLYGONS = """<polylist count="4"><input semantic="VERTEX" source="#v" offset="0"/><vcount>3 3 3 3</vcount>
<p>0 2 1 0 1 3 0 3 2 1 2 3</p></polylist>"""
PLACED = '<instance_geometry url="#g"/>'


def dae(unit=1, up="Z_UP", faces=TRIANGLES, node=PLACED, more=""):
    scene = f'<library_visual_scenes><visual_scene id="s"><node>{node}</node></visual_scene></library_visual_scenes>'
    head = '<?xml version="1.0"?><COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">'
    body = ASSET.format(unit=unit, up=up) + GEOMETRY.format(faces=faces) + more + scene
    return f'{head}{body}<scene><instance_visual_scene url="#s"/></scene></COLLADA>'.encode()


def read(tmp_path, **kinds):
    return dae_file.read(tmp_path / "x.dae", dae(**kinds))


@pytest.mark.parametrize("faces", [TRIANGLES, POLYGONS])
@pytest.mark.parametrize(("up", "far"), [("Z_UP", (1, 2, 3)), ("Y_UP", (1, -3, 2)), ("X_UP", (-2, -3, 1))])
def test_unit_and_the_axis_that_points_up_are_applied(up, far, faces, tmp_path):
    found = read(tmp_path, unit=0.001, up=up, faces=faces)
    assert (found.unit, found.up, found.triangles.shape) == (0.001, up, (4, 3, 3))
    ends = np.array([found.triangles.min(axis=(0, 1)), found.triangles.max(axis=(0, 1))])
    np.testing.assert_allclose(ends, np.sort([np.zeros(3), far], axis=0), rtol=1e-15, atol=1e-15)
    a, b, c = np.moveaxis(found.triangles, 1, 0)
    assert np.sum(a * np.cross(b, c)) / 6 == pytest.approx(1.0, rel=1e-12)  # still seen from outside


def test_colours_that_are_missing_take_no_body_away(tmp_path):
    """A picture that is not there breaks its effect, that the material, and that what is bound to it."""
    bound = '<instance_material symbol="m" target="#m"/>'
    placed = f'<instance_geometry url="#g"><bind_material><technique_common>{bound}</technique_common></bind_material>'
    found = read(tmp_path, node=f"{placed}</instance_geometry>")
    np.testing.assert_array_equal(found.triangles, read(tmp_path).triangles)


@pytest.mark.parametrize(
    ("node", "rule"),
    [
        (f'{PLACED}<instance_geometry url="#h"/>', "a node has the geometry 'h', which is not there"),
        (f'{PLACED}<instance_node url="#h"/>', "has no scene that can be used: .*h"),
        (f'{PLACED}<node><instance_node url="#h"/></node>', "has no scene that can be used: .*h"),
        (f'{PLACED}<instance_controller url="#h"/>', "a node has <instance_controller>, which is not read"),
        (f"<skew>45 1 0 0 0 1 0</skew>{PLACED}", "a node has <skew>, which is not read"),
    ],
)
def test_what_cannot_be_read_of_a_scene_is_refused_and_not_left_out(node, rule, tmp_path):
    with pytest.raises(RobotError, match=rule):
        read(tmp_path, node=node)


def test_nodes_place_what_they_hold(tmp_path):
    inner = f"<node><scale>2 1 1</scale>{PLACED}</node>"
    node = f"<translate>10 0 0</translate><rotate>0 0 1 90</rotate>{inner}<node><scale>-1 1 1</scale>{PLACED}</node>"
    found = read(tmp_path, node=node)
    first, second = found.triangles[:4], found.triangles[4:]
    np.testing.assert_allclose(first.max(axis=(0, 1)), [10, 2000, 3000], atol=SINGLE * 3000)
    np.testing.assert_allclose(first.min(axis=(0, 1)), [10 - 2000, 0, 0], atol=SINGLE * 3000)
    a, b, c = np.moveaxis(second, 1, 0)
    assert np.sum((a - second[0, 0]) * np.cross(b - second[0, 0], c - second[0, 0])) > 0  # mirrored, and turned over


@pytest.mark.parametrize(
    ("data", "rule"),
    [
        (b"<?xml version='1.0'?><!DOCTYPE COLLADA [<!ENTITY a 'b'>]><COLLADA/>", "has a DOCTYPE"),
        (b"<COLLADA/>", "has no scene"),
        (dae()[:-40], "is not XML"),
        (dae(faces=TRIANGLES.replace("1 2 3</p>", "1 2 9</p>")), "maxindex=9"),
        (dae(faces=""), "holds no triangles"),
        (dae(unit=0), "has a unit of 0 m"),
        (dae(node="<node>" * 45 + PLACED + "</node>" * 45), None),
        (dae(node="<node>" * 200 + PLACED + "</node>" * 200), "elements more than 100 deep"),
        (
            dae(
                node='<instance_node url="#n"/>',
                more='<library_nodes><node id="n"><instance_node url="#n"/></node></library_nodes>',
            ),
            "",
        ),
        (dae(node=PLACED * 21_000), "has a scene of more than"),
    ],
)
def test_files_that_cannot_be_used_are_refused(data, rule, tmp_path):
    if rule is None:
        assert len(dae_file.read(tmp_path / "x.dae", data).triangles) == 4
        return
    with pytest.raises(RobotError, match=r"x\.dae") as caught:
        dae_file.read(tmp_path / "x.dae", data)
    assert rule in str(caught.value) and "\n" not in str(caught.value)


BASE = dae()


@pytest.mark.parametrize(
    ("old", "new", "rule"),
    [
        *(
            (b"1000 0 0 0", word + b" 0 0 0", "has corners that are not finite")
            for word in (b"NaN", b"nan", b"-nan(ind)")
        ),
        (b"1000 0 0 0", b"1e39 0 0 0", "has corners that are not finite"),
        (b"1000 0 0 0", b"1,5 0 0 0", "Corrupted float array"),
        (b"0 2 1 0 1 3", b"0 2 1 0 x 3", "Corrupted index"),
        (b"0 2 1 0 1 3", b"0 4294967298 1 0 1 3", "a triangle refers to vertex 4294967298..., which cannot be"),
        (b"0 2 1 0 1 3", b"0 -2 1 0 1 3", "a triangle refers to vertex -2 of 4"),
        (b"0 3 2 1 2 3", b"0 3 2", "<triangles> has count='4', of which 3 are there"),
        (b'stride="3"', b'stride="4"', "its corners have stride='4' and offset='0'; 3 and 0 are read"),
        (b'stride="3"', b'stride="3" offset="3"', "offset='3'"),
        (b'meter="1"', b'meter="1 cm"', "its unit has meter='1 cm', which is no number"),
        (b"Z_UP", b"W_UP", "its <up_axis> is 'W_UP'; there are X_UP, Y_UP, Z_UP"),
    ],
)
def test_what_pycollada_would_read_as_something_else_is_refused(old, new, rule, tmp_path):
    assert BASE.count(old) == 1
    with pytest.raises(RobotError, match=r"x\.dae") as caught:
        dae_file.read(tmp_path / "x.dae", BASE.replace(old, new))
    assert rule in str(caught.value)


def test_polygons_that_are_not_all_there_and_holes_in_them_are_refused(tmp_path):
    whole = "<p>0 1 2 3</p>"
    polygons = '<polygons count="2"><input semantic="VERTEX" source="#v" offset="0"/>{}</polygons>'
    assert len(read(tmp_path, faces=polygons.format(whole)).triangles) == 2
    with pytest.raises(RobotError, match=r"a polygon has a hole \(<ph>\), which is not read"):
        read(tmp_path, faces=polygons.format(f"{whole}<ph>{whole}<h>0 1 2</h></ph>"))
    with pytest.raises(RobotError, match="<polylist> has count='4', of which 2 are there"):
        read(tmp_path, faces=POLYGONS.replace("3 3 3 3", "3 3"))
    for corners in ("3 3 3 999999999", "3 3 3 4", "3 3 3 2"):  # the first would take 20 GB
        total = sum(map(int, corners.split()))
        with pytest.raises(RobotError, match=f"of a <polylist> have {total} corners, of which 12 are there"):
            read(tmp_path, faces=POLYGONS.replace("3 3 3 3", corners))


def test_corners_that_are_no_numbers_and_that_no_triangle_has_do_no_harm(tmp_path):
    more = BASE.replace(b"0 0 3000<", b"0 0 3000 NaN nan 1<").replace(b'count="4" stride', b'count="5" stride')
    np.testing.assert_array_equal(dae_file.read(tmp_path / "x.dae", more).triangles, read(tmp_path).triangles)


def test_convex_meshes_are_meshes_and_hulls_of_others_are_refused(tmp_path):
    convex = BASE.replace(b"mesh>", b"convex_mesh>")
    np.testing.assert_array_equal(dae_file.read(tmp_path / "x.dae", convex).triangles, read(tmp_path).triangles)
    hull = b'<geometry id="h"><convex_mesh convex_hull_of="#g"/></geometry></library_geometries>'
    placed = b'<instance_geometry url="#g"/><instance_geometry url="#h"/>'
    more = BASE.replace(b"</library_geometries>", hull).replace(PLACED.encode(), placed)
    with pytest.raises(RobotError, match="the geometry 'h' is the hull of another, which is not read"):
        dae_file.read(tmp_path / "x.dae", more)


def test_blanks_around_the_axis_that_points_up_do_no_harm(tmp_path):
    assert dae_file.read(tmp_path / "x.dae", BASE.replace(b">Z_UP<", b">\n Z_UP <")).up == "Z_UP"


def test_an_import_writes_them_as_stl_beside_the_part(tmp_path):
    (tmp_path / "x.dae").write_bytes(dae(unit=0.001))
    (tmp_path / "r.urdf").write_text(made.robot(made.link("a", '<mesh filename="x.dae" scale="2 2 2"/>')))
    done = run(tmp_path / "r.urdf", tmp_path / "part.yaml", Options())
    assert done.meshes == (tmp_path / "part" / "x.stl",) and not done.lossy
    vertices, faces = read_faces(tmp_path / "part" / "x.stl")
    assert len(faces) == 4 and vertices.max(axis=0).tolist() == [1, 2, 3]
    assert "file: part/x.stl, scale: 2}" in done.file.read_text()
    assert "mesh x.dae: is written as STL, from units of 0.001 m to metres" in map(str, done.changes)


def test_the_axis_that_points_up_can_be_left_as_it_is(tmp_path):
    (tmp_path / "x.dae").write_bytes(dae(up="Y_UP"))
    (tmp_path / "r.urdf").write_text(made.robot(made.link("a", '<mesh filename="x.dae"/>')))
    for up_axis, most, rule in (
        ("apply", [1000, 0, 2000], "turned from"),
        ("ignore", [1000, 2000, 3000], "not turned"),
    ):
        done = run(tmp_path / "r.urdf", tmp_path / "part.yaml", Options(up_axis=up_axis))
        vertices, _ = read_faces(tmp_path / "part" / "x.stl")
        assert vertices.max(axis=0).tolist() == most
        assert rule in str(done.changes[0]) and "RViz" in str(done.changes[0])
