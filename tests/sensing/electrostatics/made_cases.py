"""Conductors with known answers: the shared cases (replay/bench/conductors.json) and simple surfaces."""

from __future__ import annotations

import importlib.util
import json
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from replay.geometry import primitives
from replay.sensing.electrostatics.body import ConductorBody
from replay.sensing.electrostatics.conductors import FOUR_PI_EPSILON
from replay.sensing.electrostatics.placement import PosedBodies
from replay.sensing.electrostatics.unit import Electrode, Unit

Floats = NDArray[np.float64]

PICO = FOUR_PI_EPSILON * 1e12
"""[pF/m]"""

CASES: dict[str, Any] = {
    case["id"]: case
    for case in json.loads(resources.files("replay.bench").joinpath("conductors.json").read_text())["cases"]
}


def rectangle(x: float, y: float, z: float = 0.0) -> Floats:
    a = np.array([[-x, -y], [x, -y], [x, y], [-x, y]]) / 2
    corners = np.column_stack([a, np.full(4, z)])
    return corners[[[0, 1, 2], [0, 2, 3]]]


def shifted(triangles: Floats, x: float, y: float, z: float) -> Floats:
    return triangles + np.array([x, y, z])


def box(*size: float) -> Floats:
    return primitives.cuboid(size).triangles


def icosphere(radius: float, subdivisions: int) -> Floats:
    g = (1 + 5**0.5) / 2
    v = [(-1, g, 0), (1, g, 0), (-1, -g, 0), (1, -g, 0), (0, -1, g), (0, 1, g)]
    v += [(0, -1, -g), (0, 1, -g), (g, 0, -1), (g, 0, 1), (-g, 0, -1), (-g, 0, 1)]
    faces = "0b5 051 017 07a 0ab 159 5b4 ba2 a76 718 394 342 326 368 389 495 24b 62a 867 981"
    t = np.array(v, float)[[[int(c, 16) for c in face] for face in faces.split()]]
    t /= np.linalg.norm(t, axis=2, keepdims=True)
    for _ in range(subdivisions):
        a, b, c = t[:, 0], t[:, 1], t[:, 2]
        ab, bc, ca = (x / np.linalg.norm(x, axis=1, keepdims=True) for x in (a + b, b + c, c + a))
        t = np.concatenate([np.stack(x, 1) for x in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))])
    return t * radius


def prism(sides: int, radius: float, height: float) -> Floats:
    angle = 2 * np.pi * np.arange(sides) / sides
    ring = np.stack([radius * np.cos(angle), radius * np.sin(angle)], 1)
    found = []
    for p, q in zip(ring, np.roll(ring, -1, axis=0), strict=True):
        low, high = -height / 2, height / 2
        found += [[[*p, low], [*q, low], [*q, high]], [[*p, low], [*q, high], [*p, high]]]
        found += [[[0, 0, k], [*p, k], [*q, k]] for k in (low, high)]
    return np.array(found)


def phantom() -> Floats:
    spec = importlib.util.find_spec("pyskindose")
    assert spec is not None and spec.submodule_search_locations
    file = Path(spec.submodule_search_locations[0]) / "phantom_data" / "adult_male_reduced_1000t.stl"
    data = file.read_bytes()
    row = np.dtype([("n", "<3f4"), ("v", "<9f4"), ("a", "<u2")])
    return np.frombuffer(data[84:], row)["v"].reshape(-1, 3, 3).astype(float) * 0.01


def surface(shape: dict[str, Any]) -> Floats:
    """Return the triangles of a shape of a case, in its frame."""
    match shape["type"]:
        case "rect":
            local = rectangle(*shape["size"])
        case "box":
            local = box(*shape["size"])
        case "prism":
            local = prism(shape["sides"], shape["radius"], shape["height"])
        case "icosphere":
            local = icosphere(shape["radius"], shape["subdivisions"])
        case "phantom":
            local = phantom()
        case other:
            raise ValueError(other)
    return np.ascontiguousarray(local @ np.array(shape["R"]).T + np.array(shape["t"]))


def of_case(case: dict[str, Any]) -> tuple[Unit, PosedBodies]:
    """Return the unit and the bodies of a case."""
    unit = Unit([Electrode(e["name"], tuple(map(surface, e["shapes"]))) for e in case["electrodes"]])
    earth = {"grounded": np.inf, "floating": 0.0}
    bodies = [ConductorBody(f"{k}", (surface(shape),), earth[shape["state"]]) for k, shape in enumerate(case["bodies"])]
    return unit, placed(*bodies, gap=case["min_gap_m"] or 5e-3)


def placed(*bodies: ConductorBody, gap: float = 5e-3, poses: list[Floats] | None = None) -> PosedBodies:
    return PosedBodies(bodies, poses or [np.eye(4)] * len(bodies), np.arange(len(bodies)), gap)
