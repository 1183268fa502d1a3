"""The parts of a rerun recording that do not change: bodies, cones, plates, names of curves, the scenario's text."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import numpy as np

from replay.numerics import transforms
from replay.recording import blueprint
from replay.recording.scene_view import BodyView, Color, Floats, SceneView, indexed
from replay.recording.surfaces import cone_strips, corner_normals, plate_corners

CONE = (110, 190, 255, 140)
PLATE = (216, 140, 60, 255)
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

Path = list[str]


def body_path(scene: SceneView, body: BodyView) -> Path:
    """Return the entity of a body: below its link's, under its own name."""
    return [blueprint.SCENE, scene.links[body.link], body.name.rpartition("/")[2]]


def log_scene(stream: Any, scene: SceneView, colored: Collection[int]) -> None:
    """Log everything that does not change; the colours of the bodies in `colored` do."""
    import rerun as rr

    stream.log(blueprint.SCENE, rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    normals = np.split(corner_normals(scene.meshes), scene.meshes.first_triangle[1:-1])
    for k, body in enumerate(scene.bodies):
        _log_mesh(stream, body_path(scene, body), body.triangles, normals[k], None if k in colored else body.color)
    for cone in scene.cones:
        lines = rr.LineStrips3D(cone_strips(cone), colors=CONE, radii=rr.Radius.ui_points(0.8))
        stream.log([blueprint.SCENE, scene.links[cone.link], "distance_sensors", cone.sensor], lines, static=True)
        beam = [blueprint.SCENE, "closest_points", cone.sensor]
        stream.log(beam, _only(rr.LineStrips3D, colors=BEAM, radii=rr.Radius.ui_points(2.0)), static=True)
        stream.log(beam, _only(rr.Points3D, colors=BEAM, radii=rr.Radius.ui_points(5.0)), static=True)
    _log_plates(stream, scene)
    stream.log(blueprint.SCENARIO, rr.TextDocument(_document(scene), media_type="text/markdown"), static=True)


def _log_plates(stream: Any, scene: SceneView) -> None:
    import rerun as rr

    corners = [plate_corners(plate) for plate in scene.plates]
    meshes = indexed([four[[[0, 1, 2], [0, 2, 3]]] for four in corners])
    normals = corner_normals(meshes).reshape(-1, 2, 3, 3)
    outlines: dict[tuple[str, ...], list[Floats]] = {}
    for plate, four, triangles, across in zip(
        scene.plates, corners, meshes.triangles.reshape(-1, 2, 3, 3), normals, strict=True
    ):
        path = [blueprint.SCENE, scene.links[plate.link], "capacitive_sensors", plate.sensor, plate.name]
        _log_mesh(stream, path, triangles, across, PLATE)
        outlines.setdefault((*path[:-1], "outline"), []).append(four[[0, 1, 2, 3, 0]])
    for place, strips in outlines.items():
        lines = rr.LineStrips3D(strips, colors=PLATE, radii=rr.Radius.ui_points(1.0))
        stream.log(list(place), lines, static=True)


def log_curve(stream: Any, path: Path, name: str, number: int) -> None:
    """Log how a curve is called in its chart, and its colour: that of its number there."""
    import rerun as rr

    color = CURVES[number % len(CURVES)]  # the viewer's own colours follow from names and may be alike
    stream.log(path, rr.SeriesLines(names=name, widths=1.5, colors=color), static=True)


def extent(scene: SceneView, link_poses: Floats) -> Floats:
    """Return points (n, 3) [m] in world coordinates that span the scene.

    Args:
        scene: what is shown; flat bodies (a floor) count only when there are no others.
        link_poses: (L, 4, 4), T_world_link in one frame.
    """
    boxes: list[Floats] = []
    flat: list[Floats] = []
    for body in scene.bodies:
        points = body.triangles.reshape(-1, 3)
        if not len(points):
            continue
        low, high = points.min(axis=0), points.max(axis=0)
        box = np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])
        (boxes if (high > low).all() else flat).append(transforms.apply(link_poses[body.link], box))
    return np.concatenate(boxes or flat or [np.array([[-1.0, -1.0, 0.0], [1.0, 1.0, 1.0]])])


def _log_mesh(stream: Any, path: Path, triangles: Floats, normals: Floats, color: Color | None) -> None:
    import rerun as rr

    mesh = rr.Mesh3D(
        vertex_positions=triangles.reshape(-1, 3),
        vertex_normals=normals.reshape(-1, 3),
        albedo_factor=color,  # what is static cannot change later
    )
    stream.log(path, mesh, static=True)


def _only(archetype: Any, **fields: Any) -> Any:
    return archetype.from_fields(**fields)


def _document(scene: SceneView) -> str:
    parts = [f"# {scene.name}", scene.description]
    parts += [f"## {name}\n```yaml\n{text.rstrip()}\n```" for name, text in scene.texts.items()]
    return "\n\n".join(part for part in parts if part)
