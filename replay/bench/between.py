"""Between the frames: what is proven, at what cost, and whether times of contacts are right, ours and python-fcl's.

Shipped scenes are run at their own rate and at 1 kHz, with and without a look between the frames; the frames must read
the same. Boxes that fly through plates and rods that turn into ceilings have contacts of known times.
"""

from __future__ import annotations

import math
import time
from fractions import Fraction
from typing import Any

import numpy as np

from replay.bench.goals import Goal
from replay.bench.report import Grid, Report
from replay.bench.shipped import FOLDER, shipped
from replay.collision.columns import Between, CollisionColumns, Level
from replay.collision.pairs import CollisionBody, plan_pairs
from replay.collision.pipeline import CollisionPipeline
from replay.geometry.primitives import cuboid
from replay.geometry.solid import Solid
from replay.kinematics.linkage import Joint, JointType, Link, Linkage, LinkPoses
from replay.kinematics.motion import Motion, Script, plan
from replay.kinematics.profiles import Waypoint
from replay.numerics import transforms
from replay.numerics.arrays import Integers
from replay.numerics.constants import SECOND
from replay.scenario.model import Scenario
from replay.scenario.scene import build
from replay.simulation import BLOCK_FRAMES, collision_pipeline

SCENES, TIMES, PEERS = "shipped scenes", "times of contacts", "python-fcl, continuous collision of boxes through plates"

FAST = 1000
"""[Hz] the rate at which motion budgets pay."""

RIGHT = 1e-3
"""A time of contact that is off by more than this part of the interval is wrong."""

_FCL_MOTIONS = ("CCDM_TRANS", "CCDM_LINEAR", "CCDM_SCREW", "CCDM_SPLINE")
_FCL_SOLVERS = ("CCDC_NAIVE", "CCDC_CONSERVATIVE_ADVANCEMENT")


def run(*, quick: bool = False) -> Report:
    """Run the benchmark.

    Args:
        quick: fewer frames and contacts; some ten seconds.
    """
    report = Report("between")
    _scenes(report, blocks=1 if quick else 8, rounds=2 if quick else 30)
    report.grids[TIMES] = _times(report, 20 if quick else 500)
    report.grids[PEERS] = _peers(20 if quick else 200)
    return report


def _scenes(report: Report, *, blocks: int, rounds: int) -> None:
    lines, intervals, proven, ratios = [], 0, 0, {"own": math.nan, "fast": math.nan}
    names = sorted(path.stem for path in FOLDER.glob("*.yaml") if path.name != "rules.yaml")
    for name in names:
        scenario = shipped(name)
        if isinstance(scenario, str):
            report.notes.append(f"{name}: {scenario}")
            continue
        for key, rate in (("own", scenario.rate), ("fast", Fraction(FAST))):
            line, asked, told, ratio = _scene(name, scenario, rate, blocks, rounds)
            lines.append(line)
            intervals, proven = intervals + asked, proven + told
            ratios[key] = min(ratio, ratios[key]) if ratios[key] == ratios[key] else ratio
    if lines:
        report.grids[SCENES] = Grid(lines)
    report.goals.append(Goal("between.proven", proven / intervals if intervals else math.nan))
    report.goals += [Goal("between.own", ratios["own"]), Goal("between.fast", ratios["fast"])]


def _scene(
    name: str, scenario: Scenario, rate: Fraction, blocks: int, rounds: int
) -> tuple[dict[str, str], int, int, float]:
    """Return a line on a scene, its pair-intervals, those of them that are proven or found, and how much faster."""
    scene = build(scenario.model_copy(update={"rate": rate}))
    motion = plan(scene.linkage, scene.script)
    engines = {True: collision_pipeline(scene, motion), False: collision_pipeline(scene, None)}
    seconds = dict.fromkeys(engines, math.inf)
    for turn in range(rounds):
        spent, counts, frames = dict.fromkeys(engines, 0.0), np.zeros(len(Between), dtype=np.int64), 0
        for first in range(0, min(scene.frames, blocks * BLOCK_FRAMES), BLOCK_FRAMES):
            lead = min(first, 1)
            ns = scene.time_ns(first - lead, min(first + BLOCK_FRAMES, scene.frames))
            poses = _poses(scene.linkage, motion, ns)
            columns = {}
            for looks in (True, False) if turn % 2 else (False, True):  # the second finds the poses in the cache
                engine = engines[looks]
                shown = poses if looks else poses.slice(lead, len(ns))
                begin = time.process_time()
                columns[looks] = engine.run(shown, lead=lead, time=ns, first=first) if looks else engine.run(shown)
                spent[looks] += time.process_time() - begin
            _check_frames(columns[True], columns[False])
            counts += np.bincount(columns[True].between.ravel(), minlength=len(Between))  # type: ignore[union-attr]
            frames += len(columns[True].level)
        seconds = {looks: min(seconds[looks], spent[looks]) for looks in engines}
    asked, unknown = int(counts[:3].sum()), int(counts[Between.UNDECIDED])
    proven, sampled = engines[True].counters, engines[False].counters
    ratio = seconds[False] / max(seconds[True], 1e-9)
    line = {
        "scene": name,
        "rate [Hz]": f"{float(rate):g}",
        "pair-intervals": str(asked),
        "clear": str(int(counts[Between.CLEAR])),
        "contact": str(int(counts[Between.CONTACT])),
        "undecided": str(unknown),
        "searched": str(proven.intervals_searched // rounds),
        "narrow phase, sampled": str(sampled.narrow // rounds),
        "proven": str(proven.narrow // rounds),
        "queries between": str(proven.moment_queries // rounds),
        "sampled [us/frame]": f"{1e6 * seconds[False] / frames:.3g}",
        "proven [us/frame]": f"{1e6 * seconds[True] / frames:.3g}",
        "faster": f"{ratio:.3g} x",
    }
    return line, asked, asked - unknown, ratio


def _poses(linkage: Linkage, motion: Motion, ns: Integers) -> LinkPoses:
    states = motion.states(ns / SECOND)
    return linkage.forward(states.positions, states.free_poses)


def _check_frames(proven: CollisionColumns, sampled: CollisionColumns) -> None:
    for name in ("level", "clearance", "evaluated", "undecided"):
        assert np.array_equal(getattr(proven, name), getattr(sampled, name), equal_nan=name == "clearance"), name


def _times(report: Report, count: int) -> Grid:
    """Return how the brackets of contacts hold their times, for boxes through plates and rods into ceilings."""
    lines, wrong = [], 0
    for name, make in (("box through plate", _tunnel), ("rod into ceiling", _rod)):
        rng = np.random.default_rng([18, len(name)])
        held, missed, widths, spent = 0, 0, [], 0.0
        for _ in range(count):
            links, solids, script, interval, truth = make(rng)
            linkage = Linkage(links)
            motion = plan(linkage, script)
            bodies = [CollisionBody(f"{key}/s", linkage.link_index(key), solid) for key, solid in solids.items()]
            engine = CollisionPipeline(bodies, plan_pairs(bodies, linkage), linkage, motion=motion)
            ns = np.array([0, interval], dtype=np.int64)
            poses = _poses(linkage, motion, ns)
            begin = time.process_time()
            crossings = engine.run(poses, time=ns).crossings
            spent += time.process_time() - begin
            mine = np.flatnonzero((crossings.level == Level.CONTACT) & crossings.begins)
            if len(mine) == 0:
                missed += 1
                continue
            earliest, latest = int(crossings.earliest[mine[0]]), int(crossings.latest[mine[0]])
            held += earliest - 1 <= truth * SECOND <= latest + 1
            widths.append(latest - earliest)
        wrong += count - held
        lines.append(
            {
                "contact": name,
                "asked": str(count),
                "time within the bracket": str(held),
                "missed": str(missed),
                "longest bracket [us]": f"{max(widths, default=0) / 1e3:.3g}",
                "us a question": f"{1e6 * spent / count:.3g}",
            }
        )
    report.goals.append(Goal("between.wrong", float(wrong)))
    return Grid(lines)


Question = tuple[list[Link], dict[str, Solid], Script, int, float]


def _flight(rng: np.random.Generator) -> tuple[float, float, float, float, float]:
    """Return the sizes of a box and of a plate, where the plate is, the speed, and when they meet."""
    size = 10.0 ** rng.uniform(-3.0, 2.0)
    box, plate = size * rng.uniform(0.05, 0.2), size * rng.uniform(0.002, 0.02)
    place, speed = size * rng.uniform(0.5, 0.8), size * rng.uniform(1.2, 1.5)
    return box, plate, place, speed, (place - 0.5 * plate - 0.5 * box) / speed


def _tunnel(rng: np.random.Generator) -> Question:
    """A box flies through a plate within a second."""
    box, plate, place, speed, truth = _flight(rng)
    links = [_joint("box", JointType.PRISMATIC, (1.0, 0.0, 0.0)), _fixed("plate")]
    solids = {"box": cuboid((box,) * 3), "plate": _at(cuboid((plate, 20.0 * box, 20.0 * box)), (place, 0.0, 0.0))}
    script = Script(points={"box": (Waypoint(0.0, 0.0), Waypoint(1.0, speed))})
    return links, solids, script, SECOND, truth


def _rod(rng: np.random.Generator) -> Question:
    """A rod of length l and half thickness e turns up into a ceiling: l sin q + e cos q = h."""
    length = 10.0 ** rng.uniform(-3.0, 3.0)
    edge, speed = 1e-3 * length, rng.uniform(1.0, 1.4)
    height = length * math.sin(rng.uniform(0.3, 0.9))
    truth = (math.asin(height / math.hypot(length, edge)) - math.atan2(edge, length)) / speed
    rod = _at(cuboid((length, 2.0 * edge, 2.0 * edge)), (0.5 * length, 0.0, 0.0))
    ceiling = _at(cuboid((4.0 * length, 4.0 * length, length)), (0.0, 0.0, height + 0.5 * length))
    links = [_joint("rod", JointType.REVOLUTE, (0.0, -1.0, 0.0)), _fixed("ceiling")]
    script = Script(points={"rod": (Waypoint(0.0, 0.0), Waypoint(1.0, speed))})
    return links, {"rod": rod, "ceiling": ceiling}, script, SECOND, truth


def _joint(name: str, kind: JointType, axis: tuple[float, float, float]) -> Link:
    return Link(name, None, np.identity(4), Joint(name, kind, axis))


def _fixed(name: str) -> Link:
    return Link(name, None, np.identity(4), Joint(name))


def _at(solid: Solid, xyz: tuple[float, float, float]) -> Solid:
    return solid.transformed(transforms.from_translation(np.array(xyz)))


def _peers(count: int) -> Grid:
    """Return what python-fcl's continuous modes say of boxes that fly through plates."""
    try:
        import fcl
    except ImportError:
        return Grid([{"mode": "python-fcl", "note": "not installed"}])
    lines = []
    for motion in _FCL_MOTIONS:
        for solver in _FCL_SOLVERS:
            rng = np.random.default_rng(18)
            outcome = {"right": 0, "early": 0, "late": 0, "missed": 0}
            begin = time.process_time()
            for _ in range(count):
                box, plate, place, speed, truth = _flight(rng)
                found = _fcl_time(fcl, motion, solver, (box, plate, place, speed))
                outcome[_verdict(found, truth)] += 1
            spent = time.process_time() - begin
            mode = f"{motion.removeprefix('CCDM_').lower()}, {solver.removeprefix('CCDC_').lower().replace('_', ' ')}"
            counts = {key: str(value) for key, value in outcome.items()}
            lines.append({"mode": mode, "asked": str(count), **counts, "us a question": f"{1e6 * spent / count:.3g}"})
    return Grid(lines)


def _verdict(found: float, truth: float) -> str:
    if math.isnan(found):
        return "missed"
    if abs(found - truth) <= RIGHT:
        return "right"
    return "early" if found < truth else "late"


def _fcl_time(fcl: Any, motion: str, solver: str, flight: tuple[float, float, float, float]) -> float:
    """Return the time of contact [s] in a flight of 1 s, NaN for none."""
    box, plate, place, speed = flight
    moving = fcl.CollisionObject(fcl.Box(box, box, box), fcl.Transform(np.zeros(3)))
    wall = fcl.CollisionObject(fcl.Box(plate, 20.0 * box, 20.0 * box), fcl.Transform(np.array([place, 0.0, 0.0])))
    request = fcl.ContinuousCollisionRequest(
        ccd_motion_type=getattr(fcl.CCDMotionType, motion), ccd_solver_type=getattr(fcl.CCDSolverType, solver)
    )
    result = fcl.ContinuousCollisionResult()
    there, stays = fcl.Transform(np.array([speed, 0.0, 0.0])), fcl.Transform(np.array([place, 0.0, 0.0]))
    fcl.continuousCollide(moving, there, wall, stays, request, result)
    return float(result.time_of_contact) if result.is_collide else math.nan
