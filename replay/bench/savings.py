"""What "only what a scene needs" leaves out, rule by rule, from the counts of a run; and that it changes no result.

The same scene is run with savings, all frames, and without, a few of them: those are compared value by value.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from replay.bench.goals import Goal
from replay.bench.measure import absent
from replay.bench.pipeline import MODELS, scenario
from replay.bench.report import Grid, Report
from replay.bench.runner import Runner
from replay.errors import ScenarioError
from replay.scenario.model import Scenario
from replay.scenario.scene import Scene

WITH, WITHOUT = "with savings", "without"
RULES, TIMES, SAME = "what each rule left out", "a frame with and without savings [us]", "the same results"

CLEARANCE, REACH = 1e-11, 1e-13
"""Relative and absolute [m] bound of two clearances: each is right to 1e-12 of itself plus 1e-14 of the reach."""


def run(*, quick: bool = False, frames: int | None = None, scene: Scenario | None = None) -> Report:
    """Run the benchmark.

    Args:
        quick: fewer frames; about ten seconds.
        frames: without savings; 8, or 2 when quick, if None.
        scene: instead of the pipeline's; with pairs and both kinds of sensors.
    """
    report = Report("savings")
    try:
        chosen = scene or scenario()
    except ScenarioError as error:
        report.tables[TIMES] = [absent("pipeline", WITH, str(error))]
        report.goals.append(Goal("savings.same", math.nan))
        return report
    count = chosen.frames
    few = np.linspace(0, count - 1, frames or (2 if quick else 8)).round().astype(int).tolist()
    name, model = next(iter(MODELS.items()))
    saving, full = Runner(chosen, model), Runner(chosen, model, savings=False)
    for runner, once in ((saving, range(2)), (full, few[:1])):  # compiled before the clock runs
        runner.run(list(once))
    before = _counters(saving), _counters(full)
    blocks, others = saving.blocks(range(count)), full.blocks(few)
    done, without = (_less(_counters(r), b) for r, b in zip((saving, full), before, strict=True))
    share = count / len(few)
    report.grids[RULES] = Grid([*_collision(saving.simulation.scene, done, without, share), *_sensors(done)])
    report.grids[TIMES] = _times(saving.seconds, count, full.seconds, len(few))
    lines, wrong = compare(blocks, others, few, model.capacitive.options()["rtol"])
    report.grids[SAME] = Grid(lines)
    report.goals.append(Goal("savings.same", float(wrong)))
    report.notes.append(f"{name}: {count} frames with savings, {len(few)} of them without.")
    return report


Counts = dict[str, dict[str, int]]


def _counters(runner: Runner) -> Counts:
    stages: Any = runner.simulation
    return {name: dict(vars(getattr(stages, name).counters)) for name in ("collision", "distance", "capacitive")}


def _less(after: Counts, before: Counts) -> Counts:
    return {stage: {key: n - before[stage][key] for key, n in counts.items()} for stage, counts in after.items()}


def _rule(rule: str, what: str, left_out: float, of: float) -> dict[str, str]:
    share = f"{left_out / of:.2%}" if of else ""
    return {"rule": rule, "what is counted": what, "left out": f"{left_out:.0f}", "of": f"{of:.0f}", "share": share}


def _collision(scene: Scene, done: Counts, without: Counts, share: float) -> list[dict[str, str]]:
    counts, every = done["collision"], done["collision"]["pair_frames"]
    several = list(itertools.combinations(scene.bodies, 2))
    one_link = sum(a.link == b.link for a, b in several)
    pairs, what = len(several), "pair-frames"
    left = every - counts["static"]
    return [
        _rule("shapes on one link make no pair", "pairs of shapes", one_link, pairs),
        _rule("joined by a joint, or disabled: no pair", "pairs of shapes", pairs - one_link - len(scene.pairs), pairs),
        _rule("pairs that cannot move are decided once", what, counts["static"], every),
        _rule("swept spheres apart for a whole block", what, counts["pruned_by_block"], left),
        _rule("the pose of the frame before", what, counts["repeated"], left),
        _rule("spheres apart in a frame", what, counts["pruned_by_sphere"], left),
        _rule("bounding volumes apart, no clearance asked", what, counts["pruned_by_volume"], left),
        _rule("all of these: no GJK", what, every - counts["narrow"], every),
        _rule(
            "box trees, the last frame's nearest sets, clearance only near",
            "GJK queries",
            share * without["collision"]["gjk_queries"] - counts["gjk_queries"],
            share * without["collision"]["gjk_queries"],
        ),
    ]


def _sensors(done: Counts) -> list[dict[str, str]]:
    near, felt = done["distance"], done["capacitive"]
    apart = felt["triangles"] - felt["in_clusters"] - felt["alone"]
    repeated = felt["triangles"] * felt["repeated"] / max(1, felt["integrals"])
    what = "triangles of plates and frames"
    return [
        _rule("distance: the pose of the frame before", "readings", near["repeated"], near["readings"]),
        _rule(
            "distance: triangle tree, started at the last frame's triangle",
            f"closest points in the cone ({near['boxes']} boxes bounded)",
            near["triangles"] - near["computed"],
            near["triangles"],
        ),
        _rule("capacitive: the pose of another frame of the block", "integrals", felt["repeated"], felt["integrals"]),
        _rule("capacitive: behind the plate, node by node", what, apart - repeated, felt["triangles"]),
        _rule(
            f"capacitive: summed as {felt['clusters']} clusters",
            what,
            felt["in_clusters"] - felt["clusters"],
            felt["triangles"],
        ),
    ]


def _times(seconds: dict[str, float], frames: int, full: dict[str, float], few: int) -> Grid:
    lines = []
    for stage in [*seconds, "all"]:
        a = 1e6 * (sum(seconds.values()) if stage == "all" else seconds[stage]) / frames
        b = 1e6 * (sum(full.values()) if stage == "all" else full[stage]) / few
        lines.append({"stage": stage, WITH: f"{a:.4g}", WITHOUT: f"{b:.4g}", "ratio": f"{b / a:.3g}"})
    return Grid(lines)


def compare(
    blocks: Sequence[dict[str, Any]], others: Sequence[dict[str, Any]], few: Sequence[int], rtol: float
) -> tuple[list[dict[str, str]], int]:
    """Return a line for every column of two runs, and how many values differ by more than they may.

    Args:
        blocks: of all frames, with savings.
        others: of the frames `few`, without.
        few: see above.
        rtol: by which capacitances may differ, and what follows from them.
    """
    lines, wrong = [], 0
    for stage in ("collision", "distance", "capacitive"):
        for column in (field.name for field in blocks[0][stage].fields()):
            if getattr(blocks[0][stage], column) is None:  # a column of other methods
                continue
            found = np.concatenate([getattr(block[stage], column) for block in blocks])[few]
            truth = np.concatenate([getattr(block[stage], column) for block in others])
            same = (found == truth) | (np.isnan(found) & np.isnan(truth))
            bound, allowed = "bit for bit", 0.0 * same
            if column == "clearance":
                bound, allowed = "its accuracy", CLEARANCE * np.abs(truth) + REACH
            elif stage == "capacitive" and truth.dtype == np.float64:
                bound, allowed = f"rtol {rtol:g}", rtol * np.abs(truth)
            error = np.zeros(same.shape)
            with np.errstate(invalid="ignore"):
                error[~same] = np.abs(found[~same].astype(np.float64) - truth[~same].astype(np.float64))
                beyond = int(np.sum(~(error <= allowed) & ~same))
            wrong += beyond
            lines.append(
                {
                    "column": f"{stage}.{column}",
                    "must be the same": bound,
                    "values": str(same.size),
                    "bit for bit": str(int(same.sum())),
                    "beyond the bound": str(beyond),
                    "largest difference": f"{error.max(initial=0.0):.2g}",
                }
            )
    return lines, wrong
