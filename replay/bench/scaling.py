"""How cost grows: with frames, bodies, triangles, sensors and workers; each law with its fitted exponent."""

from __future__ import annotations

import math
import os
import tempfile
import time
from collections.abc import Callable, Sequence
from fractions import Fraction
from functools import partial
from typing import Any

import numpy as np

from replay.batch.run import Execution, run_all
from replay.bench import broad_phase, set_up
from replay.bench.inputs import around, torus
from replay.bench.measure import Check, Contender, Row, absent, compete, exponent
from replay.bench.pipeline import FAST, MODELS, scenario
from replay.bench.report import Grid, LogLogPlot, Report
from replay.errors import ScenarioError
from replay.kinematics.linkage import Joint, JointType, Link, Linkage, LinkPoses
from replay.numerics import transforms
from replay.numerics.arrays import Floats
from replay.scenario.load import load_sources
from replay.scenario.model import Scenario
from replay.scenario.scene import build
from replay.sensing.capacitive import CapacitiveSensor, CapacitiveSuite
from replay.sensing.capacitive.sensor import Plate
from replay.sensing.distance import DistanceSensor, DistanceSuite
from replay.sensing.target import Target, make_target
from replay.simulation import Simulation, simulate

Points = dict[str, list[tuple[float, float]]]

FRAMES = (64, 256, 1024, 4096)
TRIANGLES = (100, 1_000, 10_000, 100_000, 1_000_000)
SENSORS = (1, 3, 10, 30, 100)
BODY = 10_000
"""Triangles of the body that a growing number of sensors looks at."""
LEAST_EXACT = 100_000
"""[triangles] Above, the sum over all triangles is not timed: it is proportional to their number."""


def run(*, quick: bool = False, rounds: int | None = None, scene: Scenario | None = None, cases: int = 4) -> Report:
    """Run the benchmark.

    Args:
        quick: smaller largest sizes; about ten seconds.
        rounds: times that everything is timed; 3, or 1 when quick, if None.
        scene: whose frames are counted, instead of the pipeline's.
        cases: scenarios that 1 and 2 workers share.
    """
    report = Report("scaling")
    rounds = rounds or (1 if quick else 3)
    try:
        _frames(report, scene or scenario(), FRAMES[: 2 if quick else None], rounds)
    except ScenarioError as error:
        report.tables["frames"] = [absent("frames", FAST, str(error))]
    broad_phase.growth(report, most=1000 if quick else 10_000, rounds=rounds)
    set_up.growth(report, sizes=set_up.TRIANGLES[: 2 if quick else None], rounds=rounds)
    _triangles(report, TRIANGLES[: 3 if quick else None], rounds)
    _sensors(report, SENSORS[: 3 if quick else None], rounds)
    report.grids["workers: scenarios of equal length, process start included"] = workers(
        cases, 500 if quick else 12_000
    )
    return report


def _frames(report: Report, chosen: Scenario, sizes: Sequence[int], rounds: int) -> None:
    """Add the time of a whole run against its frames: the same motion at higher rates."""
    rows = []
    for count in sizes:
        rate = Fraction(count - 1) / Fraction(chosen.duration)
        finer = chosen.model_copy(update={"rate": rate})
        finer._provenance = chosen.provenance
        simulation = Simulation(build(finer, model=MODELS[FAST]))
        contender = Contender(FAST, partial(_all, simulation), 1, lambda _: Check(0.0))
        rows += compete(f"{count} frames", [contender], rounds=rounds)
    law(report, "a run against its frames", "frames", "s per run", {FAST: _points(sizes, rows)}, rows)


def _all(simulation: Simulation) -> None:
    for _ in simulation.blocks():
        pass


def _triangles(report: Report, sizes: Sequence[int], rounds: int) -> None:
    """Add the time of a reading against the body's triangles."""
    rows: list[Row] = []
    lines: Points = {}
    for size in sizes:
        target = make_target("link/body", 1, torus(size))
        count = len(target.triangles)
        several = [
            ("distance sensor, exact", _cones(target, 100), 100, _seen),
            ("plate, tree rtol 1e-4", _plates(target, 20, method="tree", rtol=1e-4), 20, _felt),
            ("plate, tree rtol 1e-6", _plates(target, 20, method="tree", rtol=1e-6), 20, _felt),
        ]
        if count <= LEAST_EXACT:
            several.append(("plate, every triangle", _plates(target, 2, method="exact"), 2, _felt))
        contenders = [Contender(*one) for one in several]
        for row in compete(f"{count} triangles", contenders, rounds=rounds):
            rows.append(row)
            lines.setdefault(row.method, []).append((float(count), row.median))
    law(report, "a reading against the body's triangles", "triangles", "s per reading", lines, rows)


def _sensors(report: Report, sizes: Sequence[int], rounds: int) -> None:
    """Add the time of a frame against the number of sensors."""
    target = make_target("link/body", 1, torus(BODY))
    rows: list[Row] = []
    lines: Points = {}
    for count in sizes:
        contenders = [
            Contender("distance sensors", _cones(target, 32, sensors=count), 32, _seen),
            Contender("plates, tree rtol 1e-4", _plates(target, 4, sensors=count, method="tree", rtol=1e-4), 4, _felt),
        ]
        for row in compete(f"{count} sensors", contenders, rounds=rounds):
            rows.append(row)
            lines.setdefault(row.method, []).append((float(count), row.median))
    law(report, f"a frame against its sensors, {BODY} triangles", "sensors", "s per frame", lines, rows)


def _cones(target: Target, frames: int, *, sensors: int | None = None) -> Callable[[], Floats]:
    """Return what reads cones at a body, (frames, sensors); one that is carried around it if no number is given."""
    several = [
        DistanceSensor(f"s{k}", 0, T_link_sensor, math.radians(30.0))
        for k, T_link_sensor in enumerate(around(target.triangles, sensors or 1, near=0.1, far=0.1, tilt=0.2, seed=5))
    ]
    suite, poses = DistanceSuite(several, [target]), _moving(target, frames, sensors is None)
    return lambda: suite.run(poses).distance


def _plates(target: Target, frames: int, *, sensors: int | None = None, **method: Any) -> Callable[[], Floats]:
    """Return what reads plates of 5 cm x 20 cm at a body; see `_cones`."""
    half = np.array([0.025, 0.1])
    several = [
        CapacitiveSensor(f"s{k}", 0, (Plate("p", T_link_plate, half),), 1e-11)
        for k, T_link_plate in enumerate(around(target.triangles, sensors or 1, near=0.1, far=0.1, tilt=0.2, seed=5))
    ]
    suite, poses = CapacitiveSuite(several, [target], **method), _moving(target, frames, sensors is None)
    return lambda: suite.run(poses).capacitance


def _moving(target: Target, frames: int, carried: bool) -> LinkPoses:
    """Return poses of two free links, sensors and body: they are carried around it, or creep along."""
    linkage = Linkage([Link(name, None, np.identity(4), Joint(name, JointType.FREE)) for name in ("a", "b")])
    free = np.broadcast_to(np.identity(4), (frames, 2, 4, 4)).copy()
    if carried:
        first = around(target.triangles, 1, near=0.1, far=0.1, tilt=0.2, seed=5)[0]
        places = around(target.triangles, frames, near=0.03, far=1.5, tilt=0.2)
        free[:, 0] = transforms.compose(places, transforms.invert(first))
    else:
        free[:, 0, 0, 3] = 1e-4 * np.arange(frames)
    return linkage.forward(np.zeros((frames, 0)), free)


def _seen(found: Floats) -> Check:
    """Cones that look at a body must see something, though each may look past it at times."""
    return Check(0.0, int(np.isnan(found).all()) + int(np.sum(found < 0.0)))


def _felt(found: Floats) -> Check:
    return Check(0.0, int(np.sum(~(found > 0.0))))


def workers(cases: int, frames: int, *, counts: Sequence[int] = (1, 2)) -> Grid:
    """Return the time of equally long scenarios by some numbers of processes, once the kernels are compiled."""
    names = [f"case{k}" for k in range(cases)]
    rate = (frames - 1) / 4.0
    several = [load_sources(f"{n}.yaml", {f"{n}.yaml": _CASE.format(name=n, rate=rate).encode()}) for n in names]
    for _ in simulate(several[0]):  # workers find the kernels compiled
        pass
    seconds = {}
    for count in counts:
        with tempfile.TemporaryDirectory() as folder:
            begin = time.perf_counter()
            done = run_all(several, folder, rrd=False, execution=Execution(workers=count))
            seconds[count] = time.perf_counter() - begin
        if not done.passed:
            return Grid([{"workers": count, "seconds": "WRONG: a scenario failed"}])
    return Grid(
        [
            {
                "workers": count,
                "cores": os.cpu_count(),
                "scenarios": cases,
                "frames each": frames,
                "seconds": f"{taken:.2f}",
                "times faster": f"{seconds[counts[0]] / taken:.2f}",
            }
            for count, taken in seconds.items()
        ]
    )


_CASE = """
version: 1
name: {name}
rate: {rate} Hz
duration: 4 s
links:
  wall: {{shapes: {{slab: {{type: sphere, radius: 1, pose: {{xyz: [2, 0, 0]}}}}}}}}
  stand: {{}}
  arm:
    parent: stand
    joint: {{name: swing, type: revolute, axis: [0, 1, 0], lower: -3, upper: 3, velocity: 9, acceleration: 99}}
    shapes: {{rod: {{type: cuboid, size: [0.1, 0.1, 1.8], pose: {{xyz: [0, 0, 0.9]}}}}}}
motion: {{points: {{swing: [{{time: 0, position: 0}}, {{time: 4, position: 2}}]}}}}
sensors:
  distance: {{tip: {{link: arm, pose: {{xyz: [0, 0, 1], rpy: [0, 90 deg, 0]}}, aperture: 30 deg, range: 5}}}}
  capacitive: {{pad: {{link: arm, plates: {{p: {{pose: {{xyz: [0, 0, 1.9]}}, size: [0.1, 0.1]}}}}, coupling: 10 pF}}}}
"""


def _points(sizes: Sequence[int], rows: Sequence[Row]) -> list[tuple[float, float]]:
    return [(float(size), row.median) for size, row in zip(sizes, rows, strict=True)]


def law(report: Report, title: str, x: str, y: str, lines: Points, rows: list[Row]) -> None:
    """Add table, plot and the fitted exponent of each line, over all sizes and over the larger half."""
    report.tables[title] = rows
    named = {f"{name}, n^{exponent(points):.2f}": points for name, points in lines.items()}
    report.plots.append(LogLogPlot(title, x, y, named, joined=True))
    for name, points in lines.items():
        half = min(len(points) // 2, len(points) - 2)
        large = exponent(points[half:])
        law = f"{name}: {title} grows like n^{exponent(points):.2f}"
        report.notes.append(f"{law}, from {points[half][0]:g} {x} on like n^{large:.2f}.")
