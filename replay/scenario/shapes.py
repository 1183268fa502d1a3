"""The shapes that links carry."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Discriminator, Field, StringConstraints, Tag, model_validator

from replay.geometry.mesh_file import FORMATS
from replay.language.fields import Flag, Part, Pose, Size2, Size3, rejected
from replay.language.units import Aperture, AxisScale, Scale, Size

FINEST_CHORD = 1e-5
"""Smallest chord error as a fraction of the radius: a sphere then has about 0.6 million triangles."""

SMALLEST_SCALE = 1e-9
"""Smallest size of a scale along one axis: that of one along all."""

Color = Annotated[str, StringConstraints(pattern=r"^#[0-9a-fA-F]{6}([0-9a-fA-F]{2})?$")]


_MESH_FILE = rf"({'|'.join(''.join(f'[{c}{c.upper()}]' if c != '.' else '[.]' for c in e) for e in FORMATS)})$"
MESH_FILE_RULE = f"must end in {', '.join(FORMATS[:-1])} or {FORMATS[-1]}; save the mesh as one of these"

MeshFile = Annotated[str, StringConstraints(pattern=_MESH_FILE, max_length=1000)]


class ShapePart(Part):
    """What all shapes have in common."""

    pose: Pose = Pose()
    """Where the shape stands in its link's frame."""
    color: Color = "#b0b4bc"
    """Colour in recordings: "#rrggbb" or "#rrggbbaa"."""
    collide: Flag = True
    """Whether the shape takes part in collision detection."""
    sense: Flag = True
    """Whether sensors sense the shape."""


class CubePart(ShapePart):
    """A cube centred at its origin."""

    type: Literal["cube"]
    size: Size
    """Edge length [m]."""


class CuboidPart(ShapePart):
    """A box centred at its origin."""

    type: Literal["cuboid"]
    size: Size3
    """Edge lengths along x, y and z [m]."""


class PlanePart(ShapePart):
    """A rectangle in its xy plane, centred at its origin, facing +z."""

    type: Literal["plane"]
    size: Size2
    """Edge lengths along x and y [m]."""


class CurvedPart(ShapePart):
    """What all tessellated shapes have in common."""

    radius: Size
    """Radius [m]."""
    chord_error: Size = 0.001
    """Largest distance between the true surface and its triangles [m]."""

    @model_validator(mode="after")
    def _sensible_chord_error(self) -> Self:
        _check_chord_error(self, self.radius)
        return self


def _check_chord_error(shape: CurvedPart | EllipsoidPart, radius: float) -> None:
    finest = FINEST_CHORD * radius
    if shape.chord_error < finest:
        given = "" if "chord_error" in shape.model_fields_set else f"({shape.chord_error:.6g} m when left out) "
        raise rejected(f"{given}must be >= {finest:.6g} m, {FINEST_CHORD:g} of the radius", at=("chord_error",))


class SpherePart(CurvedPart):
    """A sphere around its origin."""

    type: Literal["sphere"]


class CylinderPart(CurvedPart):
    """A cylinder along z, its origin at half height."""

    type: Literal["cylinder"]
    height: Size
    """Height [m]."""


class ConePart(CurvedPart):
    """A cone along z with its apex at +z, its origin at half height."""

    type: Literal["cone"]
    height: Size
    """Height [m]."""


class CapsulePart(CurvedPart):
    """A cylinder along z between two half spheres, its origin at half height."""

    type: Literal["capsule"]
    height: Size
    """Height of the cylinder between the half spheres [m]."""


class EllipsoidPart(ShapePart):
    """An ellipsoid around its origin."""

    type: Literal["ellipsoid"]
    radii: Size3
    """Half axes along x, y and z [m]."""
    chord_error: Size = 0.001
    """Largest distance between the true surface and its triangles [m]."""

    @model_validator(mode="after")
    def _sensible_chord_error(self) -> Self:
        _check_chord_error(self, max(self.radii))
        return self


class ArcPart(CurvedPart):
    """A bent bar in the xy plane, symmetric about +x: the C of a C-arm."""

    type: Literal["arc"]
    span: Aperture
    """Angle that the arc covers [rad], at most a full turn."""
    width: Size
    """Width along z [m]."""
    thickness: Size
    """Radial thickness [m]; the radius is that of the mid-line."""

    @model_validator(mode="after")
    def _thinner_than_its_radius(self) -> Self:
        if self.thickness >= 2.0 * self.radius:
            raise rejected(f"must be below twice the radius, {2.0 * self.radius:.6g} m", at=("thickness",))
        return self


def _kind_of_scale(value: object) -> str:
    return "axes" if isinstance(value, list | tuple) else "all"


class MeshPart(ShapePart):
    """The triangles of a file."""

    type: Literal["mesh"]
    file: MeshFile
    """Path relative to the file that names it, inside the scenario's folder tree, or package://PYTHON_PACKAGE/path."""
    scale: Annotated[
        Annotated[Scale, Tag("all")] | Annotated[tuple[AxisScale, AxisScale, AxisScale], Tag("axes")],
        Discriminator(_kind_of_scale),
    ]
    """Metres per unit of the file: 1 for a mesh in metres, 0.001 for one in millimetres; three numbers along x, y, z,
    of which a negative one mirrors."""

    @model_validator(mode="after")
    def _has_extent(self) -> Self:
        for axis, factor in enumerate(self.scales):
            if abs(factor) < SMALLEST_SCALE:
                raise rejected(f"must not be between -{SMALLEST_SCALE:g} and {SMALLEST_SCALE:g}", at=("scale", axis))
        return self

    @property
    def scales(self) -> tuple[float, float, float]:
        """The scale along each axis."""
        return self.scale if isinstance(self.scale, tuple) else (self.scale, self.scale, self.scale)


Shape = Annotated[
    CubePart
    | CuboidPart
    | SpherePart
    | CylinderPart
    | ConePart
    | CapsulePart
    | EllipsoidPart
    | PlanePart
    | ArcPart
    | MeshPart,
    Field(discriminator="type"),
]
