"""The distance sensor: our exact cone, the thesis's steps and bundles of rays, time against error."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from replay.bench.cone_truth import nearest_in_cone
from replay.bench.goals import Goal, advantage
from replay.bench.inputs import around, box_surface, phantom, torus
from replay.bench.measure import Check, Contender, Row, absent, compete
from replay.bench.report import LogLogPlot, Report, pareto_plot
from replay.errors import MissingPackageError
from replay.geometry.primitives import sphere
from replay.geometry.wide_tree import widen
from replay.numerics.arrays import Floats
from replay.sensing.distance.cone import half_angle
from replay.sensing.distance.embree import EmbreeBundle
from replay.sensing.distance.exact import sweep_exact
from replay.sensing.distance.query import COUNTS
from replay.sensing.distance.rays import cap_directions, sweep_rays
from replay.sensing.distance.readings import Nearest, nothing_yet
from replay.sensing.distance.thesis import sweep_thesis
from replay.sensing.target import Target, make_target

Sweep = Callable[[Floats, Nearest], None]

APERTURE = math.radians(30.0)
RAY_COUNTS = (1, 7, 19, 61, 217, 1000, 10_000)
EXACT, THESIS = "exact", "thesis"

WRONG = 1e-6
"""Part of the distance by which a reading may be too near before it is wrong: no method sees what is not there."""

TOO_FAR = 1e-9
"""Part of the distance by which an exact method may be too far before it is wrong."""

LARGE = "torus, 100 000 triangles"
MESHES: dict[str, Callable[[], Floats]] = {
    "box, 12 triangles": lambda: box_surface((0.6, 0.5, 0.4)),
    "sphere, 5 120 triangles": lambda: sphere(0.4, 1.7e-4).triangles,
    "phantom, 26 756 triangles": lambda: phantom(26_756),
    LARGE: lambda: torus(100_000),
}


def run(*, quick: bool = False, rounds: int | None = None, meshes: Sequence[str] = tuple(MESHES)) -> Report:
    """Run the distance benchmarks.

    Args:
        quick: fewer queries, and no bundle of 10 000 rays; some five seconds.
        rounds: times that every contender is timed; 5, or 3 when quick, if None.
        meshes: which of `MESHES`.
    """
    rounds = rounds or (3 if quick else 5)
    counts = RAY_COUNTS[:-1] if quick else RAY_COUNTS
    report = Report("distance")
    for name in meshes:
        try:
            triangles = MESHES[name]()
        except MissingPackageError as error:
            report.tables[name] = [absent(name, EXACT, str(error))]
            continue
        rows = on_mesh(name, triangles, queries=12 if quick else 24, counts=counts, rounds=rounds)
        report.tables[name] = rows
        report.plots.append(_plot(name, rows))
    rows = report.tables.get(LARGE, [])
    report.goals.append(advantage("cone.speed", rows, [LARGE], "embree, 1000 rays", EXACT))
    errors = [row.worst_error for several in report.tables.values() for row in several if row.method == EXACT]
    worst = max(errors) if errors else math.nan
    report.goals.append(Goal("cone.error", worst))
    return report


def on_mesh(name: str, triangles: Floats, *, queries: int, counts: Sequence[int], rounds: int) -> list[Row]:
    """Return the rows of all methods on one mesh; sensors stand 3 cm to 1.5 m off it and look at it."""
    target = make_target(name, 0, triangles)
    poses = around(triangles, queries, near=0.03, far=1.5, tilt=0.9 * APERTURE / 2.0)
    truth = np.array([nearest_in_cone(triangles, T[:3, 3], T[:3, 2], APERTURE) for T in poses])
    contenders = [
        _contender(EXACT, exact_sweep(target), poses, truth, exact=True),
        _contender(THESIS, _thesis_sweep(target), poses, truth, exact=True),
    ]
    contenders += [_contender(f"own, {n} rays", _ray_sweep(target, n), poses, truth) for n in counts]
    missing = []
    try:
        bundle = EmbreeBundle(target.triangles)
    except MissingPackageError as error:
        missing = [absent(name, f"embree, {n} rays", str(error)) for n in counts]
    else:
        contenders += [_contender(f"embree, {n} rays", _embree_sweep(bundle, n), poses, truth) for n in counts]
    return [*compete(name, contenders, rounds=rounds), *missing]


def exact_sweep(target: Target) -> Sweep:
    """Return our exact sensor on a target."""
    cos_half, sin_half = half_angle(APERTURE)
    tree, counts = widen(target.tree, target.triangles), np.zeros(COUNTS, dtype=np.int64)
    return lambda poses, nearest: sweep_exact(
        target.triangles, tree, poses, cos_half, sin_half, np.zeros(len(poses)), np.inf, 0, nearest, counts
    )


def _thesis_sweep(target: Target) -> Sweep:
    cos_half, _ = half_angle(APERTURE)
    return lambda poses, nearest: sweep_thesis(target.triangles, poses, cos_half, np.inf, 0, nearest)


def _ray_sweep(target: Target, count: int) -> Sweep:
    directions = cap_directions(APERTURE, count)
    triangles, tree = target.triangles, target.tree
    return lambda poses, nearest: sweep_rays(
        triangles, tree, poses, directions, np.zeros(len(poses)), np.inf, 0, nearest
    )


def _embree_sweep(bundle: EmbreeBundle, count: int) -> Sweep:
    directions = cap_directions(APERTURE, count)
    return lambda poses, nearest: bundle.sweep(poses, directions, np.inf, 0, nearest)


def _contender(name: str, sweep: Sweep, poses: Floats, truth: Floats, *, exact: bool = False) -> Contender:
    return Contender(name, _read(sweep, poses), len(poses), lambda found: judge(found, truth, exact=exact))


def _read(sweep: Sweep, poses: Floats) -> Callable[[], Floats]:
    def run() -> Floats:
        nearest = nothing_yet(len(poses))
        sweep(poses, nearest)
        return nearest.distance

    return run


def judge(found: Floats, truth: Floats, *, exact: bool) -> Check:
    """Return what readings are worth; inf is "nothing detected".

    A ray bundle is inexact on purpose: only a reading nearer than the truth is wrong, and what it does not see at all
    is a miss. A method that claims to be exact is wrong too when it is too far or sees nothing.
    """
    seen = np.isfinite(found) & np.isfinite(truth)
    missed = ~np.isfinite(found) & np.isfinite(truth)
    error = np.where(seen, found - truth, 0.0) / np.where(np.isfinite(truth), truth, 1.0)
    wrong = np.isnan(found) | (error < -WRONG) | (np.isfinite(found) & ~np.isfinite(truth))
    if exact:
        wrong |= missed | (np.abs(error) > TOO_FAR)
    size = np.abs(error[seen])
    worst, mean = (float(size.max()), float(size.mean())) if seen.any() else (math.nan, math.nan)
    return Check(worst, int(wrong.sum()), TOO_FAR if exact else math.inf, mean, int(missed.sum()))


def _plot(name: str, rows: Sequence[Row]) -> LogLogPlot:
    groups = {row.method: row.method.split(",")[0] + " rays" for row in rows if row.method.endswith("rays")}
    return pareto_plot(name, rows, "worst relative error", groups, headline=name == LARGE)


def read_once(method: str, question: dict[str, Any], *, engine: str = "own", count: int = 1000) -> float:
    """Return one reading [m] of a model version, "thesis" or "rays"; inf when it detects nothing.

    Args:
        method: see above.
        question: triangles, apex, axis, aperture.
        engine, count: of "rays".
    """
    triangles, aperture = question["triangles"], question["aperture"]
    pose = np.identity(4)
    x, y = _across(question["axis"])
    pose[:3, 0], pose[:3, 1], pose[:3, 2], pose[:3, 3] = x, y, question["axis"], question["apex"]
    poses, nearest = pose[None].copy(), nothing_yet(1)
    if method == "thesis":
        sweep_thesis(triangles, poses, half_angle(aperture)[0], np.inf, 0, nearest)
    elif engine == "embree":
        EmbreeBundle(triangles).sweep(poses, cap_directions(aperture, count), np.inf, 0, nearest)
    else:
        target = make_target("t", 0, triangles)
        sweep_rays(triangles, target.tree, poses, cap_directions(aperture, count), np.zeros(1), np.inf, 0, nearest)
    return float(nearest.distance[0])


def _across(axis: Floats) -> tuple[Floats, Floats]:
    """Return two unit vectors that make a right-handed frame with an axis."""
    x = np.cross(axis, np.identity(3)[int(np.argmin(np.abs(axis)))])
    x = x / math.sqrt(float(np.sum(x * x)))
    return x, np.cross(axis, x)
