"""The bodies and poses that benchmarks ask about; seeded, so that every run asks the same."""

from __future__ import annotations

import importlib.util
import itertools
import math
from pathlib import Path

import numpy as np

from replay.errors import MissingPackageError
from replay.geometry.mesh import load_mesh
from replay.geometry.primitives import cuboid
from replay.numerics import transforms
from replay.numerics.arrays import Floats

PHANTOM_FILES = {1_000: "adult_male_reduced_1000t.stl", 26_756: "adult_male.stl"}
"""Files of the package pyskindose by their number of triangles; their unit is the centimetre."""


def box(size: tuple[float, float, float]) -> Floats:
    """Return the corners (8, 3) [m] of a box with full edges `size`, about its centre."""
    corners: Floats = np.array(list(itertools.product((-0.5, 0.5), repeat=3))) * np.array(size)
    return corners


def box_surface(size: tuple[float, float, float]) -> Floats:
    """Return the 12 triangles (12, 3, 3) [m] of a box about its centre."""
    return cuboid(size).triangles


def spiral(count: int) -> Floats:
    """Return `count` unit vectors on a spiral that covers the sphere evenly (golden angle)."""
    k = np.arange(count)
    z = 1.0 - (2.0 * k + 1.0) / count
    across, turn = np.sqrt(1.0 - z * z), k * math.pi * (3.0 - math.sqrt(5.0))
    return np.stack([across * np.cos(turn), across * np.sin(turn), z], axis=1)


def ellipsoid(count: int, half_axes: tuple[float, float, float]) -> Floats:
    """Return (count, 3) points of an ellipsoid [m], every one a vertex of their hull."""
    points: Floats = spiral(count) * np.array(half_axes)
    return points


def torus(triangles: int, *, major: float = 0.5, minor: float = 0.2) -> Floats:
    """Return about `triangles` triangles (n, 3, 3) [m] of a torus about z, counter-clockwise seen from outside."""
    across = max(3, round(math.sqrt(triangles / 2.0 * minor / major)))
    around = max(3, round(triangles / (2.0 * across)))
    u, v = np.meshgrid(np.arange(around) / around, np.arange(across) / across, indexing="ij")
    u, v = 2.0 * np.pi * u, 2.0 * np.pi * v
    radius = major + minor * np.cos(v)
    p = np.stack([radius * np.cos(u), radius * np.sin(u), minor * np.sin(v)], axis=-1)
    q, r, s = np.roll(p, -1, 0), np.roll(np.roll(p, -1, 0), -1, 1), np.roll(p, -1, 1)
    return np.concatenate([np.stack([p, q, r], axis=2), np.stack([p, r, s], axis=2)]).reshape(-1, 3, 3)


def slivers(count: int, seed: int = 5) -> Floats:
    """Return triangles (count, 3, 3) [m] in a cloud 0.4 m across, each 10 cm long and 1e-9..1e-2 m wide."""
    rng = np.random.default_rng(seed)
    first = 0.2 * rng.uniform(-1.0, 1.0, (count, 3))
    second = first + 0.1 * unit(rng, count)
    inner = first + rng.uniform(size=(count, 1)) * (second - first)
    return np.stack([first, second, inner + 10.0 ** rng.uniform(-9.0, -2.0, (count, 1)) * unit(rng, count)], axis=1)


def phantom(triangles: int, *, centred: bool = True) -> Floats:
    """Return the human body of pyskindose with so many triangles (n, 3, 3) [m], centred on its box or as in its file.

    Raises:
        MissingPackageError: pyskindose is not installed.
    """
    found = importlib.util.find_spec("pyskindose")
    if found is None or found.origin is None:
        raise MissingPackageError("pyskindose", "the human phantom", "pip install --no-deps pyskindose")
    path = Path(found.origin).parent / "phantom_data" / PHANTOM_FILES[triangles]
    body = load_mesh(path, scale=0.01).triangles
    if not centred:
        return body
    corners = body.reshape(-1, 3)
    return np.ascontiguousarray(body - 0.5 * (corners.min(axis=0) + corners.max(axis=0)))


def unit(rng: np.random.Generator, count: int) -> Floats:
    """Return `count` random unit vectors."""
    vectors = rng.normal(size=(count, 3))
    result: Floats = vectors / np.sqrt(np.sum(vectors**2, axis=1, keepdims=True))
    return result


def rotations(rng: np.random.Generator, count: int) -> Floats:
    """Return `count` uniformly random rotations as transforms (count, 4, 4)."""
    return transforms.from_quaternion(rng.normal(size=(count, 4)))


def aimed(rng: np.random.Generator, points: Floats, normals: Floats, distance: Floats, tilt: float) -> Floats:
    """Return poses (n, 4, 4) `distance` off surface points along their normals, whose z axes look back at them.

    Args:
        rng: of the tilts and the turns about z.
        points, normals: (n, 3) of the surface, normals of unit length.
        distance: (n,) [m].
        tilt: largest angle [rad] between z and the way back to the point.
    """
    count = len(points)
    z = -normals
    aside = np.cross(z, unit(rng, count))
    aside /= np.sqrt(np.sum(aside**2, axis=1, keepdims=True))
    angle = tilt * rng.uniform(size=(count, 1))
    z = np.cos(angle) * z + np.sin(angle) * aside
    x = np.cross(z, unit(rng, count))
    x /= np.sqrt(np.sum(x**2, axis=1, keepdims=True))
    poses = transforms.identity(count)
    poses[:, :3, 0], poses[:, :3, 1], poses[:, :3, 2] = x, np.cross(z, x), z
    poses[:, :3, 3] = points + distance[:, None] * normals
    return poses


def around(triangles: Floats, count: int, *, near: float, far: float, tilt: float, seed: int = 11) -> Floats:
    """Return poses (count, 4, 4) around a body, from `near` to `far` [m] off random places of its surface.

    Poses that rounding or another part of the body puts inside are kept: sensors must answer there too.
    """
    rng = np.random.default_rng(seed)
    chosen = triangles[rng.integers(0, len(triangles), count)]
    weights = rng.dirichlet((1.0, 1.0, 1.0), count)
    points = np.sum(weights[:, :, None] * chosen, axis=1)
    normals = np.cross(chosen[:, 1] - chosen[:, 0], chosen[:, 2] - chosen[:, 0])
    length = np.sqrt(np.sum(normals**2, axis=1, keepdims=True))
    flat = length[:, 0] == 0.0
    normals = np.where(flat[:, None], np.array([0.0, 0.0, 1.0]), normals / np.where(length == 0.0, 1.0, length))
    distance = np.exp(rng.uniform(math.log(near), math.log(far), count))
    return aimed(rng, points, normals, distance, tilt)
