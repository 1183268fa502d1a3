"""Mesh files: what is whole is read wholly, and what is not is refused in one clear line, never read in part."""

import json
import os
import re
import struct

import numpy as np
import pytest
import trimesh

from replay.errors import MeshError
from replay.geometry import glb_file
from replay.geometry.mesh_file import FORMATS, read_faces
from tests.amounts import cases

BOX = trimesh.creation.box()
CODES = {"i1": 5120, "u1": 5121, "<i2": 5122, "<u2": 5123}
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
    "padded to blocks.stl": exported("stl").ljust(1024, b"\0"),
    "with a line after it.stl": exported("stl") + b"COLOR=red",
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
        ("long.stl", exported("stl") + exported("stl")[-50:], "need 684 bytes; the file has 734"),
        ("none.stl", bytes(684), "announces 0 triangles, which need 84 bytes"),
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
        (set_in("scenes", 0, "nodes", value=[99]), "a scene begins with a node that is not there"),
        (set_in("scene", value=9), "its scene is not there"),
    ],
)
def test_glb_that_would_be_read_in_part_or_fill_the_memory_is_refused(change, words):
    assert words in refused("box.glb", glb(change))


@pytest.mark.parametrize("kind", ["i1", "u1", "<i2", "<u2"])
@pytest.mark.parametrize("shares", [False, True])
def test_corners_in_whole_numbers_are_where_their_node_puts_them(kind, shares):
    """As gltfpack writes them: rows of four bytes' multiples, and a node that gives them their size."""
    largest = np.iinfo(kind).max
    points = np.random.default_rng(3).integers(np.iinfo(kind).min, largest, (3, 3), endpoint=True)
    points[0] = np.iinfo(kind).min
    rows = np.zeros((3, 4), kind)
    rows[:, :3] = points

    def change(scene):
        view = scene["bufferViews"][scene["accessors"][1]["bufferView"]]
        view |= {"byteLength": rows.nbytes, "byteStride": rows.strides[0]}
        scene["accessors"][1] = {"bufferView": scene["accessors"][1]["bufferView"], "componentType": CODES[kind]}
        scene["accessors"][1] |= {"type": "VEC3", "count": 3, "normalized": shares}
        part = scene["meshes"][0]["primitives"][0]
        part["attributes"] = {"POSITION": 1}
        del part["indices"]
        scene["nodes"].append({"mesh": 0, "scale": [2.0, 2.0, 2.0], "translation": [1.0, 0.0, -1.0]})
        scene["scenes"][0]["nodes"] = [len(scene["nodes"]) - 1]
        scene["extensionsRequired"] = scene["extensionsUsed"] = ["KHR_mesh_quantization"]

    data = bytearray(glb(change))
    size = int.from_bytes(data[12:16], "little")
    view = json.loads(data[20 : 20 + size])["bufferViews"][1]
    begin = 20 + size + 8 + view.get("byteOffset", 0)
    data[begin : begin + rows.nbytes] = rows.tobytes()
    vertices, faces = read_faces("packed.glb", bytes(data))
    shown = np.maximum(points / largest, -1.0) if shares else points
    np.testing.assert_allclose(vertices[faces[0]], 2.0 * shown + [1.0, 0.0, -1.0], rtol=1e-6, atol=1e-6)
    assert len(faces) == 1


def test_obj_counts_back_from_where_a_face_stands_and_splits_polygons():
    data = b"# caf\xe9\r\n" + CORNERS + b"o a\nf -5/1/1 -4//2 \\\n 3 4\nv 9 9 9\nf -1 -2 1 # last\n"
    vertices, faces = read_faces("a.obj", data)
    np.testing.assert_array_equal(faces, [[0, 1, 2], [0, 2, 3], [5, 4, 0]])
    np.testing.assert_array_equal(vertices[[4, 5]], [[0, 0, 1], [9, 9, 9]])


U = ["0 0", "3 0", "3 2", "2 2", "2 1", "1 1", "1 2", "0 2"]


def covered(vertices, faces):
    """The area (3,) with its direction, and the area without: a fold would make the second one larger."""
    a, b, c = np.moveaxis(vertices[faces], 1, 0)
    normals = 0.5 * np.cross(b - a, c - a)
    return normals.sum(axis=0), np.linalg.norm(normals, axis=1).sum()


def star(points, rng):
    """A polygon seen wholly from its middle, in any plane, some corners of which are notches."""
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    angle = 2 * np.pi * (np.arange(points) + rng.uniform(0.0, 0.9, points)) / points
    flat = rng.uniform(0.2, 1.0, points)[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    return flat @ turn[:2] * 10.0 ** rng.uniform(-6, 6)


def test_polygons_that_are_not_convex_are_split_rightly():
    """A profile like the letter U, split from its first corner, would be filled; so would stars, in any plane."""
    corners = "".join(f"v {corner} 0\n" for corner in U).encode()
    for start in range(8):
        order = b" ".join(str((start + k) % 8 + 1).encode() for k in range(8))
        normal, area = covered(*read_faces("u.obj", corners + b"f " + order + b"\n"))
        assert normal.tolist() == pytest.approx([0, 0, 5.0]) and area == pytest.approx(5.0)
        normal, area = covered(*read_faces("u.obj", corners + b"f " + order[::-1] + b"\n"))
        assert normal.tolist() == pytest.approx([0, 0, -5.0]) and area == pytest.approx(5.0)
    straight = corners + b"v 1.5 0 0\nf 1 9 2 5 6\n"  # a corner on an edge
    assert trimesh.Trimesh(*read_faces("u.obj", straight)).area == pytest.approx(2.0)
    rng = np.random.default_rng(6)
    notched = 0
    for _ in range(cases(300)):
        count = int(rng.integers(4, 40))
        points = star(count, rng)
        rows = "".join("v {:.17g} {:.17g} {:.17g}\n".format(*point) for point in points)
        vertices, faces = read_faces("star.obj", f"{rows}f {' '.join(str(k + 1) for k in range(count))}\n".encode())
        middle = points.mean(axis=0)
        whole = 0.5 * np.sum(np.cross(points - middle, np.roll(points, -1, axis=0) - middle), axis=0)
        normal, area = covered(vertices, faces)
        fan = covered(points, np.array([[0, k, k + 1] for k in range(1, count - 1)]))[1]
        size = np.linalg.norm(whole)
        np.testing.assert_allclose(normal, whole, atol=1e-9 * size)
        assert area == pytest.approx(size, rel=1e-9) and len(faces) == count - 2
        notched += fan > 1.001 * size
    assert notched > cases(100)


def test_polygons_that_are_there_twice_are_split_alike():
    """Each from its own first corner, the two sides of a quad would be four triangles that differ."""
    own = CORNERS + CORNERS + b"v 0.5 1.2 0\n"  # a second set of the same corners
    for face in ("4 3 2 1", "1 2 3 4", "3 4 1 2", "2 1 4 3", "9 8 7 6", "8 9 6 7"):
        vertices, faces = read_faces("a.obj", own + b"f 1 2 3 4\nf 1 2 5\nf " + face.encode() + b"\n")
        corners = {frozenset(map(tuple, triangle)) for triangle in vertices[faces].tolist()}
        assert len(faces) == 5 and len(corners) == 3
        normals = np.cross(vertices[faces][:, 1] - vertices[faces][:, 0], vertices[faces][:, 2] - vertices[faces][:, 0])
        forward = face in ("1 2 3 4", "3 4 1 2", "8 9 6 7")
        assert (normals[[0, 1], 2] > 0).all() and (normals[[3, 4], 2] > 0).all() == forward
    crossed = read_faces("a.obj", own + b"f 1 2 3 4\nf 1 3 2 4\n")[1]  # the same corners, another polygon
    assert len(crossed) == 4
    u = "".join(f"v {corner} 0\n" for corner in U).encode() + b"f 1 2 3 4 5 6 7 8\nf 4 3 2 1 8 7 6 5\n"
    vertices, faces = read_faces("u.obj", u)
    assert len({frozenset(face) for face in faces.tolist()}) == 6 and len(faces) == 12


DART = [[0, 0, 0], [2, 0, 0], [2, 2, 0], [1, 0.5, 0], [0, 2, 0]]


def ply(kind, faces, element="face", names="vertex_indices", points=DART, numbers="float", after=""):
    """A PLY file of text, little or big endian, whose faces may be of any length."""
    order = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}[kind]
    head = f"ply\nformat {kind} 1.0\ncomment made for a test\nelement vertex {len(points)}\n"
    head += "".join(f"property {numbers} {axis}\n" for axis in "xyz") + "property uchar red\n"
    head += f"element {element} {len(faces)}\nproperty list uchar int {names}\n{after}end_header\n"
    if not order:
        rows = [*(f"{x!r} {y!r} {z!r} 7" for x, y, z in points), *(f"{len(f)} {' '.join(map(str, f))}" for f in faces)]
        rows = [*rows[: len(points)], *(row + " 9" * bool(after) for row in rows[len(points) :])]
        return head.encode() + "\n".join(rows).encode() + b"\n"
    body = b"".join(struct.pack(order + ("3fB" if numbers == "float" else "3dB"), *point, 7) for point in points)
    for face in faces:
        body += struct.pack(f"{order}B{len(face)}i", len(face), *face) + (b"\x09" if after else b"")
    return head.encode() + body


@pytest.mark.parametrize("kind", ["ascii", "binary_little_endian", "binary_big_endian"])
@pytest.mark.parametrize("after", ["", "property uchar flags\n"])
@pytest.mark.parametrize(("names", "numbers"), [("vertex_indices", "float"), ("vertex_index", "double")])
def test_ply_of_any_polygons_is_read_as_its_header_says(kind, after, names, numbers):
    several = {"names": names, "after": after, "numbers": numbers}
    quads = read_faces("a.ply", ply(kind, [[0, 1, 2, 4], [4, 0, 1, 2]], **several))[1]
    assert quads.tolist() == [[0, 1, 2], [0, 2, 4]] * 2  # the same one, split alike
    vertices, faces = read_faces("a.ply", ply(kind, [[0, 1, 4], [0, 1, 2, 3, 4], [1, 2, 3, 4]], **several))
    np.testing.assert_array_equal(vertices, DART)
    assert faces.tolist()[0] == [0, 1, 4] and len(faces) == 6
    for one, area in (([0, 1, 2, 3, 4], 2.5), ([4, 3, 2, 1, 0], 2.5), ([3, 4, 0, 1, 2], 2.5)):
        normal, whole = covered(*read_faces("a.ply", ply(kind, [one], **several)))
        assert abs(normal[2]) == pytest.approx(area) and whole >= area
    assert "face 2 has fewer than three corners" in refused("a.ply", ply(kind, [[0, 1, 2, 4], [0, 1]], **several))
    for wrong in (9, -9):  # an index that is none is for the mesh to refuse
        assert wrong in read_faces("a.ply", ply(kind, [[0, 1, 2, wrong], [0, 1, 4]], **several))[1]
    whole = ply(kind, [[0, 1, 4], [0, 1, 2, 3]], **several)
    for cut in range(1, 30) if kind != "ascii" else (2, 5, 8):
        assert "announces" in refused("a.ply", whole[:-cut])


@pytest.mark.parametrize("kind", ["ascii", "binary_little_endian", "binary_big_endian"])
def test_strips_of_triangles_turn_every_second_one(kind):
    data = ply(kind, [[0, 1, 2, 4, 3, -1, 4, 3, 2], [0, 1, 1, 2, 4]], element="tristrips")
    expected = [[0, 1, 2], [2, 1, 4], [2, 4, 3], [4, 3, 2], [1, 2, 4]]
    assert read_faces("a.ply", data)[1].tolist() == expected


def test_pictures_are_never_loaded():
    """A GLB of 310 kB unfolded to 7 GiB, and a PLY that names a picture ended in a traceback."""
    texture = ply("ascii", [[0, 1, 2]]).replace(b"made for a test", b"TextureFile skin.png")
    assert len(read_faces("a.ply", texture)[1]) == 1
    assert len(read_faces("a.obj", b"mtllib none.mtl\nusemtl skin\n" + CORNERS + b"f 1 2 3\n")[1]) == 1

    def with_picture(scene):
        scene["images"] = [{"bufferView": 0, "mimeType": "image/png"}, {"uri": "missing.png"}]
        scene["textures"] = [{"source": 0}, {"source": 1}]
        scene["materials"] = [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 1}}}]
        scene["meshes"][0]["primitives"][0]["material"] = 0

    data = glb(with_picture)
    assert b"images" in data and not any(word in glb_file.bare(data) for word in (b"images", b"material", b"texture"))
    np.testing.assert_array_equal(read_faces("a.glb", data)[1], read_faces("box.glb", WHOLE["box.glb"])[1])


@pytest.mark.parametrize("ending", FORMATS)
def test_what_is_no_mesh_is_named(ending):
    pointer = b"version https://git-lfs.github.com/spec/v1\noid sha256:4d7a21\nsize 12345\n"
    for text in (pointer, pointer.replace(b"git-lfs.github", b"hawser.github")):
        assert refused(f"a{ending}", text).endswith("the file that it stands for; get that with: git lfs pull")
    if ending == ".glb":
        return
    words = {".stl": exported("stl_ascii"), ".obj": WHOLE["box.obj"], ".ply": WHOLE["text.ply"]}[ending].decode()
    for encoding in ("utf-16", "utf-16-le", "utf-16-be"):
        assert "is UTF-16 text; save it as UTF-8" in refused(f"a{ending}", words.encode(encoding))
    assert len(read_faces(f"a{ending}", words.encode("utf-8-sig"))[1]) == 12


def places(value, at=()):
    """The way to every entry of a GLB's description."""
    for key in value if isinstance(value, dict) else range(len(value)) if isinstance(value, list) else ():
        yield (*at, key)
        yield from places(value[key], (*at, key))


def test_a_damaged_description_is_refused_in_words_for_people():
    size = int.from_bytes(WHOLE["box.glb"][12:16], "little")
    ways = list(places(json.loads(WHOLE["box.glb"][20 : 20 + size])))
    python = re.compile(r"object|subscript|iterable|hashable|Error|list indices|None|reshape|'\w+'")
    refusals = 0
    for way in ways:
        for value in (None, 3, -1, 99, "x", [], {}, [None], 1.5, True):
            try:
                read_faces("a.glb", glb(set_in(*way, value=value)))
            except MeshError as error:
                refusals += 1
                assert not python.search(str(error)), (way, value, str(error))
    assert refusals > 200


def test_a_scene_of_several_parts_is_put_together():
    scene = trimesh.Scene()
    for x in (0.0, 3.0):
        scene.add_geometry(BOX, transform=trimesh.transformations.translation_matrix([x, 0, 0]))
    vertices, faces = read_faces("two.glb", scene.export(file_type="glb"))
    assert len(faces) == 24 and np.ptp(vertices[:, 0]) == pytest.approx(4.0)


def test_of_a_file_that_is_too_large_nothing_is_read(tmp_path):
    file = tmp_path / "huge.stl"
    with file.open("wb") as stream:
        stream.truncate(1 << 40)
    with pytest.raises(MeshError, match="has 1099511627776 bytes; at most 1073741824 are read"):
        read_faces(file)


@pytest.mark.skipif(os.name != "posix", reason="pipes and devices as POSIX has them")
def test_a_pipe_is_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "a.stl")
    with pytest.raises(MeshError, match="is a pipe or a device"):
        read_faces(tmp_path / "a.stl")
