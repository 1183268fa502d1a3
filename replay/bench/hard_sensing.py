"""Cones, plates and bodies on which formulas go wrong, family by family, with the right answer beside each."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from importlib import resources
from typing import Any

import numpy as np

from replay.bench.cone_truth import nearest_in_cone
from replay.bench.inputs import box, rotations, unit
from replay.numerics.arrays import Floats

Cones = tuple[Floats, Floats, Floats]
"""Triangles (n, 3, 3), axes (n, 3), apertures (n,); the apex is the origin."""

SCALES = np.arange(-30, 21)
"""Powers of two from 1e-9 to 1e6: what is scaled by them keeps every digit, and so does the answer."""


def hard_cones(count: int, *, seed: int = 7) -> list[dict[str, Any]]:
    """Return questions about one triangle in a cone: family, triangles, apex, axis, aperture, truth (inf: nothing)."""
    questions = []
    for number, (family, make) in enumerate(_CONES.items()):
        rng = np.random.default_rng([seed, number])
        triangles, axes, apertures = make(rng, count)
        for k, (triangle, axis, aperture) in enumerate(zip(triangles, axes, apertures, strict=True)):
            apex, size = np.zeros(3), float(np.abs(triangle).max())
            if family == OFFSET:  # of what it rounds to, the difference from the apex is known without any error
                apex = 10.0 ** (k % 9) * rng.normal(size=3)
                triangle = triangle + apex
            questions.append(
                {
                    "family": family,
                    "triangles": triangle[None],
                    "apex": apex,
                    "axis": axis,
                    "aperture": float(aperture),
                    "truth": nearest_in_cone(triangle[None], apex, axis, float(aperture)),
                    "size": size,
                }
            )
    return questions


def _generic(rng: np.random.Generator, n: int) -> Cones:
    triangles = rng.normal(size=(n, 3, 3)) * np.exp(rng.uniform(-1.0, 1.5, size=(n, 1, 1)))
    return triangles, unit(rng, n), 2.0 * rng.uniform(0.05, 1.1, size=n)


def _normals(triangles: Floats) -> Floats:
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    normals *= np.sign(np.sum(normals * triangles[:, 0], axis=1))[:, None]
    return _towards(normals)


def _towards(vectors: Floats) -> Floats:
    result: Floats = vectors / np.sqrt(np.sum(vectors**2, axis=1, keepdims=True))
    return result


def _inner(rng: np.random.Generator, triangles: Floats) -> Floats:
    weights = 0.05 + 0.85 * rng.dirichlet((1.0, 1.0, 1.0), len(triangles))
    result: Floats = np.sum(weights[:, :, None] * triangles, axis=1)
    return result


def _plane_along_axis(rng: np.random.Generator, n: int) -> Cones:
    triangles, axes, apertures = _generic(rng, n)
    return triangles, _towards(np.cross(_normals(triangles), axes)), apertures


def _meets_behind_apex(rng: np.random.Generator, n: int) -> Cones:
    triangles, axes, apertures = _plane_along_axis(rng, n)
    angle = 10.0 ** rng.uniform(-9.0, -0.5, size=(n, 1))
    return triangles, _towards(np.cos(angle) * axes - np.sin(angle) * _normals(triangles)), apertures


def _needle(rng: np.random.Generator, n: int) -> Cones:
    triangles, _, _ = _generic(rng, n)
    return triangles, _towards(_inner(rng, triangles)), 10.0 ** rng.uniform(-9.0, -1.5, size=n)


def _nearly_half_space(rng: np.random.Generator, n: int) -> Cones:
    triangles, axes, _ = _generic(rng, n)
    return triangles, axes, math.pi - 10.0 ** rng.uniform(-9.0, -1.0, size=n)


def _apex_near_surface(rng: np.random.Generator, n: int) -> Cones:
    triangles, axes, apertures = _generic(rng, n)
    normals = _normals(triangles)
    triangles = triangles - _inner(rng, triangles)[:, None]
    lift = 10.0 ** rng.uniform(-9.0, -3.0, size=n) * rng.choice([-1.0, 1.0], size=n)
    return triangles + (lift[:, None] * normals)[:, None], axes, apertures


def _far_and_small(rng: np.random.Generator, n: int) -> Cones:
    triangles, _, apertures = _generic(rng, n)
    size = 10.0 ** rng.uniform(-5.0, -1.0, size=n)
    triangles *= (size / np.abs(triangles).max(axis=(1, 2)))[:, None, None]
    axes = unit(rng, n)
    aside = _towards(np.cross(axes, unit(rng, n)))
    angle = (0.5 * apertures + 0.3 * rng.normal(size=n) * size)[:, None]
    return triangles + (np.cos(angle) * axes + np.sin(angle) * aside)[:, None], axes, apertures


def _scaled(rng: np.random.Generator, n: int) -> Cones:
    triangles, axes, apertures = _generic(rng, n)
    return triangles * 10.0 ** rng.uniform(-9.0, 6.0, size=(n, 1, 1)), axes, apertures


def _slivers(rng: np.random.Generator, n: int) -> Cones:
    """Triangles as thin as 1e-12 of their length, that the axis passes near."""
    triangles, _, apertures = _generic(rng, n)
    inner = triangles[:, 0] + rng.uniform(size=(n, 1)) * (triangles[:, 1] - triangles[:, 0])
    triangles[:, 2] = inner + 10.0 ** rng.uniform(-12.0, -3.0, size=(n, 1)) * (triangles[:, 2] - inner)
    return triangles, _towards(_inner(rng, triangles) + 0.2 * rng.normal(size=(n, 3))), apertures


def _region_borders(rng: np.random.Generator, n: int) -> Cones:
    """The foot of the apex on an edge or on a corner, an edge along the axis, the cone's border through the foot."""
    triangles, axes, apertures = _generic(rng, n)
    for k, T in enumerate(rotations(rng, n)[:, :3, :3]):
        x, y, height = rng.uniform(0.2, 3.0, size=3)
        corners = np.array([[-x, 0.0, height], [y, 0.0, height], [rng.normal(), 2.0, height]])  # the foot on an edge
        if k % 4 == 1:
            corners[:2, 0] += [x, x]  # on a corner
        elif k % 4 == 2:
            corners[0], corners[1] = [0.0, 0.0, height], [0.0, 0.0, 3.0 * height]  # an edge along the axis
        axis = np.array([0.0, 0.0, 1.0])
        if k % 4 == 3:  # the foot, on an edge, is on the border too, and what is behind it is inside
            axis = np.array([0.0, np.sin(0.5 * apertures[k]), np.cos(0.5 * apertures[k])])
        triangles[k], axes[k] = corners @ T.T, T @ axis
    return triangles, axes, apertures


OFFSET = "offset to 1e8 m"
_CONES: dict[str, Callable[[np.random.Generator, int], Cones]] = {
    "any": _generic,
    "plane along the axis": _plane_along_axis,
    "axis meets plane behind apex": _meets_behind_apex,
    "needles 1e-9..1e-2 rad": _needle,
    "nearly a half space": _nearly_half_space,
    "apex 1e-9..1e-3 off surface": _apex_near_surface,
    "small, at the cone's border": _far_and_small,
    "slivers": _slivers,
    "region borders": _region_borders,
    "scale 1e-9..1e6": _scaled,
    OFFSET: _generic,
}


def hard_plates() -> list[dict[str, Any]]:
    """Return questions about a triangle and a plate: family, triangle, half_size, side, truth.

    The values were computed with 60 digits (clipping and closed forms in mpmath) and rounded to 17.
    """
    text = resources.files("replay.bench").joinpath("plate_integrals.json").read_text(encoding="utf-8")
    cases: list[dict[str, Any]] = json.loads(text)["cases"]
    questions = [{**case, "triangle": np.array(case["triangle"]), "truth": float(case["integral"])} for case in cases]
    scaled = []
    for k, question in enumerate(questions):
        scale = 2.0 ** float(SCALES[7 * k % len(SCALES)])
        sizes = {name: scale * np.array(question[name]) for name in ("triangle", "half_size")}
        scaled.append({**question, **sizes, "family": "scale 1e-9..1e6", "truth": scale * question["truth"]})
    return questions + scaled


def hard_boxes(count: int, *, seed: int = 9) -> list[dict[str, Any]]:
    """Return point sets with repeated eigenvalues: family, points, and the volume of the tightest box known."""
    octahedron = np.concatenate([np.identity(3), -np.identity(3)])
    tetrahedron = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]], dtype=float)
    turn = 2.0 * np.pi * np.arange(32) / 32
    circle = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    cylinder = np.concatenate([np.column_stack([circle, np.full(32, z)]) for z in (-0.5, 0.5)])
    shapes = {
        "cube": (box((1.0, 1.0, 1.0)), 1.0),
        "nearly a cube": (box((1.0, 1.0 + 1e-9, 1.0 - 1e-9)), 1.0),
        "square plate": (box((1.0, 1.0, 0.1)), 0.1),
        "octahedron": (octahedron, math.sqrt(2.0) * math.sqrt(2.0) * 2.0),
        "regular tetrahedron": (tetrahedron, 8.0),
        "cylinder": (cylinder, 4.0),
        "cube with a dense corner": (
            np.concatenate([box((1.0, 1.0, 1.0)), 0.5 - 1e-3 * unit(np.random.default_rng(1), 200) ** 2]),
            1.0,
        ),
    }
    rng = np.random.default_rng(seed)
    questions = []
    for family, (points, volume) in shapes.items():
        for T in rotations(rng, count):
            order = rng.permutation(len(points))
            questions.append({"family": family, "points": points[order] @ T[:3, :3].T + T[:3, 3], "volume": volume})
    changed = []
    for k, question in enumerate(questions):
        scale, shift = 2.0 ** float(SCALES[7 * k % len(SCALES)]), 10.0 ** (k % 9) * rng.normal(size=3)
        points, volume = question["points"], question["volume"]
        changed.append({"family": "scale 1e-9..1e6", "points": scale * points, "volume": scale**3 * volume})
        changed.append({"family": OFFSET, "points": points + shift, "volume": volume})
    return questions + changed
