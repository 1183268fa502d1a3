"""Electrostatics of capacitive sensors: `field` with N unknowns, `bem` by levels, the thesis's model; error and time.

On configurations whose capacitances are known, and on motions beside `bem` (`charge_motions`), where the cost of a pose
against unknowns, bodies and plates stands too. Times are those of poses that were not asked before, once a unit is
ready. The thesis's model is scaled by the one factor that suits the median plate: what is left is no matter of a fit.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from replay.bench import charge_motions
from replay.bench.conductors import Configuration, configurations
from replay.bench.goals import Goal
from replay.bench.measure import Row, absent
from replay.bench.report import Grid, Report, pareto_plot
from replay.errors import MissingPackageError
from replay.numerics import transforms
from replay.numerics.arrays import Floats
from replay.sensing.capacitive import CapacitiveSuite
from replay.sensing.electrostatics import bem
from replay.sensing.electrostatics.conductors import FOUR_PI_EPSILON
from replay.sensing.electrostatics.field import FieldSolver
from replay.sensing.electrostatics.suite import PANELS
from replay.sensing.target import make_target

UNKNOWNS = (100, 200, 400, 800)
FIELD, BEM = "field", "bem"
THESIS: dict[str, dict[str, Any]] = {
    "tree rtol 1e-06": {"method": "tree"},
    "midpoint n=4": {"method": "midpoint", "splits": 4},
}
CASES, EACH = "a pose of a configuration whose capacitances are known", "error of the worst plate [%]"

_NEW_POSES = 4
_COUNTED = 0.02
"""Share of the largest reading from which on `bem` is judged."""


def run(*, quick: bool = False, scene: str | None = charge_motions.SCENE) -> Report:
    """Run the benchmark.

    Args:
        quick: bare plates, one motion, small sizes and no scene; some ten seconds.
        scene: shipped scenario whose frames a second are measured; None for none.
    """
    report = Report("electrostatics")
    try:
        judge(report, configurations({"bare"} if quick else None))
    except MissingPackageError as error:
        report.tables[CASES] = [absent("all", FIELD, str(error))]
    charge_motions.judge(report, frames=4 if quick else 24, count=1 if quick else 3)
    charge_motions.growth(report, sizes=2 if quick else 4)
    if scene is not None and not quick:
        charge_motions.pace(report, scene)
    return report


def judge(report: Report, cases: Sequence[Configuration]) -> None:
    """Add errors and times of all methods on configurations, of plates that read a tenth of the largest or more."""
    errors: dict[str, list[Floats]] = {}
    seconds: dict[str, list[float]] = {}
    covered: list[bool] = []
    beyond = [0.0]

    def tell(method: str, case: Configuration, increase: Floats, taken: list[float]) -> None:
        errors.setdefault(method, []).append(case.errors(increase))
        seconds.setdefault(method, []).append(min(taken))  # other programs only add time

    for case in cases:
        _fast(case, tell, covered)
        beyond.append(_reference(case, tell))
    for name, options in THESIS.items():
        read = [_Thesis(case, options) for case in cases]
        readings = [each() for each in read]
        truth, model = (
            np.concatenate([values[case.counted] for values, case in zip(several, cases, strict=True)])
            for several in ([case.truth.diagonal() for case in cases], readings)
        )
        factor = float(np.median(truth / model))
        for case, reading, again in zip(cases, readings, read, strict=True):
            tell(name, case, np.diag(factor * reading), [_timed(again, T)[1] for T in _shifts(case)])
        report.notes.append(f"{name}: the thesis's model, scaled by {factor:.3g}, which suits the median plate.")
    rows = [_row(name, seconds[name], np.concatenate(found)) for name, found in errors.items()]
    report.tables[CASES] = rows
    report.grids[EACH] = Grid(
        [
            {"configuration": case.name, **{name: f"{100.0 * found[i].max():.2f}" for name, found in errors.items()}}
            for i, case in enumerate(cases)
        ]
    )
    groups = {name: name.partition(" N=")[0].partition(" f=")[0] for name in errors}
    report.plots.append(pareto_plot(CASES, rows, "error of the worst plate", groups))
    field = np.concatenate(errors[FIELD])
    report.goals += [
        Goal("field.worst", float(field.max())),
        Goal("field.median", float(np.median(field))),
        Goal("field.covered", sum(covered) / len(covered)),
        Goal("bem.worst", max(beyond)),
    ]


Tell = Callable[[str, Configuration, Floats, list[float]], None]


def _fast(case: Configuration, tell: Tell, covered: list[bool]) -> None:
    """Tell of `field`, and by how many unknowns; add which plates' errors its estimate covers."""
    solver = FieldSolver(case.unit(PANELS[FIELD]), case.bodies, behind=bool(case.behind))
    found = solver.read(case.placed())
    assert found is not None
    k = len(case.truth)
    off = np.abs(found.increase[:k, :k] - case.truth).diagonal()
    covered += (off <= (found.error[:k, :k] + case.doubt).diagonal())[case.counted].tolist()
    tell(FIELD, case, found.increase, [_timed(solver.read, case.placed(T))[1] for T in _shifts(case)])
    for count in UNKNOWNS:
        reading = solver.solve(case.placed(), count)
        assert reading is not None
        taken = [_timed(solver.solve, case.placed(T), count)[1] for T in _shifts(case)]
        tell(f"field N={count}", case, reading.increase, taken)


def _reference(case: Configuration, tell: Tell) -> float:
    """Tell of `bem` and its levels; return the share of a reading that it is off beyond the doubt about the truth."""
    unit, levels, taken = case.unit(), [], []
    assert unit.charged  # once a unit, of whatever is before it
    for fineness in bem.LEVELS:
        found, seconds = _timed(bem.level, unit, case.placed(), fineness)
        assert found is not None
        levels.append(found[0].increase)
        taken.append(seconds)
        tell(f"bem f={fineness:g}", case, levels[-1], [seconds])
    value = bem.extrapolated(levels)
    tell(BEM, case, value, [sum(taken)])
    own, k = case.truth.diagonal(), len(case.truth)
    excess = (np.abs(value.diagonal()[:k] - own) - case.doubt.diagonal()) / own
    return float(excess[own > _COUNTED * own.max()].max())


class _Thesis:
    """The thesis's model: of where bodies are moved, what each plate reads (k,) [m], in units of 4 pi eps0."""

    def __init__(self, case: Configuration, options: dict[str, Any]) -> None:
        targets = [make_target(f"{k}/{b.name}", 1 + k, np.concatenate(b.shapes)) for k, b in enumerate(case.bodies)]
        self._suite = CapacitiveSuite(case.plates, targets, **options)
        self._bodies = len(targets)

    def __call__(self, T: Floats | None = None) -> Floats:
        poses = transforms.identity(1 + self._bodies)
        if T is not None:
            poses[1:] = T
        columns = self._suite.run(charge_motions.link_poses(poses[None]))
        return np.asarray(columns.capacitance[0] / FOUR_PI_EPSILON)


def _timed(function: Callable[..., Any], *given: Any) -> tuple[Any, float]:
    begin = time.perf_counter()
    found = function(*given)
    return found, time.perf_counter() - begin


def _shifts(case: Configuration) -> Floats:
    """Return where to bodies are moved (n, 4, 4), so that they keep most of their gap."""
    result = transforms.identity(_NEW_POSES)
    result[:, :3, 3] = 0.1 * case.gap * np.random.default_rng(3).uniform(-1.0, 1.0, (_NEW_POSES, 3))
    return result


def _row(method: str, seconds: Sequence[float], errors: Floats) -> Row:
    """Return times of configurations, of each its fastest pose, and errors of all plates, none of which is wrong."""
    return Row(
        case="all",
        method=method,
        median=statistics.fmean(seconds),
        low=min(seconds),
        high=max(seconds),
        rounds=len(seconds),
        worst_error=float(errors.max()),
        wrong=0,
        queries=len(errors),
        failed=bool(np.isnan(errors).any()),
        mean_error=float(errors.mean()),
    )
