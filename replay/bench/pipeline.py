"""The whole pipeline on one machine: ours in three models against what a user would write today, frame by frame."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from importlib import resources
from typing import Any

import numpy as np
from numpy.typing import NDArray

from replay.bench.handwritten import Handwritten
from replay.bench.measure import Check, Contender, Goal, Row, absent, compete, ratio
from replay.bench.report import Grid, Report, pareto_plot
from replay.collision.columns import Level
from replay.errors import ScenarioError
from replay.kinematics.linkage import LinkPoses
from replay.kinematics.motion import sample
from replay.scenario.load import load, load_model
from replay.scenario.methods import CapacitiveMethod, Model
from replay.scenario.model import Scenario
from replay.scenario.scene import build
from replay.simulation import BLOCK_FRAMES, Simulation

Floats = NDArray[np.float64]

CASE = "C-arm, 26 756 triangles, 4 cones, 6 x 3 plates"
DEFAULT, FAST, THESIS, PEER = "replay, rtol 1e-6", "replay, rtol 1e-4", "replay, thesis2015", "fcl + embreex + NumPy"
TABLE, STAGES = "a frame, recording excluded", "where the time of a frame goes [us]"


@dataclass(frozen=True, eq=False)
class Readings:
    """What n frames say: contacts (n, P), distances (n, D) [m] with NaN for nothing, capacitances (n, C) [F]."""

    contact: NDArray[np.bool_]
    distance: Floats
    capacitance: Floats


class Runner:
    """One model of ours on the scene, on any frames, with the time of every stage.

    Attributes:
        seconds: spent by stage in the last run.
    """

    def __init__(self, scenario: Scenario, model: Model) -> None:
        self.simulation = Simulation(build(scenario, model=model))
        scene = self.simulation.scene
        self._states = sample(scene.linkage, scene.script, scene.seconds(0, scene.frames))
        self.seconds: dict[str, float] = {}

    def poses(self, frames: Sequence[int]) -> LinkPoses:
        """Return the link poses of some frames."""
        chosen = list(frames)
        return self.simulation.scene.linkage.forward(self._states.positions[chosen], self._states.free_poses[chosen])

    def run(self, frames: Sequence[int]) -> Readings:
        """Return the readings of some frames, in blocks as a run has them."""
        self.seconds = dict.fromkeys(("kinematics", "collision", "distance", "capacitive"), 0.0)
        several = [self._block(frames[k : k + BLOCK_FRAMES]) for k in range(0, len(frames), BLOCK_FRAMES)]
        return Readings(
            *(np.concatenate([getattr(part, name) for part in several]) for name in Readings.__annotations__)
        )

    def _block(self, frames: Sequence[int]) -> Readings:
        stages: Any = self.simulation
        times = [time.perf_counter()]
        poses = self.poses(frames)
        times.append(time.perf_counter())
        found = []
        for stage in (stages.collision, stages.distance, stages.capacitive):
            found.append(stage.run(poses))
            times.append(time.perf_counter())
        for name, taken in zip(self.seconds, np.diff(times).tolist(), strict=True):
            self.seconds[name] += taken
        return Readings(found[0].level == Level.CONTACT, found[1].distance, found[2].capacitance)


def scenario() -> Scenario:
    """Return the benchmark's scenario, which the package ships.

    Raises:
        ScenarioError: its human body is not installed (package pyskindose).
    """
    with resources.as_file(resources.files("replay.bench").joinpath("pipeline.yaml")) as path:
        return load(path)


def run(
    *, quick: bool = False, rounds: int | None = None, frames: int | None = None, scene: Scenario | None = None
) -> Report:
    """Run the pipeline benchmark.

    Args:
        quick: fewer frames; about a minute.
        rounds: times that ours are timed; 5, or 3 when quick, if None.
        frames: of ours; all of the scenario, or 96 when quick, if None. What is slow gets one or two.
        scene: instead of `scenario()`; with distance and capacitive sensors.
    """
    report = Report("pipeline")
    try:
        chosen = scene or scenario()
    except ScenarioError as error:
        report.tables[TABLE] = [absent(CASE, DEFAULT, str(error))]
        return report
    models = {
        DEFAULT: Model(),
        FAST: Model(capacitive=CapacitiveMethod(method="tree", rtol=1e-4)),
        THESIS: load_model("thesis2015"),
    }
    runners = {name: Runner(chosen, model) for name, model in models.items()}
    count = frames or (96 if quick else chosen.frames)
    every = np.linspace(0, chosen.frames - 1, count).round().astype(int).tolist()
    few = [every[2 * count // 3]] if quick else [every[count // 3], every[2 * count // 3]]
    truth = Runner(chosen, Model(capacitive=CapacitiveMethod(method="exact"))).run(few)
    contenders = []
    for name in (DEFAULT, FAST):
        check = _checked(report, name, runners[name].run(few), truth)
        runner = runners[name]
        contenders.append(Contender(name, partial(runner.run, every), len(every), check))
    rows = compete(CASE, contenders, rounds=rounds or (3 if quick else 5))
    stages = {name: _per_frame(runners[name].seconds, len(every)) for name in (DEFAULT, FAST)}
    # seconds a frame: once is enough, and its answers are those that are checked
    slow: dict[str, Any] = {THESIS: runners[THESIS].run}
    peer = Handwritten(runners[DEFAULT].simulation.scene)
    if not peer.missing:
        slow[PEER] = lambda few: Readings(*peer.run(runners[DEFAULT].poses(few)))
    runners[THESIS].run(few[:1])  # compiled before the clock runs
    for name, answer in slow.items():
        begin = time.perf_counter()
        found = answer(few)
        taken = (time.perf_counter() - begin) / len(few)
        worst = _checked(report, name, found, truth)(None).worst_error
        rows.append(Row(CASE, name, taken, taken, taken, 1, worst, 0, len(few), failed=False))
        stages[name] = _per_frame(peer.seconds if name == PEER else runners[name].seconds, len(few))
    if peer.missing:
        rows.append(absent(CASE, PEER, peer.missing))
    report.tables[TABLE] = rows
    report.grids[STAGES] = Grid(
        [
            {"method": name, **{key: f"{taken.get(key, 0.0):.4g}" for key in stages[DEFAULT]}}
            for name, taken in stages.items()
        ]
    )
    report.plots.append(pareto_plot(CASE, rows, "worst relative error of a sensor"))
    _add_savings(report, runners[DEFAULT], every)
    what = f"whole pipeline at rtol 1e-6 against {PEER}"
    report.goals.append(Goal(what, ">= 100x", ratio(rows, CASE, PEER, DEFAULT), 100.0))
    real_time = 1.0 / (float(chosen.rate) * rows[1].low)
    report.goals.append(Goal("times real time at 60 Hz, one core, rtol 1e-4", ">= 5x", real_time, 5.0))
    return report


def _per_frame(seconds: dict[str, float], frames: int) -> dict[str, float]:
    return {name: 1e6 * taken / frames for name, taken in seconds.items()}


def compare(found: Readings, truth: Readings) -> dict[str, float]:
    """Return contacts that differ, readings lost or invented, and the worst relative errors of both sensors."""
    seen = np.isfinite(found.distance) & np.isfinite(truth.distance)
    finite = np.isfinite(truth.capacitance) & (truth.capacitance > 0.0)
    near = np.abs(found.distance[seen] - truth.distance[seen]) / truth.distance[seen]
    felt = np.abs(found.capacitance[finite] - truth.capacitance[finite]) / truth.capacitance[finite]
    return {
        "contacts that differ": float(np.sum(found.contact != truth.contact)),
        "distances lost or invented": float(np.sum(np.isfinite(found.distance) != np.isfinite(truth.distance))),
        "distance": float(near.max(initial=0.0)),
        "capacitance": float(felt.max(initial=0.0)),
    }


def _checked(report: Report, name: str, found: Readings, truth: Readings) -> Any:
    """Note what a method's readings are worth and return what says so to `compete`."""
    errors = compare(found, truth)
    report.notes.append(f"{name}: " + ", ".join(f"{key} {value:.2g}" for key, value in errors.items()))
    worst = max(errors["distance"], errors["capacitance"])
    wrong = errors["contacts that differ"] + errors["distances lost or invented"] if name in (DEFAULT, FAST) else 0.0
    return lambda _: Check(worst if math.isfinite(worst) else math.nan, int(wrong))


def _add_savings(report: Report, runner: Runner, frames: Sequence[int]) -> None:
    """Note how much of the collision work each rule of "model only what a scene needs" removed."""
    collision = runner.simulation.collision
    if collision is None:
        return
    before = dict(vars(collision.counters))
    runner.run(frames)
    done = {name: value - before[name] for name, value in vars(collision.counters).items()}
    total = done["pair_frames"]
    parts = ("static", "pruned_by_block", "pruned_by_sphere", "pruned_by_volume", "repeated", "narrow")
    shares = ", ".join(f"{name.replace('_', ' ')} {done[name] / total:.1%}" for name in parts)
    report.notes.append(f"Of {total} pair-frames: {shares}.")
