"""What a recording shows of a scene: bodies, sensing cones and plates, each on its link."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

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
        name, description: of the scenario.
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
