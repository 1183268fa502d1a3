"""Experiment I: error and time of midpoint splitting, of the tree and of the closed form, over a plate that tilts."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from replay.bench.experiments.tables import Cell, Table
from replay.kinematics.motion import sample
from replay.numerics.arrays import Floats
from replay.scenario.curve_plot import Line, Panel
from replay.scenario.load import load
from replay.scenario.scene import Scene, build
from replay.sensing.capacitive import CapacitiveSuite
from replay.sensing.target import Target, make_target

Answer = Callable[[], Floats]

SCENARIO = "inclined_plate.yaml"
SPLITS = range(8)
MOST_SPLITS = 12
TOLERANCES = tuple(float(f"1e-{k}") for k in range(2, 10))
ENOUGH = 1e-6
"""Error at which the speed of the closed form is stated."""

ADVICE = 4
"""Splits that the thesis recommends."""

FINE_SPLITS = 5
"""Each triangle of the plate becomes 4^5: the tree has nothing to save on two."""

_ROUNDS = 3
_ERROR, _TIME = "largest error", "time per frame [us]"


def run(folder: Path) -> tuple[list[Table], list[Panel]]:
    """Return the table and the drawing of experiment I.

    Midpoint and `exact` see the plate as its two triangles; `tree`, and `exact` again, see it cut into 2048. Errors are
    relative to `exact` on two, the largest and the mean over the frames of the scenario; times are the best of a few
    runs over all frames, per frame. Midpoint goes on past 7 splits until its largest error is below 1e-6.
    """
    scene = build(load(folder / SCENARIO))
    coarse = scene.targets
    fine = tuple(make_target(target.name, target.link, _cut(target.triangles, FINE_SPLITS)) for target in coarse)
    truth = _reading(scene, coarse, method="exact")()

    def row(name: str, targets: Sequence[Target], **options: Any) -> dict[str, Cell]:
        answer = _reading(scene, targets, **options)
        error = np.abs(answer() / truth - 1.0)
        return {
            "method": name,
            "triangles": sum(len(target.triangles) for target in targets),
            "largest error": float(error.max()),
            "mean error": float(error.mean()),
            "time per frame [us]": 1e6 * _seconds(answer) / scene.frames,
        }

    midpoint: list[dict[str, Cell]] = []
    while len(midpoint) < len(SPLITS) or (float(midpoint[-1][_ERROR]) > ENOUGH and len(midpoint) <= MOST_SPLITS):
        splits = len(midpoint)
        midpoint.append(row(f"midpoint, {splits} splits", coarse, method="midpoint", splits=splits))
    exact = row("exact", coarse, method="exact")
    tree = [row(f"tree, rtol {rtol:.0e}", fine, method="tree", rtol=rtol) for rtol in TOLERANCES]
    exact_fine = row("exact", fine, method="exact")
    remarks = [
        f"Midpoint with {ADVICE} splits, the thesis's advice, errs by {float(midpoint[ADVICE][_ERROR]):.1e};"
        f" one more split divides the error by {_gain(midpoint):.1f}."
    ]
    enough = next((entry for entry in midpoint if float(entry[_ERROR]) <= ENOUGH), None)
    if enough is not None:
        ratio = float(enough[_TIME]) / float(exact[_TIME])
        remarks.append(f"{enough['method']}, the first below {ENOUGH:g}, takes {ratio:.0f} times as long as exact.")
    table = Table(
        "experiment_1_splitting",
        "I. Inclined plate in front of a sensor plate: error relative to exact, and time",
        [*midpoint, exact, *tree, exact_fine],
        remarks,
    )
    return [table], [_panel({"midpoint, 2 triangles": midpoint, "tree, 2048 triangles": tree}, float(exact[_TIME]))]


def _cut(triangles: Floats, splits: int) -> Floats:
    """Return triangles (n, 3, 3) cut into 4^splits equal parts each, at the middles of their edges."""
    for _ in range(splits):
        a, b, c = triangles[:, 0], triangles[:, 1], triangles[:, 2]
        ab, bc, ca = 0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a)
        parts = ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))
        triangles = np.concatenate([np.stack(part, axis=1) for part in parts])
    return triangles


def _reading(scene: Scene, targets: Sequence[Target], **options: Any) -> Answer:
    """Return what computes the sensor's capacitance (F,) in all frames of a scene by a method."""
    suite = CapacitiveSuite(scene.capacitive_sensors, targets, **options)
    states = sample(scene.linkage, scene.script, scene.seconds(0, scene.frames))
    poses = scene.linkage.forward(states.positions, states.free_poses)
    return lambda: np.asarray(suite.run(poses).capacitance[:, 0])


def _seconds(answer: Answer) -> float:
    """Return the best time of a few calls [s]; the caller has called it before, so that it is compiled."""
    best = math.inf
    for _ in range(_ROUNDS):
        begin = time.perf_counter()
        answer()
        best = min(best, time.perf_counter() - begin)
    return best


def _gain(midpoint: list[dict[str, Cell]]) -> float:
    """Return the factor by which one more split lowers the mean error, over splits 4 to 7."""
    first, last = SPLITS[ADVICE], SPLITS[-1]
    ratio = float(midpoint[first]["mean error"]) / float(midpoint[last]["mean error"])
    return float(ratio ** (1.0 / (last - first)))


def _panel(groups: Mapping[str, list[dict[str, Cell]]], exact: float) -> Panel:
    lines = []
    for color, (name, rows) in enumerate(groups.items()):
        x, y = [float(row[_TIME]) for row in rows], [float(row[_ERROR]) for row in rows]
        lines.append(Line(name, x, y, points=True, color=color))
    lines.append(Line("exact (the reference)", [exact, exact], [1e-12, 1.0], color=2))
    return Panel("I. inclined plate", "time per frame [us]", "largest relative error", lines, logarithmic=True)
