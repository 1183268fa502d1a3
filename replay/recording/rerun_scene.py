"""The parts of a rerun recording that do not change: bodies, sensors, names of curves, the scenario's text."""

from __future__ import annotations

import functools
from collections.abc import Collection, Sequence

import numpy as np

from replay.numerics import transforms
from replay.numerics.arrays import Floats
from replay.recording import blueprint
from replay.recording.rerun_columns import Chunks, Column, column, constants, entity, packed, row
from replay.recording.scene_view import BodyView, SceneView
from replay.recording.surfaces import corner_normals
from replay.sensing.kind import Color
from replay.sensing.kinds import KINDS

BEAM = (255, 235, 90, 255)
CURVES = (
    (86, 180, 233),
    (240, 165, 30),
    (60, 205, 140),
    (240, 105, 95),
    (190, 140, 245),
    (240, 225, 70),
    (255, 150, 200),
    (160, 165, 175),
)
"""Colours of curves, told apart on a dark ground."""

_FRAMES = 17  # that the first picture has room for: the motion between two of them is small
_CORNERS = np.array([[[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)]], dtype=np.bool_)


def body_path(scene: SceneView, body: BodyView) -> str:
    """Return the entity of a body: below its link's, under its own name."""
    return entity(blueprint.SCENE, scene.links[body.link], body.name.rpartition("/")[2])


def beam_path(sensor: str) -> str:
    """Return the entity of the line from a sensor to the point that it reads."""
    return entity(blueprint.SCENE, "closest_points", sensor)


def log_scene(chunks: Chunks, scene: SceneView, colored: Collection[int]) -> None:
    """Log everything that does not change; the colours of the bodies in `colored` do."""
    chunks.add(blueprint.SCENE, {}, _axes())
    _log_bodies(chunks, scene, colored)
    for sensor in scene.sensors:
        path = [blueprint.SCENE, scene.links[sensor.link], f"{sensor.kind}_sensors", sensor.name]
        drawing = sensor.drawing
        for name, corners in drawing.faces.items():
            chunks.add(entity(*path, name), {}, _face(corners, drawing.color))
        if drawing.strips:
            outline = entity(*path, *(["outline"] if drawing.faces else []))
            chunks.add(outline, {}, _lines(drawing.strips, drawing.color, drawing.width))
        for field in KINDS[sensor.kind].columns.fields():
            if field.beam:
                chunks.add(beam_path(sensor.name), {}, _beam())
    text = row("TextDocument", "text", [_document(scene)])
    chunks.add(blueprint.SCENARIO, {}, [text, row("TextDocument", "media_type", ["text/markdown"])])


def _log_bodies(chunks: Chunks, scene: SceneView, colored: Collection[int]) -> None:
    meshes = scene.meshes
    corners, normals = meshes.triangles.reshape(-1, 3), corner_normals(meshes).reshape(-1, 3)
    ends = (3 * meshes.first_triangle).tolist()
    for k, (body, begin, end) in enumerate(zip(scene.bodies, ends, ends[1:], strict=False)):
        color = None if k in colored else body.color  # what is static cannot change later
        chunks.add(body_path(scene, body), {}, _mesh(corners[begin:end], normals[begin:end], color))


def _face(corners: Floats, color: Color) -> list[Column]:
    across = np.cross(corners[1] - corners[0], corners[3] - corners[0])
    normals = np.broadcast_to(across / np.linalg.norm(across), (6, 3))
    return _mesh(corners[[0, 1, 2, 0, 2, 3]], normals, color)


def log_curve(chunks: Chunks, path: str, name: str, number: int) -> None:
    """Log how a curve is called in its chart, and its colour: that of a number."""
    color = CURVES[number % len(CURVES)]  # the viewer's own colours follow from names and may be alike
    chunks.add(path, {}, [row("SeriesLines", "names", [name]), *_curve(color)])


def extent(scene: SceneView, link_poses: Floats) -> Floats:
    """Return points (n, 3) [m] in world coordinates that span the scene and where it moves.

    Args:
        scene: what is shown; flat bodies (a floor) count only when there are no others.
        link_poses: (F, L, 4, 4), T_world_link; at most 17 of the frames are looked at, evenly spread.
    """
    spans = [(sensor.link, sensor.drawing.extent) for sensor in scene.sensors]
    counts = np.diff(scene.meshes.first_vertex)
    bodies = [body for body, count in zip(scene.bodies, counts.tolist(), strict=True) if count]
    if bodies:
        begins = scene.meshes.first_vertex[:-1][counts > 0]
        low = np.minimum.reduceat(scene.meshes.vertices, begins)
        high = np.maximum.reduceat(scene.meshes.vertices, begins)
        solid = (high > low).all(axis=1)
        boxes = np.where(_CORNERS, high[:, None], low[:, None])
        spans += [(bodies[k].link, boxes[k]) for k in np.flatnonzero(solid if solid.any() else ~solid).tolist()]
    if not spans:
        return np.array([[-1.0, -1.0, 0.0], [1.0, 1.0, 1.0]])
    links = np.repeat([link for link, _ in spans], [len(points) for _, points in spans])
    frames = np.linspace(0, len(link_poses) - 1, min(len(link_poses), _FRAMES)).astype(np.int64)
    return transforms.apply(
        link_poses[frames[:, None], links], np.concatenate([points for _, points in spans])
    ).reshape(-1, 3)


def _mesh(corners: Floats, normals: Floats, color: Color | None) -> list[Column]:
    tint = [] if color is None else [row("Mesh3D", "albedo_factor", packed([color]))]
    return [row("Mesh3D", "vertex_positions", corners), row("Mesh3D", "vertex_normals", normals), *tint]


def _lines(strips: Sequence[Floats], color: Color, width: float) -> list[Column]:
    points = np.array([len(strip) for strip in strips], dtype=np.int64)
    return [column("LineStrips3D", "strips", np.concatenate(strips), len(strips), points), *_pen(color, width)]


@functools.cache
def _pen(color: Color, width: float) -> tuple[Column, ...]:
    import rerun as rr

    return constants(rr.LineStrips3D.from_fields(colors=color, radii=rr.Radius.ui_points(width)))


@functools.cache
def _beam() -> tuple[Column, ...]:
    """Return how the line to a closest point and the point are drawn; where they are follows."""
    import rerun as rr

    points = rr.Points3D.from_fields(colors=BEAM, radii=rr.Radius.ui_points(5.0))
    return *_pen(BEAM, 2.0), *constants(points)


@functools.cache
def _curve(color: tuple[int, int, int]) -> tuple[Column, ...]:
    import rerun as rr

    return constants(rr.SeriesLines.from_fields(widths=1.5, colors=color))


@functools.cache
def _axes() -> tuple[Column, ...]:
    import rerun as rr

    return constants(rr.ViewCoordinates.RIGHT_HAND_Z_UP)


def _document(scene: SceneView) -> str:
    parts = [f"# {scene.name}", scene.description]
    parts += [f"## {name}\n```yaml\n{text.rstrip()}\n```" for name, text in scene.texts.items()]
    return "\n\n".join(part for part in parts if part)
