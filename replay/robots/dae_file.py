"""COLLADA files as triangles in metres with z up, read by pycollada.

A file says how long its unit is and which axis points up (`asset`); its scene places geometries by nodes within nodes.
All of that is applied. What COLLADA is: Khronos, COLLADA 1.4.1, sections 5 (asset, node) and 4 (up_axis).
"""

from __future__ import annotations

import io
import re
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from replay import limits
from replay.errors import MissingPackageError, RobotError
from replay.numerics.arrays import Floats
from replay.robots.dae_text import asset, check_primitive, corners_of
from replay.robots.xml_text import check

_INSTALL = "get it with: pip install 'replay-mechanics[robots]'"
_UP = {
    "X_UP": ((0.0, -1.0, 0.0), (0.0, 0.0, -1.0), (1.0, 0.0, 0.0)),
    "Y_UP": ((1.0, 0.0, 0.0), (0.0, 0.0, -1.0), (0.0, 1.0, 0.0)),
    "Z_UP": ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)),
}
"""Rotations of a file's axes to x, y, z with z up, as the standard converts them."""


@dataclass(frozen=True, eq=False)
class Collada:
    """What a file holds.

    Attributes:
        triangles: (n, 3, 3) [m], z up.
        unit: metres per unit of the file.
        up: X_UP, Y_UP or Z_UP, as the file says.
    """

    triangles: Floats
    unit: float
    up: str


def read(path: Path, data: bytes, *, turned: bool = True) -> Collada:
    """Return the triangles of a COLLADA file, each geometry in all places where its scene has it.

    Args:
        path: of the file, for errors.
        data: its bytes.
        turned: whether what the file says is up becomes z; else its axes stay x, y, z, as RViz reads it.

    Raises:
        MissingPackageError: pycollada is not installed.
        RobotError: it is no such file, not whole, has a document type, or holds more than is read.

    Accuracy: single precision, in which pycollada keeps corners and matrices (tests/robots/test_dae_file.py).
    """
    check(path, data)
    try:
        import collada
        from collada.common import DaeBrokenRefError, DaeUnsupportedError
    except ImportError:
        raise MissingPackageError("pycollada", f"{path}: a COLLADA mesh", _INSTALL) from None
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            ignored = [DaeUnsupportedError, DaeBrokenRefError]
            data = re.sub(rb"(</?)convex_mesh\b", rb"\1mesh", data)  # pycollada passes over it; it holds the same
            file = collada.Collada(io.BytesIO(data), ignore=ignored)
            unit, up = asset(file.xmlnode.getroot())
            parts = list(_parts(file, path))
    except RobotError:
        raise
    except Exception as error:  # a foreign parser on a foreign file may raise anything
        reason = " ".join(str(error).split())[:200] or type(error).__name__
        raise RobotError(str(path), f"is not a usable COLLADA file: {reason}") from None
    if not parts:
        raise RobotError(str(path), "holds no triangles in its scene")
    if not 1e-9 <= unit <= 1e9:
        raise RobotError(str(path), f"has a unit of {unit:g} m, which cannot be used")
    triangles = np.concatenate(parts)
    if not np.isfinite(triangles).all():
        raise RobotError(str(path), "has corners that are not finite")
    upright: Floats = np.stack(
        [
            sum(factor * triangles[..., k] for k, factor in enumerate(row) if factor)
            for row in _UP[up if turned else "Z_UP"]
        ],
        -1,
    )
    return Collada(unit * upright, unit, up)


def _parts(file: Any, path: Path) -> Iterator[Floats]:
    """Yield the triangles of each geometry in each of its places, in the file's unit and axes."""
    count = visits = 0
    if file.scene is None:
        reasons = "; ".join(" ".join(str(error).split())[:200] for error in file.errors[-2:])
        raise RobotError(str(path), f"has no scene that can be used{': ' * bool(reasons)}{reasons}")
    if len(file.scene.nodes) != sum(str(element.tag).endswith("}node") for element in file.scene.xmlnode):
        raise ValueError("its scene has a <node> that cannot be used")
    waiting = [(node, np.eye(4), 0) for node in reversed(file.scene.nodes)]
    while waiting:
        node, pose, depth = waiting.pop()
        visits += 1
        if visits > limits.GLB_ENTRIES or depth > limits.ROBOT_DEPTH:
            most = f"{limits.GLB_ENTRIES} nodes, {limits.ROBOT_DEPTH} deep"
            raise RobotError(str(path), f"has a scene of more than the {most}, that are read")
        kind = type(node).__name__
        if kind == "NodeNode":
            waiting.append((node.node, pose, depth + 1))
        elif kind == "Node":
            below = _product(pose, np.asarray(node.matrix, dtype=np.float64))
            for geometry in _geometries(node, file):
                for corners in map(_corners, geometry.primitives):
                    count += len(corners)
                    if count > limits.TRIANGLES:
                        raise RobotError(str(path), f"has more than the {limits.TRIANGLES} triangles that are read")
                    if len(corners):
                        yield _placed(below, corners)
            waiting.extend((child, below, depth + 1) for child in reversed(node.children))


def _geometries(node: Any, file: Any) -> list[Any]:
    """Return the geometries that a node has, by its XML: pycollada drops those whose colours it cannot find.

    Raises:
        ValueError: it has something, which pycollada has dropped, that shows a body or moves one.
    """
    tags = [str(element.tag).rpartition("}")[2] for element in node.xmlnode]
    for tag in ("instance_controller", "skew"):
        if tag in tags:
            raise ValueError(f"a node has <{tag}>, which is not read")
    kinds = [type(child).__name__ for child in node.children]
    for tag, kind in (("instance_node", "NodeNode"), ("node", "Node")):
        if tags.count(tag) != kinds.count(kind):
            raise ValueError(f"a node has a <{tag}> that cannot be used")
    found = []
    for element, tag in zip(node.xmlnode, tags, strict=True):
        if tag == "instance_geometry":
            name = element.get("url", "").removeprefix("#")
            if name not in file.geometries:
                raise ValueError(f"a node has the geometry {name[:60]!r}, which is not there or cannot be used")
            if any(mesh.get("convex_hull_of") for mesh in file.geometries[name].xmlnode):
                raise ValueError(f"the geometry {name[:60]!r} is the hull of another, which is not read")
            found.append(file.geometries[name])
    return found


def _corners(primitive: Any) -> Floats:
    """Return the triangles (n, 3, 3) of a set of triangles or polygons; none of lines."""
    if hasattr(primitive, "vertex_index"):
        check_primitive(primitive)
    if hasattr(primitive, "triangleset"):
        primitive = primitive.triangleset()
    if type(primitive).__name__ != "TriangleSet" or not len(primitive):
        return np.zeros((0, 3, 3))
    vertices = corners_of(primitive)
    index = np.asarray(primitive.vertex_index, dtype=np.int64).reshape(-1, 3)
    if len(index) and not 0 <= index.min() <= index.max() < len(vertices):
        wrong = index.min() if index.min() < 0 else index.max()
        raise ValueError(f"a triangle refers to vertex {wrong} of {len(vertices)}")
    return vertices[index]


def _product(a: Floats, b: Floats) -> Floats:
    return np.array([[sum(a[i, k] * b[k, j] for k in range(4)) for j in range(4)] for i in range(4)])


def _placed(pose: Floats, triangles: Floats) -> Floats:
    moved = [sum(pose[r, c] * triangles[..., c] for c in range(3)) + pose[r, 3] for r in range(3)]
    result: Floats = np.stack(moved, axis=-1)
    mirrored = float(np.linalg.det(pose[:3, :3])) < 0.0
    return result[:, [0, 2, 1]] if mirrored else result
