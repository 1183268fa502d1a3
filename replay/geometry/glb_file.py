"""GLB files without their pictures, once it is known that they are whole and all of their triangles would be read."""

from __future__ import annotations

import math
import struct

from replay import limits
from replay.geometry.glb_corners import EXTENSION, with_float_corners
from replay.geometry.glb_scene import GlbScene, read_scene

_JSON, _BINARY = 0x4E4F534A, 0x004E4942
_COMPONENT_BYTES = {5120: 1, 5121: 1, 5122: 2, 5123: 2, 5125: 4, 5126: 4}
_COMPONENTS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
_HARMLESS = ("KHR_materials_", "KHR_texture_", "EXT_texture_", "KHR_lights_")
"""Extensions that change what a body looks like and not where it is."""
_TRIANGLES, _STRIP, _FAN = 4, 5, 6
_FLOAT, _WHOLE = 5126, (5121, 5123, 5125)


def bare(data: bytes) -> bytes:
    """Return a GLB file with no more in it than bodies in their places: no pictures, materials, skins or motion.

    A picture of a few hundred kB can unfold to gigabytes, and what something looks like has no part in its shape.

    Raises:
        ValueError: the file is cut or not glTF 2, its geometry is kept in a way that would not be read, or it holds
            more than is read.
    """
    scene, binary = _chunks(data)
    _check_extensions(scene)
    try:
        _check_buffers(scene, len(binary))
        binary = with_float_corners(scene, binary)
        _check_geometry(scene)
    except IndexError:
        raise ValueError("its description is not glTF 2: it refers to an entry that is not there") from None
    _check_nodes(scene)
    text = scene.text().encode()
    text += b" " * (-len(text) % 4)
    rest = struct.pack("<2I", len(binary), _BINARY) + binary if binary else b""
    return b"glTF" + struct.pack("<4I", 2, 20 + len(text) + len(rest), len(text), _JSON) + text + rest


def _chunks(data: bytes) -> tuple[GlbScene, bytes]:
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
    scene, at = read_scene(data[20 : 20 + size]), 20 + size
    while len(data) - at >= 8:
        size, kind = struct.unpack_from("<2I", data, at)
        if at + 8 + size > len(data):
            raise ValueError(f"a part of it announces {size} bytes; {len(data) - at - 8} follow")
        if kind == _BINARY:
            return scene, data[at + 8 : at + 8 + size]
        at += 8 + size
    return scene, b""


def _check_extensions(scene: GlbScene) -> None:
    needed = [name for name in scene.extensionsRequired if not name.startswith(_HARMLESS) and name != EXTENSION]
    needed += [name for name in scene.extensionsUsed if name == "EXT_mesh_gpu_instancing"]
    if needed:
        raise ValueError(f"it needs the extension {needed[0][:60]}, which is not read; export it without compression")


def _check_buffers(scene: GlbScene, binary: int) -> None:
    """Check that all numbers are in the file: where they are not, trimesh fills in zeros, as many as announced."""
    for buffer in scene.buffers:
        if buffer.uri is not None and not buffer.uri.startswith("data:"):
            raise ValueError(f"its data are in another file, {buffer.uri[:60]!r}; save it as one GLB file")
    for number, view in enumerate(scene.bufferViews):
        inside = scene.buffers[view.buffer].uri is None
        if inside and view.byteOffset + view.byteLength > binary:
            raise ValueError(f"buffer view {number} is beyond the {binary} bytes of its data")
    corners = 0
    for number, accessor in enumerate(scene.accessors):
        if accessor.componentType not in _COMPONENT_BYTES or accessor.type not in _COMPONENTS:
            raise ValueError(f"accessor {number} is of a type that glTF does not know")
        row = _COMPONENT_BYTES[accessor.componentType] * _COMPONENTS[accessor.type]
        if accessor.bufferView is not None:
            view = scene.bufferViews[accessor.bufferView]
            stride = view.byteStride or row
            room = view.byteLength - accessor.byteOffset
        else:
            stride, room = row, binary  # a sparse one, which the zeros of its full size are made for
        if (accessor.count - 1) * stride + row > room or stride < row:
            raise ValueError(f"accessor {number} announces {accessor.count} entries, more than its data hold")
        corners += accessor.count * _COMPONENTS[accessor.type]
        if corners > 12 * limits.TRIANGLES:
            raise ValueError(f"it holds more numbers than the {limits.TRIANGLES} triangles that are read have")


def _check_geometry(scene: GlbScene) -> None:
    """Check that all triangles are read, and how many they are with every place that a body stands in."""
    triangles = []
    for mesh in scene.meshes:
        found = 0
        for part in mesh.primitives:
            if part.mode == _FAN:
                raise ValueError("it holds triangle fans, which are not read; save it as triangles")
            corners = scene.accessors[part.attributes.POSITION]
            index = None if part.indices is None else scene.accessors[part.indices]
            for accessor in (corners, *(() if index is None else (index,))):
                if accessor.sparse is not None or accessor.bufferView is None:
                    raise ValueError("it keeps corners in sparse or compressed form, which is not read")
            if (corners.type, corners.componentType) != ("VEC3", _FLOAT):
                raise ValueError("its corners are not three 32-bit numbers each, which alone are read")
            if index is not None and (index.type != "SCALAR" or index.componentType not in _WHOLE):
                raise ValueError("its triangles are not given by whole numbers")
            count = (corners if index is None else index).count
            found += max(count // 3 if part.mode == _TRIANGLES else count, corners.count // 3)
        triangles.append(found)
    placed = sum(triangles[node.mesh] for node in scene.nodes if node.mesh is not None)
    if max(placed, sum(triangles)) > limits.TRIANGLES:
        raise ValueError(f"it holds {max(placed, sum(triangles))} triangles; at most {limits.TRIANGLES} are read")


def _check_nodes(scene: GlbScene) -> None:
    """Check that the nodes form trees of finite transforms: of a node with two parents only one place is read."""
    nodes = scene.nodes
    parent: dict[int, int] = {}
    for number, node in enumerate(nodes):
        if not all(math.isfinite(x) for x in node.numbers):
            raise ValueError(f"node {number} has a transform that is not finite")
        for child in node.children or ():
            if child in parent or child >= len(nodes):
                raise ValueError(f"node {child} is not there, or has two parents")
            parent[child] = number
    level = [number for number in range(len(nodes)) if number not in parent]
    reached, depth = len(level), 1
    while level := [child for number in level for child in nodes[number].children or ()]:
        reached, depth = reached + len(level), depth + 1
        if depth > limits.GLB_DEPTH:
            raise ValueError(f"its nodes are more than {limits.GLB_DEPTH} deep within one another")
    if reached < len(nodes):
        raise ValueError("a node is within itself")
    for roots in scene.scenes or ():
        if any(number >= len(nodes) for number in roots.nodes or ()):
            raise ValueError("its description is not glTF 2: a scene begins with a node that is not there")
    if scene.scene is not None and scene.scene >= len(scene.scenes or ()):
        raise ValueError("its description is not glTF 2: its scene is not there")
