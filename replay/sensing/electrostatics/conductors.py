"""Which sensors are one unit, what is behind their plates, and which bodies they feel.

The plates of all sensors of a link, and what any of them has in `back`, are one unit. Every other link with sensed
shapes is a body, unless the sensors ignore it. What else the unit's own link carries is not there.
"""

from __future__ import annotations

import hashlib
from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from replay.errors import InvalidValue
from replay.numerics import transforms
from replay.numerics.arrays import Floats, Integers
from replay.sensing.electrostatics.body import ConductorBody
from replay.sensing.electrostatics.unit import MOST_PANELS, Electrode, Unit
from replay.sensing.target import Target

FOUR_PI_EPSILON = 1.1126500560536183e-10
"""[F/m], 4 pi times the vacuum's permittivity, CODATA 2018."""

_CORNERS = np.array([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]])
_KEPT_UNITS = 8


@dataclass(frozen=True, eq=False)
class Station:
    """The sensors of one link and what they feel.

    Attributes:
        link: index of the link.
        sensors: (k,) their columns.
        plates: triangles (n, 3, 3) [m] of each sensor, in the link's frame.
        behind: triangles of what is behind; none without.
        driven: whether that has the plates' voltage.
        unit: the electrodes: one a sensor, and what is behind as the last one.
        bodies: what they feel; their frames are those of their links.
        links: of each body.
        objects: the column of each shape of all bodies, in order.
    """

    link: int
    sensors: Integers
    plates: tuple[Floats, ...]
    behind: Floats
    driven: bool
    unit: Unit
    bodies: tuple[ConductorBody, ...]
    links: tuple[int, ...]
    objects: Integers

    @property
    def has_back(self) -> bool:
        """Whether something is behind the plates."""
        return len(self.behind) > 0

    @property
    def surface(self) -> Floats:
        """All triangles (n, 3, 3) [m] of the unit."""
        return np.ascontiguousarray(np.concatenate([*self.plates, self.behind]))


def stations(
    sensors: Sequence[Any], targets: Sequence[Target], *, most_panels: int = MOST_PANELS
) -> tuple[Station, ...]:
    """Return the sensors of a scene as units, in the order of their links.

    Args:
        sensors: as `sensing.capacitive.sensor.CapacitiveSensor`.
        targets: the sensed shapes.
        most_panels: of a unit's meshes, see `unit.Unit`.

    Raises:
        InvalidValue: sensors of one link that ignore other links, or drive what is behind them differently.
    """
    result = []
    for link in sorted({sensor.link for sensor in sensors}):
        columns = [k for k, sensor in enumerate(sensors) if sensor.link == link]
        own = [sensors[k] for k in columns]
        first = own[0]
        felt = {target.link for target in targets if first.senses(target.link)}
        for other in own[1:]:
            if {target.link for target in targets if other.senses(target.link)} != felt:
                rule = f"must ignore the same links as {first.name!r}: sensors on one link are one unit"
                raise InvalidValue(f"sensor {other.name!r}: ignore", "other links", rule)
            if other.driven != first.driven:
                rule = f"must be as of {first.name!r}: what is behind the sensors of one link is one conductor"
                raise InvalidValue(f"sensor {other.name!r}: driven", other.driven, rule)
        if first.driven and not any(sensor.back for sensor in own):
            raise InvalidValue(f"sensor {first.name!r}: driven", True, "has no effect: nothing is in `back`")
        plates = tuple(np.concatenate([_rectangle(plate) for plate in sensor.plates]) for sensor in own)
        shapes = {name: triangles for sensor in own for name, triangles in sensor.back}
        electrodes = [Electrode(s.name, tuple(_rectangle(plate) for plate in s.plates)) for s in own]
        if shapes:
            electrodes.append(Electrode("back", tuple(shapes[name] for name in sorted(shapes))))
        behind = np.concatenate([shapes[name] for name in sorted(shapes)]) if shapes else np.zeros((0, 3, 3))
        objects, bodies, links = [], [], []
        for body in sorted(felt):
            found = [k for k, target in enumerate(targets) if target.link == body]
            name = targets[found[0]].name.partition("/")[0]
            earth = targets[found[0]].earth / FOUR_PI_EPSILON
            bodies.append(_with_area(ConductorBody(name, tuple(targets[k].triangles for k in found), earth)))
            links.append(body)
            objects += found
        result.append(
            Station(
                link=link,
                sensors=np.array(columns, dtype=np.intp),
                plates=plates,
                behind=behind,
                driven=first.driven,
                unit=kept_unit(electrodes, most_panels),
                bodies=tuple(bodies),
                links=tuple(links),
                objects=np.array(objects, dtype=np.intp),
            )
        )
    return tuple(result)


_units: OrderedDict[bytes, Unit] = OrderedDict()


def kept_unit(electrodes: Sequence[Electrode], most_panels: int = MOST_PANELS) -> Unit:
    """Return a unit; one that this process made of the same surfaces comes with what was computed of it."""
    digest = hashlib.sha256(f"{most_panels}".encode())
    for electrode in electrodes:
        digest.update(f"{len(electrode.surfaces)}".encode())
        for surface in electrode.surfaces:
            digest.update(f" {len(surface)} ".encode() + np.ascontiguousarray(surface).tobytes())
    key = digest.digest()
    if key not in _units:
        _units[key] = Unit(electrodes, most_panels=most_panels)
        while len(_units) > _KEPT_UNITS:
            _units.popitem(last=False)
    _units.move_to_end(key)
    return _units[key]


def _rectangle(plate: Any) -> Floats:
    corners = transforms.apply(plate.T_link_plate, _CORNERS * np.append(plate.half_size, 0.0))
    return np.ascontiguousarray(corners[[[0, 1, 2], [0, 2, 3]]])


def _with_area(body: ConductorBody) -> ConductorBody:
    if not any(len(faces.panels.area) for faces in body.faces):
        raise InvalidValue(f"body {body.name!r}", "triangles without area", "must have area")
    return body
