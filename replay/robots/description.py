"""A robot as its description has it: links with bodies, joints, named states, and what was said of them."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from replay.robots.xml_text import XmlElement

Triple = tuple[float, float, float]


@dataclass(frozen=True)
class Origin:
    """A pose in the frame of what carries it: xyz [m], and roll, pitch, yaw [rad] with R = Rz Ry Rx."""

    xyz: Triple = (0.0, 0.0, 0.0)
    rpy: Triple = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Geometry:
    """A shape of a description.

    Attributes:
        kind: box, cylinder, sphere, capsule or mesh.
        sizes: edge lengths of a box; radius and length of a cylinder or capsule; radius of a sphere [m].
        file, scale: of a mesh, as written.
    """

    kind: str
    sizes: tuple[float, ...] = ()
    file: str = ""
    scale: Triple = (1.0, 1.0, 1.0)


@dataclass(frozen=True)
class RobotBody:
    """A shape on a link, its colour ("#rrggbb") if it has one, and the element that it was read from."""

    name: str
    origin: Origin
    geometry: Geometry
    color: str | None
    element: XmlElement


@dataclass(frozen=True, eq=False)
class RobotLink:
    """A link: what collides, what is shown, and its element."""

    name: str
    collisions: tuple[RobotBody, ...]
    visuals: tuple[RobotBody, ...]
    element: XmlElement


@dataclass(frozen=True)
class Following:
    """That a joint follows another: position = multiplier * position of `joint` + offset."""

    joint: str
    multiplier: float
    offset: float


@dataclass(frozen=True)
class Limits:
    """Limits of a joint [rad or m, per s, per s^2]; None for rates that are not given."""

    lower: float = -math.inf
    upper: float = math.inf
    velocity: float | None = None
    acceleration: float | None = None
    deceleration: float | None = None


@dataclass(frozen=True, eq=False)
class RobotJoint:
    """A joint.

    Attributes:
        type: fixed, revolute, continuous, prismatic, floating or planar.
        axis: in the joint's frame, as written.
    """

    name: str
    type: str
    parent: str
    child: str
    origin: Origin
    axis: Triple
    element: XmlElement
    limits: Limits = Limits()
    mimic: Following | None = None

    @property
    def moves(self) -> bool:
        """Whether it has one position."""
        return self.type in ("revolute", "continuous", "prismatic")


@dataclass(frozen=True)
class RobotChange:
    """Something that the part does not say as the description does.

    Attributes:
        place: of what, such as "joint elbow".
        what: is dropped or changed.
        physical: whether it changes what collides, is sensed or moves.
    """

    place: str
    what: str
    physical: bool = False

    def __str__(self) -> str:
        return f"{self.place}: {self.what}"


@dataclass
class Robot:
    """A robot.

    Attributes:
        name: of the robot.
        links, joints: by name, in the order of the description.
        root: the link that has no parent.
        changes: what could not be taken over as it is.
    """

    name: str
    links: dict[str, RobotLink]
    joints: dict[str, RobotJoint]
    root: str
    changes: list[RobotChange] = field(default_factory=list)
