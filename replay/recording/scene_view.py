"""What a recording shows of a scene: bodies, sensing cones and plates, each on its link."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from replay.scenario.scene import Scene

Floats = NDArray[np.float64]
Color = tuple[int, int, int, int]
"""Red, green, blue and opacity, 0 to 255."""


@dataclass(frozen=True, eq=False)
class BodyView:
    """A shape as it is drawn.

    Attributes:
        name: "link/shape".
        link: index of its link.
        triangles: (t, 3, 3) [m] in the link's frame.
        color: while nothing is near.
    """

    name: str
    link: int
    triangles: Floats
    color: Color


@dataclass(frozen=True, eq=False)
class ConeView:
    """The cone of a distance sensor: apex at the sensor's origin, axis +z.

    Attributes:
        sensor: name.
        link: index of its link.
        T_link_sensor: (4, 4).
        aperture: full opening angle [rad].
        range: [m], may be infinite.
    """

    sensor: str
    link: int
    T_link_sensor: Floats
    aperture: float
    range: float


@dataclass(frozen=True, eq=False)
class PlateView:
    """A plate of a capacitive sensor, in the xy plane of its own frame.

    Attributes:
        sensor: name of the sensor.
        name: of the plate among the sensor's plates.
        link: index of its link.
        T_link_plate: (4, 4).
        half_size: (2,) half edges [m] along x and y.
    """

    sensor: str
    name: str
    link: int
    T_link_plate: Floats
    half_size: Floats


@dataclass(frozen=True, eq=False)
class SceneView:
    """Everything that is drawn.

    Attributes:
        name, description: of the scenario; the description may be several lines of Markdown.
        texts: the scenario's own text files, by name.
        links: L names.
        bodies, cones, plates: see there.
    """

    name: str
    description: str
    links: tuple[str, ...]
    bodies: tuple[BodyView, ...]
    cones: tuple[ConeView, ...] = ()
    plates: tuple[PlateView, ...] = ()
    texts: Mapping[str, str] = field(default_factory=dict)


def indexed(triangles: Floats) -> tuple[Floats, NDArray[np.uint32]]:
    """Return the vertices (v, 3) that triangles (t, 3, 3) share, each once, and the triangles (t, 3) as indices."""
    flat = triangles.reshape(-1, 3) + 0.0  # -0.0 and 0.0 are one vertex
    vertices, index = np.unique(flat, axis=0, return_inverse=True)
    return vertices, index.reshape(-1, 3).astype(np.uint32)


def view(scene: Scene) -> SceneView:
    """Return what a recording shows of a scene."""
    scenario = scene.scenario
    notes = "\n".join(f"- {note}" for note in scene.notes)
    return SceneView(
        name=scenario.name,
        description="\n\n".join(part for part in (scenario.description, notes) if part),
        links=scene.layout.links,
        bodies=tuple(BodyView(s.name, s.link, s.solid.triangles, s.color) for s in scene.shapes),
        cones=tuple(ConeView(s.name, s.link, s.T_link_sensor, s.aperture, s.range) for s in scene.distance_sensors),
        plates=tuple(
            PlateView(sensor.name, plate.name, sensor.link, plate.T_link_plate, plate.half_size)
            for sensor in scene.capacitive_sensors
            for plate in sensor.plates
        ),
        texts={
            name: data.decode(errors="replace")
            for name, data in scenario.sources.items()
            if name.endswith((".yaml", ".yml"))
        },
    )
