"""Mesh files: what is whole is read wholly, and what is not is refused in one clear line, never read in part."""

import json
import re
import struct

import numpy as np
import pytest
import trimesh

from replay.errors import MeshError
from replay.geometry.mesh_file import FORMATS, read_faces

BOX = trimesh.creation.box()
CORNERS = b"v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\n"
QUADS = (
    b"element vertex 4\nproperty float x\nproperty float y\nproperty float z\nelement face FACES\n"
    b"property list uchar int vertex_indices\nend_header\n"
)


def exported(kind, **options):
    data = BOX.export(file_type=kind, **options)
    return data.encode() if isinstance(data, str) else data


WHOLE = {
    "text.stl": exported("stl_ascii"),
    "binary.stl": exported("stl"),
    "called solid.stl": b"solid" + exported("stl")[5:],
    "text.ply": exported("ply", encoding="ascii"),
    "binary.ply": exported("ply"),
    "box.obj": exported("obj"),
    "box.glb": exported("glb"),
}


def glb(change):
    """The box's GLB file with its description changed."""
    size = int.from_bytes(WHOLE["box.glb"][12:16], "little")
    scene, rest = json.loads(WHOLE["box.glb"][20 : 20 + size]), WHOLE["box.glb"][20 + size :]
    change(scene)
    text = json.dumps(scene).encode()
    text += b" " * (-len(text) % 4)
    return b"glTF" + struct.pack("<4I", 2, 20 + len(text) + len(rest), len(text), 0x4E4F534A) + text + rest


def refused(name, data):
    with pytest.raises(MeshError) as caught:
        read_faces(name, data)
    assert "\n" not in str(caught.value) and len(str(caught.value)) < 400
    return str(caught.value)


@pytest.mark.parametrize("name", WHOLE)
def test_whole_files_are_read_wholly(name):
    vertices, faces = read_faces(name, WHOLE[name])
    assert trimesh.Trimesh(vertices, faces).volume == pytest.approx(1.0)
    assert len(faces) == 12


@pytest.mark.parametrize("name", WHOLE)
def test_cut_files_are_refused_or_keep_their_triangles(name):
    data = WHOLE[name]
    for length in range(0, len(data), 7):
        try:
            _, faces = read_faces(name, data[:length])
        except MeshError as error:
            assert str(error).startswith(f"{name}: ") and "\n" not in str(error)
        else:  # text can lose an end that says nothing; only OBJ does not say how much there is
            assert len(faces) == 12 or name == "box.obj"


@pytest.mark.parametrize(
    ("name", "data", "words"),
    [
        *[(f"empty{ending}", b"", "is empty") for ending in FORMATS],
        ("words.ply", b"hello\nworld\n", "does not begin with a header"),
        ("words.glb", b"hello\nworld\n" * 9, "does not begin as one"),
        ("words.stl", b"hello\nworld\n" * 9, "its header announces .* triangles"),
        ("short.stl", b"hello", "its header is cut; the file has 5 bytes"),
        ("cut.stl", exported("stl")[:-7], "announces 12 triangles, which need 684 bytes; the file has 677"),
        ("long.stl", exported("stl") + b"more", "need 684 bytes; the file has 688"),
        (
            "cut text.stl",
            exported("stl_ascii")[:-40],
            "cut or damaged: it has 11 endfacet, 12 facet, 1 solid, 36 vertex",
        ),
        ("two.stl", 2 * exported("stl_ascii")[:-40], "cut or damaged"),
        ("huge.ply", WHOLE["binary.ply"].replace(b"vertex 8", b"vertex 4000000000"), "vertex 4000000000, face 12: 48"),
        ("huge text.ply", WHOLE["text.ply"].replace(b"face 12", b"face 4000000000"), "one a line; 20 lines follow"),
        ("cut text.ply", WHOLE["text.ply"][:-3], "announces 12 faces, of which only 11|usable PLY"),
        (
            "odd.ply",
            WHOLE["text.ply"].replace(b"property float x", b"property floaty x"),
            "the line 'property floaty x'",
        ),
        ("no number.obj", CORNERS + b"v 1 1 z\nf 1 2 3\n", "line 6, 'v 1 1 z', does not name three numbers"),
        ("two numbers.obj", CORNERS + b"v 1 1\nf 1 2 3\n", "line 6, 'v 1 1', does not name three numbers"),
        ("two corners.obj", CORNERS + b"f 1 2\nf 1 2 3\n", "line 6, 'f 1 2', does not name three or more vertices"),
        ("zero.obj", CORNERS + b"f 0 1 2\n", "does not name three or more vertices, counted from 1"),
        ("before.obj", CORNERS + b"f -6 1 2\n", "does not name three or more vertices"),
        ("beyond.obj", CORNERS + b"f 1 2 9\n", "refers to vertex 9, and there are 5"),
        ("endless.obj", CORNERS + b"f 1 2 99999999999999999999\n", "does not name three or more vertices"),
    ],
)
def test_the_cause_is_named(name, data, words):

    assert re.search(words, refused(name, data))


def set_in(*path, value):
    def change(scene):
        for step in path[:-1]:
            scene = scene[step]
        scene[path[-1]] = value

    return change


def no_data(scene):
    for accessor in scene["accessors"]:
        del accessor["bufferView"]
        accessor["count"] = 2_000_000_000


def doubled(scene):
    """25 nodes of two children each that are the same: 2^25 bodies."""
    for k in range(25):
        scene["nodes"].append({"children": [k, k]})
    scene["scenes"][0]["nodes"] = [25]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (set_in("accessors", 0, "count", value=4_000_000_000), "accessor 0 announces 4000000000 entries, more than"),
        (no_data, "accessor 0 announces 2000000000 entries, more than"),
        (set_in("accessors", 1, "sparse", value={}), "sparse or compressed"),
        (set_in("bufferViews", 1, "byteLength", value=1 << 40), "buffer view 1 is beyond the 240 bytes"),
        (set_in("buffers", 0, "uri", value="box.bin"), "in another file, 'box.bin'; save it as one GLB file"),
        (set_in("extensionsRequired", value=["KHR_draco_mesh_compression"]), "needs the extension KHR_draco"),
        (set_in("meshes", 0, "primitives", 0, "mode", value=6), "triangle fans"),
        (set_in("meshes", 0, "primitives", 0, "attributes", value={"POSITION": 77}), "is not glTF 2"),
        (set_in("nodes", value=3), "is not glTF 2"),
        (set_in("nodes", 0, "children", value=[0]), "a node is within itself"),
        (set_in("nodes", 0, "scale", value=[1, float("nan"), 1]), "node 0 has a transform that is not finite"),
        (doubled, "has two parents"),
    ],
)
def test_glb_that_would_be_read_in_part_or_fill_the_memory_is_refused(change, words):
    assert words in refused("box.glb", glb(change))


def test_obj_counts_back_from_where_a_face_stands_and_splits_polygons():
    data = b"# caf\xe9\r\n" + CORNERS + b"o a\nf -5/1/1 -4//2 \\\n 3 4\nv 9 9 9\nf -1 -2 1 # last\n"
    vertices, faces = read_faces("a.obj", data)
    np.testing.assert_array_equal(faces, [[0, 1, 2], [0, 2, 3], [5, 4, 0]])
    np.testing.assert_array_equal(vertices[[4, 5]], [[0, 0, 1], [9, 9, 9]])


U = ["0 0", "3 0", "3 2", "2 2", "2 1", "1 1", "1 2", "0 2"]


def test_obj_polygons_are_convex_or_refused():
    """A profile like the letter U, split from its first corner, would be filled."""
    corners = "".join(f"v {corner} 0\n" for corner in U).encode()
    assert "line 9 is not convex" in refused("u.obj", corners + b"f 1 2 3 4 5 6 7 8\n")
    quads = corners + b"f 1 6 7 8\nf 1 2 5 6\nf 2 3 4 5\n"
    assert trimesh.Trimesh(*read_faces("u.obj", quads)).area == pytest.approx(5.0)
    straight = corners + b"v 1.5 0 0\nf 1 9 2 5 6\n"  # a corner on an edge
    assert trimesh.Trimesh(*read_faces("u.obj", straight)).area == pytest.approx(2.0)


@pytest.mark.parametrize("names", [b"vertex_indices", b"vertex_index"])
def test_ply_polygons_are_convex_or_refused(names):
    """A quad with a notch and the letter U; convex faces around them are no reason."""
    points = [[0, 0, 0], [2, 0, 0], [2, 2, 0], [1, 0.5, 0], [0, 2, 0]]
    rows = "".join(f"{x} {y} {z}\n" for x, y, z in points).encode()
    head = b"ply\nformat ascii 1.0\n" + QUADS.replace(b"vertex 4", b"vertex 5").replace(b"vertex_indices", names)
    text = head.replace(b"FACES", b"2") + rows
    assert "face 2 is not convex" in refused("a.ply", text + b"3 0 1 4\n5 0 1 2 3 4\n")
    assert "face 1 is not convex" in refused("a.ply", text + b"4 1 2 3 4\n3 0 1 4\n")
    assert len(read_faces("a.ply", text + b"4 3 0 1 2\n3 0 3 4\n")[1]) == 3  # the notch is the first corner
    assert "face 2 has fewer than three corners" in refused("a.ply", text + b"4 0 1 2 4\n2 0 1\n")
    for wrong in (b"9", b"-9"):  # an index that is none is for the mesh to refuse
        assert int(wrong) in read_faces("a.ply", text + b"4 0 1 2 " + wrong + b"\n3 0 1 4\n")[1]
    binary = head.replace(b"FACES", b"1").replace(b"ascii", b"binary_little_endian")
    coordinates = np.array(points, np.float32).tobytes()
    assert "face 1 is not convex" in refused("a.ply", binary + coordinates + struct.pack("<B4i", 4, 1, 2, 3, 4))
    assert len(read_faces("a.ply", binary + coordinates + struct.pack("<B4i", 4, 0, 1, 2, 4))[1]) == 2


def test_ply_of_quads_is_read_and_mixed_polygons_only_as_text():
    corners = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], np.float32)
    quad, triangle = struct.pack("<B4i", 4, 0, 1, 2, 3), struct.pack("<B3i", 3, 0, 1, 2)
    head = b"ply\nformat binary_little_endian 1.0\n" + QUADS
    assert len(read_faces("a.ply", head.replace(b"FACES", b"1") + corners.tobytes() + quad)[1]) == 2
    mixed = head.replace(b"FACES", b"2") + corners.tobytes() + quad + triangle
    assert "differ in their number of corners" in refused("a.ply", mixed)
    text = (
        b"ply\nformat ascii 1.0\n" + QUADS.replace(b"FACES", b"2") + b"0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n3 0 1 2\n"
    )
    assert len(read_faces("a.ply", text)[1]) == 3


def test_a_scene_of_several_parts_is_put_together():
    scene = trimesh.Scene()
    for x in (0.0, 3.0):
        scene.add_geometry(BOX, transform=trimesh.transformations.translation_matrix([x, 0, 0]))
    vertices, faces = read_faces("two.glb", scene.export(file_type="glb"))
    assert len(faces) == 24 and np.ptp(vertices[:, 0]) == pytest.approx(4.0)
