"""Electrostatics over motions: frames that are solved, errors beside `bem`, and how the cost of a pose grows.

Before two plates, a floating box approaches, slides past and tilts. Which frames are solved is the method's choice
(keys); between them are splines. Times are those of the same motion a millimetre beside, so that no pose was asked
before.
"""

from __future__ import annotations

import math
import statistics
import time
from typing import Any

import numpy as np

from replay.bench.goals import Goal
from replay.bench.inputs import box_surface
from replay.bench.measure import Row, absent
from replay.bench.report import Grid, Report
from replay.bench.runner import Runner
from replay.bench.scaling import Points, law
from replay.bench.shipped import shipped
from replay.geometry.primitives import plane, sphere
from replay.kinematics.linkage import Joint, JointType, Link, Linkage, LinkPoses
from replay.numerics import transforms
from replay.numerics.arrays import Floats
from replay.scenario.methods import Model
from replay.sensing.capacitive import CapacitiveSensor, CapacitiveSuite
from replay.sensing.capacitive.part import CapacitiveMethod
from replay.sensing.capacitive.sensor import Plate
from replay.sensing.electrostatics.body import ConductorBody
from replay.sensing.electrostatics.field import FieldSolver
from replay.sensing.electrostatics.placement import PosedBodies
from replay.sensing.electrostatics.suite import PANELS, ElectrostaticSuite
from replay.sensing.electrostatics.unit import Electrode, Unit
from replay.sensing.target import make_target

SCENE = "carm_bodyguard"
"""Six sensors of three plates around a housing, and a phantom: the scene whose pace is promised."""

ACCURACIES = (0.03, 0.01, 0.1)
MOVING, KEYS, PACE = "a frame of a motion, beside bem", "frames that are solved, of 256", "frames a second"

_FRAMES = 256
_MANY, _POSES = 400, 4


def link_poses(T: Floats) -> LinkPoses:
    """Return the poses of free links that stand in the world as T (frames, links, 4, 4) says."""
    names = [str(k) for k in range(T.shape[1])]
    linkage = Linkage([Link(name, None, np.identity(4), Joint(name, JointType.FREE)) for name in names])
    return linkage.forward(np.zeros((len(T), 0)), np.ascontiguousarray(T))


def motions(frames: int) -> dict[str, Floats]:
    """Return poses (frames, 2, 4, 4) of the unit, which stands still, and of a box, by the name of the motion."""
    s = np.linspace(0.0, 1.0, frames)
    smooth = s * s * (3.0 - 2.0 * s)
    still = {name: np.tile(np.identity(4), (frames, 2, 1, 1)) for name in ("approach", "sliding past", "tilting")}
    still["approach"][:, 1, 2, 3] = 0.02 + 5e-3 + 0.25 * (1.0 - smooth)
    still["sliding past"][:, 1, 0, 3] = 0.6 * (smooth - 0.5)
    still["sliding past"][:, 1, 2, 3] = 0.02 + 0.025
    turned = transforms.from_axis_angle(np.array([0.0, 1.0, 0.0]), np.radians(120.0) * (smooth - 0.5))
    still["tilting"][:, 1] = turned
    still["tilting"][:, 1, 2, 3] = 0.08
    return still


def judge(report: Report, *, frames: int, count: int) -> None:
    """Add what each method says of the first `count` motions, of which `bem` solves `frames` frames evenly."""
    sensors = [_sensor("left", -0.04), _sensor("right", 0.04)]
    target = make_target("body/box", 1, box_surface((0.08, 0.12, 0.04)), earth=0.0)
    judged = np.linspace(0, _FRAMES - 1, frames).round().astype(int)
    rows: list[Row] = []
    lines = []
    worst = 0.0
    for name, T in list(motions(_FRAMES).items())[:count]:
        truth = _of(ElectrostaticSuite(sensors, [target], method="bem", savings=False), T[judged])[0]
        beside = T.copy()
        beside[:, 1, 1, 3] += 1e-3
        keys: dict[str, int] = {}
        for accuracy in ACCURACIES:
            suite = ElectrostaticSuite(sensors, [target], accuracy=accuracy)
            found, _ = _of(suite, T)
            method, solved = f"field, accuracy {100 * accuracy:g} %", suite.solved
            row = _row(name, method, _of(suite, beside)[1], found[judged], truth)
            rows.append(row)
            keys[method] = solved
            worst = max(worst, row.worst_error) if accuracy == ACCURACIES[0] else worst
        for method, kind in (("tree rtol 1e-06", "tree"), ("midpoint n=4", "midpoint")):
            model = CapacitiveSuite(sensors, [target], method=kind)
            found, _ = _of(model, T)
            factor = float(np.median(truth / found[judged]))
            rows.append(_row(name, method, _of(model, beside)[1], factor * found[judged], truth))
        lines.append({"motion": name, **keys})
    report.tables[MOVING] = rows
    report.grids[KEYS] = Grid(lines)
    report.goals.append(Goal("field.motions", worst))


def _of(suite: Any, T: Floats) -> tuple[Floats, float]:
    """Return what a suite says that bodies add (frames, sensors) [F], and how long a frame takes [s]."""
    poses = link_poses(T)
    begin = time.perf_counter()
    columns = suite.run(poses)
    taken = (time.perf_counter() - begin) / len(T)
    return columns.capacitance if columns.increase is None else columns.increase, taken


def _row(case: str, method: str, seconds: float, found: Floats, truth: Floats) -> Row:
    """Return errors of readings that are a tenth of the frame's largest or more."""
    error = np.abs(found / truth - 1.0)[truth > 0.1 * truth.max(axis=1, keepdims=True)]
    return Row(
        case=case,
        method=method,
        median=seconds,
        low=seconds,
        high=seconds,
        rounds=1,
        worst_error=float(error.max()),
        wrong=0,
        queries=len(error),
        failed=bool(np.isnan(error).any()),
        mean_error=float(error.mean()),
    )


def _sensor(name: str, x: float) -> CapacitiveSensor:
    pose = np.identity(4)
    pose[0, 3] = x
    plate = Plate("plate", pose, np.array([0.025, 0.06]))
    return CapacitiveSensor(name, 0, (plate,), 1e-11)


def growth(report: Report, *, sizes: int) -> None:
    """Add the time of a pose of `field` against unknowns, bodies and plates, the first so many sizes of each."""
    lines: Points = {}
    rows: list[Row] = []
    asked = [("unknowns", size, size, 1, 2) for size in (100, 200, 400, 800)[:sizes]]
    asked += [("bodies", size, _MANY, size, 2) for size in (1, 2, 4, 8)[:sizes]]
    asked += [("plates", size, _MANY, 1, size) for size in (1, 3, 10, 30)[:sizes]]
    for name, size, unknowns, bodies, plates in asked:
        taken = _poses(unknowns, bodies, plates)
        middle = statistics.median(taken)
        case = f"{unknowns} unknowns, {bodies} bodies, {plates} plates"
        rows.append(Row(case, name, middle, min(taken), max(taken), len(taken), 0.0, 0, 1, failed=False))
        lines.setdefault(name, []).append((float(size), middle))
    law(report, "a pose of field", "unknowns, bodies, plates", "s per pose", lines, rows)


def _poses(unknowns: int, bodies: int, plates: int) -> list[float]:
    """Return how long new poses take [s] of balls that stand around a square of plates."""
    side = math.ceil(math.sqrt(plates))
    places = np.array([[0.05 * (k % side), 0.05 * (k // side), 0.0] for k in range(plates)])
    electrodes = [Electrode(str(k), (plane((0.04, 0.04)).triangles + place,)) for k, place in enumerate(places)]
    ball = sphere(0.03, 1e-3).triangles + places.mean(axis=0)
    several = [ConductorBody(str(k), (ball + np.array([0.08 * k, 0.0, 0.06]),)) for k in range(bodies)]
    solver = FieldSolver(Unit(electrodes, most_panels=PANELS["field"]), several, behind=False)
    taken = []
    for k in range(1 + _POSES):
        pose = np.identity(4)
        pose[1, 3] = 2e-3 * k
        placement = PosedBodies(several, [pose] * bodies, np.arange(bodies), 0.03)
        begin = time.perf_counter()
        solver.solve(placement, unknowns)
        taken.append(time.perf_counter() - begin)
    return taken[1:]


def pace(report: Report, name: str) -> None:
    """Add how many frames a shipped scenario has with `field` in a second of processor time, recording excluded."""
    scenario = shipped(name)
    if isinstance(scenario, str):
        report.tables[PACE] = [absent(name, "field", scenario)]
        report.goals.append(Goal("field.pace", math.nan))
        return
    runner = Runner(scenario, Model(capacitive=CapacitiveMethod(method="field")))
    simulation: Any = runner.simulation
    begin = time.process_time()
    simulation.capacitive.run(runner.poses([0]))
    ready = time.process_time()
    frames = sum(len(block.time) for block in simulation.blocks())
    taken = time.process_time() - ready
    report.grids[PACE] = Grid(
        [
            {
                "scenario": name,
                "frames": frames,
                "solved": simulation.capacitive.solved,
                "units, bodies and the first frame [s]": f"{ready - begin:.2f}",
                "frames a second": f"{frames / taken:.0f}",
            }
        ]
    )
    report.goals.append(Goal("field.pace", frames / taken))
