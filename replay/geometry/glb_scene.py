"""The description of a GLB file's scene as typed entries: what glTF 2 says of bodies in their places, and no more."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from replay import limits
from replay.json_text import read_json

_Index = Annotated[int, Field(ge=0, lt=1 << 31)]
_Size = Annotated[int, Field(ge=0, lt=1 << 53)]


class _GlbEntry(BaseModel):
    """Entries that are not named here are left out: pictures, materials, skins, motion, names."""

    model_config = ConfigDict(strict=True, extra="ignore")


class Buffer(_GlbEntry):
    """Bytes: those of the file's binary part, or a `data:` address."""

    byteLength: _Size
    uri: str | None = None


class View(_GlbEntry):
    """A part of a buffer."""

    buffer: _Index
    byteLength: _Size
    byteOffset: _Size = 0
    byteStride: Annotated[int, Field(ge=1, le=1 << 16)] | None = None


class Accessor(_GlbEntry):
    """Numbers in a view."""

    componentType: int
    type: str
    count: Annotated[int, Field(ge=1, lt=1 << 53)]
    bufferView: _Index | None = None
    byteOffset: _Size = 0
    normalized: bool = False
    sparse: dict[str, Any] | None = None


class Attributes(_GlbEntry):
    """What is known of the corners of a primitive."""

    POSITION: _Index


class Primitive(_GlbEntry):
    """A part of a mesh."""

    attributes: Attributes
    indices: _Index | None = None
    mode: Annotated[int, Field(ge=0, le=6)] = 4


class GlbMesh(_GlbEntry):
    """A body."""

    primitives: list[Primitive]


class GlbNode(_GlbEntry):
    """A body, or several nodes, in a place."""

    mesh: _Index | None = None
    children: list[_Index] | None = None
    matrix: Annotated[list[float], Field(min_length=16, max_length=16)] | None = None
    translation: Annotated[list[float], Field(min_length=3, max_length=3)] | None = None
    rotation: Annotated[list[float], Field(min_length=4, max_length=4)] | None = None
    scale: Annotated[list[float], Field(min_length=3, max_length=3)] | None = None

    @property
    def numbers(self) -> list[float]:
        """All numbers of its transform."""
        parts = (self.matrix, self.translation, self.rotation, self.scale)
        return [number for part in parts for number in part or ()]


class SceneRoots(_GlbEntry):
    """The nodes that a scene begins with."""

    nodes: list[_Index] | None = None


class GlbScene(_GlbEntry):
    """A whole description."""

    asset: dict[str, Any]
    buffers: list[Buffer] = []
    bufferViews: list[View] = []
    accessors: list[Accessor] = []
    meshes: list[GlbMesh] = []
    nodes: list[GlbNode] = []
    scenes: list[SceneRoots] | None = None
    scene: _Index | None = None
    extensionsRequired: list[str] = []
    extensionsUsed: list[str] = []

    def text(self) -> str:
        """Return it as JSON."""
        kept = self.model_dump(exclude_none=True, exclude={"asset", "extensionsRequired", "extensionsUsed"})
        return json.dumps({"asset": {"version": "2.0"}, **{key: value for key, value in kept.items() if value != []}})


def read_scene(text: bytes) -> GlbScene:
    """Return a description as it stands in a file.

    Raises:
        ValueError: it is no JSON or no glTF 2, or holds more than is read.
    """
    try:
        values = read_json(text, most=limits.GLB_JSON)
    except ValueError as error:
        raise ValueError(f"the description of its scene is damaged: {error}") from None
    try:
        scene = GlbScene.model_validate(values)
    except ValidationError as error:
        raise ValueError(f"its description is not glTF 2: {_first(error)}") from None
    parts: dict[str, Sequence[Any]] = {
        "nodes": scene.nodes,
        "primitives": [part for mesh in scene.meshes for part in mesh.primitives],
        "accessors": scene.accessors,
        "views": scene.bufferViews,
        "buffers": scene.buffers,
    }
    for what, entries in parts.items():
        if len(entries) > limits.GLB_ENTRIES:
            raise ValueError(f"it has {len(entries)} {what}; at most {limits.GLB_ENTRIES} are read")
    return scene


def _first(error: ValidationError) -> str:
    found = error.errors(include_url=False, include_input=False, include_context=False)[0]
    place = ".".join(str(step)[:60] for step in found["loc"]) or "it"
    return f"{place} is {'missing' if found['type'] == 'missing' else 'of another kind than it should be'}"
