"""The whole pipeline on one machine: ours in three models against what a user would write today, frame by frame."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from functools import partial
from importlib import resources
from typing import Any

import numpy as np

from replay.bench.goals import Goal, advantage
from replay.bench.handwritten import Handwritten
from replay.bench.measure import Check, Contender, Row, absent, compete
from replay.bench.report import Grid, Report, pareto_plot
from replay.bench.runner import Readings, Runner
from replay.errors import ScenarioError
from replay.scenario.layout import Layout
from replay.scenario.load import load, load_model
from replay.scenario.methods import Model
from replay.scenario.model import Scenario
from replay.sensing.capacitive.part import CapacitiveMethod

CASE = "C-arm, 26 756 triangles, 4 cones, 6 x 3 plates"
DEFAULT, FAST, THESIS, PEER = "replay, rtol 1e-6", "replay, rtol 1e-4", "replay, thesis2015", "fcl + embreex + NumPy"
RTOL = {DEFAULT: 1e-6, FAST: 1e-4}
MODELS = {
    DEFAULT: Model(),
    FAST: Model(capacitive=CapacitiveMethod(method="tree", rtol=RTOL[FAST])),
    THESIS: load_model("thesis2015"),
}
EXACT = Model(capacitive=CapacitiveMethod(method="exact"))
TABLE, PACE = "a frame, recording excluded", "pace, recording excluded"
STAGES, SENSORS = "where the time of a frame goes [us]", "each sensor by itself, a frame [us]"
ERRORS = "worst relative error of every output against our exact model, on {} frames"

SAME_DISTANCE = 1e-12
"""Part of a distance by which our two models, both exact, may differ."""


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
        quick: fewer frames; about a quarter of a minute.
        rounds: times that ours are timed; 5, or 3 when quick, if None.
        frames: of ours; all of the scenario, or 96 when quick, if None. What is slow gets one or two.
        scene: instead of `scenario()`; with distance and capacitive sensors.
    """
    report = Report("pipeline")
    try:
        chosen = scene or scenario()
    except ScenarioError as error:
        report.tables[TABLE] = [absent(CASE, DEFAULT, str(error))]
        report.goals += [Goal("pipeline.peer", math.nan), Goal("pipeline.real_time", math.nan)]
        return report
    runners = {name: Runner(chosen, model) for name, model in MODELS.items()}
    count = frames or (96 if quick else chosen.frames)
    every = np.linspace(0, chosen.frames - 1, count).round().astype(int).tolist()
    judged = [every[k] for k in np.linspace(0, count - 1, 3 if quick else 7).round().astype(int)]
    few = judged[-1:] if quick else judged[-2:]
    truth = Runner(chosen, EXACT).run(judged)
    errors, contenders = [], []
    for name in (DEFAULT, FAST):
        outputs = errors_of(runners[name].run(judged), truth, runners[name].layout)
        errors.append({"method": name, **outputs})
        check = judge(outputs, runners[name].layout, RTOL[name])
        contenders.append(Contender(name, partial(runners[name].run, every), len(every), partial(_known, check)))
    rows = compete(CASE, contenders, rounds=rounds or (3 if quick else 5))
    stages = {name: _per_frame(runners[name].seconds, len(every)) for name in (DEFAULT, FAST)}
    record = runners[DEFAULT].recording
    stages[DEFAULT]["recording"] = 1e6 * (record(every) - record(every[:1])) / max(1, len(every) - 1)
    # seconds a frame: once is enough, and its answers are those that are judged
    slow: dict[str, Any] = {THESIS: runners[THESIS].run}
    peer = Handwritten(runners[DEFAULT].simulation.scene)
    if not peer.missing:
        slow[PEER] = lambda few: Readings(*peer.run(runners[DEFAULT].poses(few)))
    runners[THESIS].run(few[:1])  # compiled before the clock runs
    for name, answer in slow.items():
        begin = time.perf_counter()
        found = answer(few)
        taken = (time.perf_counter() - begin) / len(few)
        outputs = errors_of(found, truth.of(slice(-len(few), None)), runners[DEFAULT].layout)
        errors.append({"method": name, **outputs})
        worst = judge(outputs, runners[DEFAULT].layout, math.inf).worst_error
        rows.append(Row(CASE, name, taken, taken, taken, 1, worst, 0, len(few), failed=False))
        stages[name] = _per_frame(peer.seconds if name == PEER else runners[name].seconds, len(few))
    if peer.missing:
        rows.append(absent(CASE, PEER, peer.missing))
    report.tables[TABLE] = rows
    report.grids[PACE] = _pace(rows, float(chosen.rate))
    columns = list(dict.fromkeys(stage for taken in stages.values() for stage in taken))
    report.grids[STAGES] = Grid([{"method": name, **_texts(taken, columns)} for name, taken in stages.items()])
    parts = {name: _per_frame(runners[name].sensor_seconds(every), len(every)) for name in (DEFAULT, FAST)}
    report.grids[SENSORS] = Grid([{"method": name, **_texts(taken, list(taken))} for name, taken in parts.items()])
    report.grids[ERRORS.format(f"{len(judged)} (slow methods {len(few)})")] = Grid(
        [{key: value if isinstance(value, str) else f"{value:.2g}" for key, value in line.items()} for line in errors]
    )
    report.plots.append(pareto_plot(CASE, rows, "worst relative error of a sensor", headline=True))
    report.goals.append(advantage("pipeline.peer", rows, [CASE], PEER, DEFAULT))
    report.goals.append(Goal("pipeline.real_time", 1.0 / (float(chosen.rate) * rows[1].low), rows[1].failed))
    return report


def _known(check: Check, _: Readings) -> Check:
    return check


def _per_frame(seconds: dict[str, float], frames: int) -> dict[str, float]:
    return {name: 1e6 * taken / frames for name, taken in seconds.items()}


def _texts(values: dict[str, float], columns: Sequence[str]) -> dict[str, str]:
    return {key: f"{values[key]:.4g}" if key in values else "" for key in columns}


def _pace(rows: Sequence[Row], rate: float) -> Grid:
    by_hand = next(row.low for row in rows if row.method == PEER)
    return Grid(
        [
            {
                "method": row.method,
                "frames a second": f"{1.0 / row.low:.4g}",
                "times real time": f"{1.0 / (rate * row.low):.3g}",
                "times faster than by hand": f"{by_hand / row.low:.3g}",
            }
            for row in rows
            if row.rounds
        ]
    )


def errors_of(found: Readings, truth: Readings, layout: Layout) -> dict[str, float]:
    """Return contacts that differ, readings lost or invented, and the worst relative error of each sensor."""
    seen = np.isfinite(found.distance) & np.isfinite(truth.distance)
    near = np.abs(np.where(seen, found.distance / np.where(seen, truth.distance, 1.0) - 1.0, 0.0))
    same = (found.capacitance == truth.capacitance) | (truth.capacitance == 0.0)
    with np.errstate(invalid="ignore"):  # infinite in place of another number is an infinite error
        felt = np.where(same, 0.0, np.abs(found.capacitance / np.where(same, 1.0, truth.capacitance) - 1.0))
    return {
        "contacts that differ": float(np.sum(found.contact != truth.contact)),
        "distances lost or invented": float(np.sum(np.isfinite(found.distance) != np.isfinite(truth.distance))),
        **dict(zip(layout.distance_sensors, near.max(axis=0).tolist(), strict=True)),
        **dict(zip(layout.capacitive_sensors, felt.max(axis=0).tolist(), strict=True)),
    }


def judge(errors: dict[str, float], layout: Layout, rtol: float) -> Check:
    """Return what errors are worth: only the tree may err, by its rtol; an infinite one lets anything pass."""
    distance = max(errors[name] for name in layout.distance_sensors)
    capacitance = max(errors[name] for name in layout.capacitive_sensors)
    wrong = errors["contacts that differ"] + errors["distances lost or invented"]
    wrong += not capacitance <= rtol
    wrong += not distance <= SAME_DISTANCE
    return Check(max(distance, capacitance), int(wrong) if math.isfinite(rtol) else 0)
