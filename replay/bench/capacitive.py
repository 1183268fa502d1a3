"""The capacitive sensor: closed form, the thesis's splits and our tree, time against error."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from replay.bench.goals import Goal, advantage
from replay.bench.hard_sensing import hard_plates
from replay.bench.inputs import around, box_surface, phantom, slivers
from replay.bench.measure import Check, Contender, Row, absent, compete
from replay.bench.report import LogLogPlot, Report, pareto_plot
from replay.errors import MissingPackageError
from replay.geometry.primitives import plane
from replay.geometry.tree import triangle_tree
from replay.numerics import transforms
from replay.numerics.arrays import Floats
from replay.sensing.capacitive import plate_integral
from replay.sensing.capacitive.tree.clusters import make_clusters
from replay.sensing.capacitive.tree.tree_sum import COUNTS, sum_tree
from replay.sensing.capacitive.triangle_sum import EXACT, sum_triangles, triangle_areas

Answer = Callable[[], Floats]

PLATE = np.array([[0.025, 0.1]])
"""Half size of a guard plate of the C-arm [m]: 5 cm x 20 cm."""

TOLERANCES = tuple(10.0**-k for k in range(2, 10))
SPLITS = tuple(range(8))
SLACK = 1e-12
"""Relative rounding of a sum of many triangles, allowed beside a tolerance."""

BODIES: dict[str, Callable[[], Floats]] = {
    "box, 12 triangles": lambda: box_surface((0.6, 0.5, 0.4)),
    "slivers, 1 000 triangles": lambda: slivers(1_000),
    "phantom, 1 000 triangles": lambda: phantom(1_000),
    "phantom, 26 756 triangles": lambda: phantom(26_756),
}
LARGE = "phantom, 26 756 triangles"
INCLINED = "experiment I: inclined plate in front of a sensor plate"


def run(*, quick: bool = False, rounds: int | None = None, bodies: Sequence[str] = tuple(BODIES)) -> Report:
    """Run the capacitive benchmarks.

    Args:
        quick: fewer poses, and splits as far as a second allows; some ten seconds.
        rounds: times that every contender is timed; 5, or 3 when quick, if None.
        bodies: which of `BODIES`.
    """
    rounds = rounds or (3 if quick else 5)
    report = Report("capacitive")
    rows, best = inclined_plate(rounds)
    report.tables[INCLINED] = rows
    report.plots.append(_plot(INCLINED, rows))
    for key, worst in zip(("plate.error", "plate.slivers"), plate_errors(), strict=True):
        report.goals.append(Goal(key, worst))
    report.notes.append(f"Experiment I: midpoint reaches 1e-6 from n = {best} on.")
    report.goals.append(advantage("plate.speed", rows, [INCLINED], f"midpoint n={best}", "exact"))
    for name in bodies:
        try:
            triangles = BODIES[name]()
        except MissingPackageError as error:
            report.tables[name] = [absent(name, "exact", str(error))]
            continue
        poses = 24 if quick else 40
        points = (8_000_000 if quick else 100_000_000) // (poses * len(triangles))
        splits = [n for n in SPLITS if n <= 2 or 4**n <= points]
        report.tables[name] = on_body(name, triangles, poses=poses, splits=splits, rounds=rounds)
        report.plots.append(_plot(name, report.tables[name]))
    large = report.tables.get(LARGE, [])
    for key, rtol in (("tree.6", 1e-6), ("tree.4", 1e-4)):
        report.goals.append(advantage(key, large, [LARGE], "exact", f"tree rtol {rtol:.0e}"))
    excess = [
        row.worst_error / float(row.method.split()[-1])
        for several in report.tables.values()
        for row in several
        if row.method.startswith("tree")
    ]
    report.goals.append(Goal("tree.error", max(excess, default=math.nan)))
    return report


def plate_errors() -> tuple[float, float]:
    """Return the closed form's worst relative errors on the hard cases of 60 digits: but for slivers, and on these."""
    worst = {True: 0.0, False: 0.0}
    for case in hard_plates():
        found = plate_integral(np.array([case["triangle"]]), case["half_size"], side=case["side"])[0]
        truth, thin = case["truth"], "sliver" in case["family"]
        error = 0.0 if found == truth else abs(found - truth) / truth if truth else math.inf
        worst[thin] = max(worst[thin], math.inf if math.isnan(error) else float(error))
    return worst[False], worst[True]


def inclined_plate(rounds: int) -> tuple[list[Row], int | None]:
    """Return the rows of the thesis's experiment I, and the fewest splits that reach 1e-6.

    A 20 cm x 20 cm sensor plate and a 10 cm x 10 cm plate 5 cm in front of it, inclined by 0..45 degrees: the set-up in
    which the thesis compares its splits with its closed form, which it has in front of the plate only.
    """
    triangles = plane((0.1, 0.1)).triangles
    poses = transforms.from_axis_angle(np.array([0.0, 1.0, 0.0]), np.radians(np.linspace(0.0, 45.0, 16)))
    poses[:, 2, 3] = 0.05
    half = np.array([[0.1, 0.1]])
    rows = _race(INCLINED, triangles, poses, half, range(11), (1e-4, 1e-6, 1e-9), rounds)
    enough = [n for n in range(11) if _error(rows, f"midpoint n={n}") <= 1e-6]
    return rows, min(enough, default=None)


def _error(rows: Sequence[Row], method: str) -> float:
    return next((row.worst_error for row in rows if row.method == method), math.inf)


def on_body(name: str, triangles: Floats, *, poses: int, splits: Sequence[int], rounds: int) -> list[Row]:
    """Return the rows of all methods on one body; plates stand 1 cm to 1.5 m off it, tilted up to 60 degrees.

    Plates that the closed form says are saturated are left out: the tree answers these without a sum.
    """
    T_plate_body = transforms.invert(around(triangles, 3 * poses, near=0.01, far=1.5, tilt=math.radians(60.0)))
    return _race(name, triangles, T_plate_body, PLATE, splits, TOLERANCES, rounds, most=poses)


def _race(
    case: str,
    triangles: Floats,
    T_plate_body: Floats,
    half: Floats,
    splits: Sequence[int],
    tolerances: Sequence[float],
    rounds: int,
    *,
    most: int | None = None,
) -> list[Row]:
    """Time closed form, splits and tree at the first `most` poses that do not saturate.

    The closed form is the reference, judged itself by `bench stability`.
    """
    poses = np.ascontiguousarray(T_plate_body[:, None])
    areas, tree = triangle_areas(triangles), triangle_tree(triangles)
    clusters = make_clusters(triangles, tree)
    truth = sum_triangles(triangles, areas, poses, np.zeros(len(poses)), half, False, False, EXACT)[0].ravel()
    apart = np.flatnonzero(np.isfinite(truth))[:most]
    poses, truth = np.ascontiguousarray(poses[apart]), truth[apart]

    def by_tree(rtol: float) -> Answer:
        return lambda: sum_tree(
            clusters, poses, np.zeros(len(poses)), half, False, False, rtol, np.zeros(COUNTS, np.int64)
        )[0][:, 0]

    def contender(name: str, answer: Answer, tolerance: float) -> Contender:
        return Contender(name, answer, len(poses), lambda found: judge(found, truth, tolerance))

    several = [contender("exact", _by_triangles(triangles, areas, poses, EXACT, half), SLACK)]
    several += [contender(f"midpoint n={n}", _by_triangles(triangles, areas, poses, n, half), math.inf) for n in splits]
    several += [contender(f"tree rtol {rtol:.0e}", by_tree(rtol), rtol + SLACK) for rtol in tolerances]
    return compete(case, several, rounds=rounds)


def _by_triangles(triangles: Floats, areas: Floats, poses: Floats, splits: int, half: Floats = PLATE) -> Answer:
    return lambda: sum_triangles(triangles, areas, poses, np.zeros(len(poses)), half, False, False, splits)[0][:, 0]


def judge(found: Floats, truth: Floats, tolerance: float) -> Check:
    """Return what integrals are worth: wrong beyond the tolerance that the method states, or infinite where finite."""
    finite = np.isfinite(truth) & (truth != 0.0)
    error = np.abs(found[finite] - truth[finite]) / truth[finite]
    wrong = int(np.sum(~(error <= tolerance))) + int(np.sum(found[~finite] != truth[~finite]))
    if len(error) == 0:
        return Check(0.0, wrong, tolerance)
    return Check(float(error.max()), wrong, tolerance, float(error.mean()))


def _plot(name: str, rows: Sequence[Row]) -> LogLogPlot:
    groups = {row.method: row.method.split()[0] for row in rows}
    return pareto_plot(name, rows, "worst relative error", groups, headline=name == LARGE)
