"""Corners that a GLB file keeps as whole numbers (the extension KHR_mesh_quantization), as the floats that are read."""

from __future__ import annotations

from typing import Final

import numpy as np

from replay.geometry.glb_scene import Accessor, GlbScene, View

EXTENSION: Final = "KHR_mesh_quantization"
_FLOAT = 5126
_WHOLE = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2"}


def with_float_corners(scene: GlbScene, binary: bytes) -> bytes:
    """Point all corners of a scene to floats, and return its binary data with these behind them.

    What is not kept in the binary part, or sparse, is left as it is. A `normalized` number is a share of the largest
    one of its type, from -1 on where it has a sign.

    Args:
        scene: is changed; its accessors are known to lie within their data.
        binary: the binary part of the file.
    """
    parts, length = [binary, b"\0" * (-len(binary) % 4)], len(binary) + -len(binary) % 4
    used = {part.attributes.POSITION for mesh in scene.meshes for part in mesh.primitives}
    for number in sorted(used):
        accessor = scene.accessors[number]
        kind, place = _WHOLE.get(accessor.componentType), accessor.bufferView
        if kind is None or place is None or accessor.type != "VEC3" or accessor.sparse is not None:
            continue
        view = scene.bufferViews[place]
        if scene.buffers[view.buffer].uri is not None:
            continue
        width = np.dtype(kind).itemsize
        shape, strides = (accessor.count, 3), (view.byteStride or 3 * width, width)
        corners = np.ndarray(shape, kind, binary, view.byteOffset + accessor.byteOffset, strides).astype("<f4")
        if accessor.normalized:
            corners = np.maximum(corners / np.float32(np.iinfo(kind).max), np.float32(-1.0))
        scene.accessors[number] = Accessor(
            componentType=_FLOAT, type="VEC3", count=accessor.count, bufferView=len(scene.bufferViews)
        )
        scene.bufferViews.append(View(buffer=view.buffer, byteOffset=length, byteLength=corners.nbytes))
        parts.append(corners.tobytes())
        length += corners.nbytes
        scene.buffers[view.buffer].byteLength = length
    return b"".join(parts)
