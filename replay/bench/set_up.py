"""What it takes until a scenario with a large mesh can begin, and how that grows with the mesh."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Sequence

import numpy as np

from replay.bench.inputs import torus
from replay.bench.measure import Row, exponent
from replay.bench.report import LogLogPlot, Report
from replay.geometry.primitives import cylinder, sphere
from replay.numerics.arrays import Floats
from replay.numerics.kept import forget
from replay.scenario.load import load_sources
from replay.scenario.scene import build
from replay.simulation import Simulation

TRIANGLES = (10_000, 30_000, 100_000, 300_000, 1_000_000)


def growth(report: Report, *, sizes: Sequence[int] = TRIANGLES, rounds: int) -> None:
    """Add the time to read a mesh, check it and make it ready for collisions and sensors, against its triangles."""
    bodies: dict[str, Callable[[int], Floats]] = {"sphere": _sphere, "cylinder, turned": _cylinder, "torus": torus}
    rows: list[Row] = []
    lines: dict[str, list[tuple[float, float]]] = {}
    for name, make in bodies.items():
        _seconds(make(100))  # loads libraries and kernels
        for size in sizes:
            triangles = make(size)
            taken = [_seconds(triangles) for _ in range(rounds)]
            count, middle = len(triangles), statistics.median(taken)
            case = f"{name}, {count} triangles"
            rows.append(Row(case, "set-up", middle, min(taken), max(taken), rounds, 0.0, 0, 1, failed=False))
            lines.setdefault(name, []).append((float(count), middle))
    title = "the set-up of a scenario against its mesh"
    report.tables[title] = rows
    named = {f"{name}, n^{exponent(points):.2f}": points for name, points in lines.items()}
    report.plots.append(LogLogPlot(title, "triangles", "s", named, joined=True))
    for name, points in lines.items():
        report.notes.append(
            f"{name}: {title} grows like n^{exponent(points):.2f} from {points[0][0]:g} to {points[-1][0]:g} triangles."
        )


def _seconds(triangles: Floats) -> float:
    scenario = load_sources("mesh.yaml", {"mesh.yaml": _SCENARIO, "body.stl": stl(triangles)})
    forget()
    begin = time.perf_counter()
    Simulation(build(scenario))
    return time.perf_counter() - begin


def stl(triangles: Floats) -> bytes:
    """Return triangles (n, 3, 3) as a binary STL file, which keeps single precision."""
    facets = np.zeros(len(triangles), dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    facets["corners"] = triangles
    return b"\0" * 80 + np.uint32(len(triangles)).tobytes() + facets.tobytes()


def _sphere(count: int) -> Floats:
    """Return a sphere of about so many triangles: of chord error e it has 5.8 / e of them."""
    return sphere(1.0, 5.8 / count).triangles


def _cylinder(count: int) -> Floats:
    """Return a cylinder in no special direction: a quarter of its triangles in each flat face."""
    turn = np.linalg.qr(np.random.default_rng(2).normal(size=(3, 3)))[0]
    return np.asarray(cylinder(1.0, 2.0, 79.0 / count**2).triangles @ turn)


_SCENARIO = b"""
version: 1
name: mesh
rate: 60 Hz
duration: 1 s
links:
  wall: {shapes: {slab: {type: cuboid, size: [0.1, 1, 1], pose: {xyz: [4, 0, 0]}}}}
  body:
    joint: {name: slide, type: prismatic, axis: [1, 0, 0], lower: 0, upper: 1, velocity: 9, acceleration: 99}
    shapes: {mesh: {type: mesh, file: body.stl, scale: 1}}
motion: {points: {slide: [{time: 0, position: 0}, {time: 1, position: 0.5}]}}
sensors:
  distance: {eye: {link: wall, pose: {xyz: [3.5, 0, 0], rpy: [0, -90 deg, 0]}, aperture: 30 deg}}
"""
