"""Sensors and bodies whose capacitances are known: conductors.json.

A case is written as surfaces in one frame: the electrodes of a unit, what is behind its plates among them, and bodies.
Its truth is Maxwell's matrix of what the bodies add, from boundary elements on three meshes, extrapolated.
"""

from __future__ import annotations

import json
import math
from collections.abc import Collection
from dataclasses import dataclass
from importlib import resources
from typing import Any

import numpy as np

from replay.bench.inputs import box_surface, phantom
from replay.geometry.primitives import plane, sphere
from replay.numerics import transforms
from replay.numerics.arrays import Flags, Floats
from replay.sensing.capacitive.sensor import CapacitiveSensor, Plate
from replay.sensing.electrostatics.body import ConductorBody
from replay.sensing.electrostatics.conductors import FOUR_PI_EPSILON, kept_unit
from replay.sensing.electrostatics.placement import PosedBodies
from replay.sensing.electrostatics.unit import MOST_PANELS, Electrode, Unit

_BEHIND = ("housing", "back")
_PICOFARAD = 1e-12 / FOUR_PI_EPSILON


@dataclass(frozen=True, eq=False)
class Configuration:
    """A unit and bodies whose effect on it is known.

    Attributes:
        name: of the case, its family and a number.
        plates: one a sensor, each with its surface.
        behind: surfaces of what is behind the plates; none without.
        bodies: in the unit's frame.
        gap: the least distance between the unit and a body [m].
        truth, doubt: (k, k) [m] of the plates, in units of 4 pi eps0: what the bodies add, and how well it is known.
    """

    name: str
    plates: tuple[CapacitiveSensor, ...]
    behind: tuple[Floats, ...]
    bodies: tuple[ConductorBody, ...]
    gap: float
    truth: Floats
    doubt: Floats

    def unit(self, most_panels: int = MOST_PANELS) -> Unit:
        """Return the electrodes, what is behind as the last one."""
        electrodes = [Electrode(sensor.name, (outline(sensor.plates[0]),)) for sensor in self.plates]
        return kept_unit([*electrodes, *([Electrode("back", self.behind)] if self.behind else [])], most_panels)

    def placed(self, T: Floats | None = None) -> PosedBodies:
        """Return the bodies as they are, or all moved alike by T (4, 4)."""
        pose = np.identity(4) if T is None else T
        return PosedBodies(self.bodies, [pose] * len(self.bodies), np.arange(len(self.bodies)), self.gap)

    @property
    def counted(self) -> Flags:
        """Which plates (k,) read more than a tenth of what the largest reads."""
        own = self.truth.diagonal()
        return np.asarray(own > 0.1 * own.max())

    def errors(self, increase: Floats) -> Floats:
        """Return relative errors of those plates' readings, given what was found of all electrodes [m]."""
        own = self.truth.diagonal()
        return np.asarray(np.abs(increase.diagonal()[: len(own)] / own - 1.0)[self.counted])


def configurations(families: Collection[str] | None = None) -> list[Configuration]:
    """Return the cases of some families, or all: bare plates, plates before a back, six on a housing, a ring, a guard.

    Raises:
        MissingPackageError: the human body of some is not installed (package pyskindose).
    """
    text = resources.files("replay.bench").joinpath("conductors.json").read_text()
    return [
        _configuration(case) for case in json.loads(text)["cases"] if families is None or case["family"] in families
    ]


def outline(plate: Plate) -> Floats:
    """Return the two triangles (2, 3, 3) [m] of a plate in its sensor's link."""
    return np.asarray(transforms.apply(plate.T_link_plate, plane(tuple(2.0 * plate.half_size)).triangles))


def _configuration(case: dict[str, Any]) -> Configuration:
    truth, order = case["truth"], case["truth"]["order"]
    own = [k for k, name in enumerate(order) if name not in _BEHIND]
    found = {electrode["name"]: electrode["shapes"] for electrode in case["electrodes"]}
    plates = []
    for k in own:
        (shape,) = found[order[k]]
        plate = Plate("plate", _pose(shape), 0.5 * np.array(shape["size"]))
        plates.append(CapacitiveSensor(order[k], 0, (plate,), 1e-11))
    behind = [surface(shape) for name in _BEHIND for shape in found.get(name, [])]
    bodies = [
        ConductorBody(shape["type"], (surface(shape),), math.inf if shape["state"] == "grounded" else 0.0)
        for shape in case["bodies"]
    ]
    return Configuration(
        name=case["id"],
        plates=tuple(plates),
        behind=tuple(behind),
        bodies=tuple(bodies),
        gap=case["min_gap_m"] or 5e-3,
        truth=_PICOFARAD * np.array(truth["dC_pF"])[np.ix_(own, own)],
        doubt=_PICOFARAD * np.array(truth["err_pF"])[np.ix_(own, own)],
    )


def _pose(shape: dict[str, Any]) -> Floats:
    pose = np.identity(4)
    pose[:3, :3], pose[:3, 3] = shape["R"], shape["t"]
    return pose


def surface(shape: dict[str, Any]) -> Floats:
    """Return the triangles (n, 3, 3) [m] of a shape as it is written in a case."""
    match shape["type"]:
        case "rect":
            local = plane(tuple(shape["size"])).triangles
        case "box":
            local = box_surface(tuple(shape["size"]))
        case "prism":
            local = _prism(shape["sides"], shape["radius"], shape["height"])
        case "icosphere":
            local = shape["radius"] * _icosphere(shape["subdivisions"])
        case _:
            local = phantom(1_000, centred=False)
    return np.ascontiguousarray(transforms.apply(_pose(shape), local))


def _prism(sides: int, radius: float, height: float) -> Floats:
    angle = 2.0 * np.pi * np.arange(sides) / sides
    low = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), np.full(sides, -0.5 * height)])
    high, centre = low * [1.0, 1.0, -1.0], np.array([0.0, 0.0, 0.5 * height])
    p, q, r, s = low, np.roll(low, -1, axis=0), np.roll(high, -1, axis=0), high
    triangles = [
        (p, q, r),
        (p, r, s),
        (np.broadcast_to(-centre, p.shape), q, p),
        (np.broadcast_to(centre, p.shape), s, r),
    ]
    return np.concatenate([np.stack(corners, axis=1) for corners in triangles])


def _icosphere(subdivisions: int) -> Floats:
    triangles = sphere(1.0, 1.0).triangles  # the icosahedron
    for _ in range(subdivisions):
        a, b, c = triangles[:, 0], triangles[:, 1], triangles[:, 2]
        ab, bc, ca = (x / np.sqrt(np.sum(x * x, axis=1, keepdims=True)) for x in (a + b, b + c, c + a))
        parts = ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))
        triangles = np.concatenate([np.stack(part, axis=1) for part in parts])
    return triangles
