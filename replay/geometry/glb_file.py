"""GLB files without their pictures, once it is known that they are whole and all of their triangles would be read."""

from __future__ import annotations

import json
import math
import struct
from typing import Any

_JSON, _BINARY = 0x4E4F534A, 0x004E4942
_COMPONENT_BYTES = {5120: 1, 5121: 1, 5122: 2, 5123: 2, 5125: 4, 5126: 4}
_COMPONENTS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
_HARMLESS = ("KHR_materials_", "KHR_texture_", "EXT_texture_", "KHR_lights_")
"""Extensions that change what a body looks like and not where it is."""
_FAN = 6
_LOOKS = ("images", "textures", "materials", "samplers", "skins", "animations", "cameras")
"""Entries that say what a scene looks like, or how it moves."""


def bare(data: bytes) -> bytes:
    """Return a GLB file with no more in it than bodies in their places: no pictures, materials, skins or motion.

    A picture of a few hundred kB can unfold to gigabytes, and what something looks like has no part in its shape.

    Raises:
        ValueError: the file is cut or not glTF 2, or its geometry is kept in a way that would not be read.
    """
    scene, binary = _chunks(data)
    size = len(binary)
    try:
        _check_extensions(scene)
        _check_buffers(scene, size)
        _check_geometry(scene)
        _check_nodes(scene)
        _strip(scene)
    except KeyError as error:
        raise ValueError(f"its description is not glTF 2: it lacks the entry {str(error.args[0])[:40]}") from None
    except OverflowError:
        raise ValueError("a number in its description is too large") from None
    except IndexError:
        raise ValueError("its description is not glTF 2: it refers to an entry that is not there") from None
    except (TypeError, AttributeError):
        raise ValueError("its description is not glTF 2: an entry is of another kind than it should be") from None
    text = json.dumps(scene).encode()
    text += b" " * (-len(text) % 4)
    rest = struct.pack("<2I", size, _BINARY) + binary if size else b""
    return b"glTF" + struct.pack("<4I", 2, 20 + len(text) + len(rest), len(text), _JSON) + text + rest


def _strip(scene: dict[str, Any]) -> None:
    for name in _LOOKS:
        scene.pop(name, None)
    for mesh in scene.get("meshes", ()):
        mesh.pop("name", None)
        for primitive in mesh["primitives"]:
            for name in ("material", "targets", "extensions"):
                primitive.pop(name, None)
            primitive["attributes"] = {"POSITION": primitive["attributes"]["POSITION"]}
    for node in scene.get("nodes", ()):
        for name in ("skin", "camera", "weights", "name", "extras"):
            node.pop(name, None)


def _chunks(data: bytes) -> tuple[dict[str, Any], bytes]:
    """Return the description of the scene, and the binary data that come with it."""
    if data[:4] != b"glTF" or len(data) < 20:
        raise ValueError("it does not begin as one")
    version, length, size, kind = struct.unpack("<4I", data[4:20])
    if version != 2:
        raise ValueError(f"it is of glTF version {version}; version 2 is read")
    if length > len(data):
        raise ValueError(f"its header announces {length} bytes; the file has {len(data)}")
    if kind != _JSON or 20 + size > len(data):
        raise ValueError("it does not begin with a whole description of its scene")
    try:
        scene = json.loads(data[20 : 20 + size])
    except (ValueError, RecursionError) as error:
        raise ValueError(f"the description of its scene is damaged: {error}") from None
    if not isinstance(scene, dict):
        raise ValueError("the description of its scene is damaged: it is no JSON object")
    rest = data[20 + size :]
    while len(rest) >= 8:
        size, kind = struct.unpack("<2I", rest[:8])
        if 8 + size > len(rest):
            raise ValueError(f"a part of it announces {size} bytes; {len(rest) - 8} follow")
        if kind == _BINARY:
            return scene, rest[8 : 8 + size]
        rest = rest[8 + size :]
    return scene, b""


def _check_extensions(scene: dict[str, Any]) -> None:
    needed = [name for name in scene.get("extensionsRequired", ()) if not name.startswith(_HARMLESS)]
    needed += [name for name in scene.get("extensionsUsed", ()) if name == "EXT_mesh_gpu_instancing"]
    if needed:
        raise ValueError(f"it needs the extension {needed[0]}, which is not read; export it without compression")


def _check_buffers(scene: dict[str, Any], binary: int) -> None:
    """Check that all numbers are in the file: where they are not, trimesh fills in zeros, as many as announced."""
    for buffer in scene.get("buffers", ()):
        if not buffer.get("uri", "data:").startswith("data:"):
            raise ValueError(f"its data are in another file, {buffer['uri'][:60]!r}; save it as one GLB file")
    views = scene.get("bufferViews", [])
    for number, view in enumerate(views):
        inside = "uri" not in scene["buffers"][view["buffer"]]
        if view["byteLength"] < 0 or (inside and view.get("byteOffset", 0) + view["byteLength"] > binary):
            raise ValueError(f"buffer view {number} is beyond the {binary} bytes of its data")
    for number, accessor in enumerate(scene.get("accessors", ())):
        kind, shape = accessor["componentType"], accessor["type"]
        if kind not in _COMPONENT_BYTES or shape not in _COMPONENTS:
            raise ValueError(f"accessor {number} is of a type that glTF does not know")
        row = _COMPONENT_BYTES[kind] * _COMPONENTS[shape]
        if "bufferView" in accessor:
            view = views[accessor["bufferView"]]
            stride = view.get("byteStride", row)
            room = view["byteLength"] - accessor.get("byteOffset", 0)
        else:
            stride, room = row, binary  # a sparse one, which the zeros of its full size are made for
        if not 0 <= (accessor["count"] - 1) * stride + row <= room:
            raise ValueError(f"accessor {number} announces {accessor['count']} entries, more than its data hold")


def _check_geometry(scene: dict[str, Any]) -> None:
    for mesh in scene.get("meshes", ()):
        for primitive in mesh["primitives"]:
            if primitive.get("mode") == _FAN:
                raise ValueError("it holds triangle fans, which are not read; save it as triangles")
            used = [primitive["attributes"]["POSITION"], *([primitive["indices"]] if "indices" in primitive else [])]
            for accessor in (scene["accessors"][index] for index in used):
                if "sparse" in accessor or "bufferView" not in accessor:
                    raise ValueError("it keeps corners in sparse or compressed form, which is not read")


def _check_nodes(scene: dict[str, Any]) -> None:
    """Check that the nodes form trees of finite transforms: of a node with two parents only one place is read."""
    nodes = scene.get("nodes", [])
    parent: dict[int, int] = {}
    for number, node in enumerate(nodes):
        values = [x for key in ("matrix", "translation", "rotation", "scale") for x in node.get(key, ())]
        if not all(math.isfinite(x) for x in values):
            raise ValueError(f"node {number} has a transform that is not finite")
        for child in node.get("children", ()):
            if child in parent or not 0 <= child < len(nodes):
                raise ValueError(f"node {child} is not there, or has two parents")
            parent[child] = number
    reached = [number for number in range(len(nodes)) if number not in parent]
    for number in reached:
        reached.extend(nodes[number].get("children", ()))
    if len(reached) < len(nodes):
        raise ValueError("a node is within itself")
