"""The figures the project promises, in one place, and what a run measured beside each."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from replay.bench.measure import Row


@dataclass(frozen=True)
class Promise:
    """A figure to reach.

    Attributes:
        what: is measured.
        against: what it is compared with, in the same run.
        required: value to reach.
        unit: of the value.
        at_least: whether more is better.
        stretch: value that would be better still; NaN for none.
    """

    what: str
    against: str
    required: float
    unit: str = "x"
    at_least: bool = True
    stretch: float = math.nan

    @property
    def target(self) -> str:
        """Return the target as text."""
        sign = ">=" if self.at_least else "<="
        wish = "" if math.isnan(self.stretch) else f" (stretch {self.stretch:g})"
        return f"{sign} {self.required:g} {self.unit}".rstrip() + wish


def _at_most(what: str, against: str, required: float, unit: str = "") -> Promise:
    return Promise(what, against, required, unit, at_least=False)


_QUERY, _MOTION = "GJK boolean, 8..642 vertices, least advantage", "GJK boolean, 66 pairs over 2000 frames of a motion"
_CONE, _PLATE = "distance sensor, 100 000 triangles, 30 deg", "plate integral, exact"
_TREE, _PIPELINE = (
    "capacitive sensor, 26 756 triangles",
    "whole pipeline, C-arm, 26 756 triangles, 4 cones, 6 x 3 plates",
)
_FIELD, _KNOWN = "field on configurations whose capacitances are known", "boundary elements, extrapolated"
_WITHOUT = "the same run without recording"
_DIFF = "diff, 60 000 frames x 30 topics"

PROMISES: dict[str, Promise] = {
    "gjk.fcl": Promise(_QUERY, "python-fcl, one call a query", 3.0),
    "gjk.coal": Promise(_QUERY, "coal, one call a query", 3.0),
    "gjk.wrong": _at_most("GJK, wrong answers on unrelated pairs", "proven distances", 0.0),
    "motion.fcl": Promise(_MOTION, "python-fcl, each pair each frame", 10.0, stretch=30.0),
    "motion.coal": Promise(_MOTION, "coal, each pair each frame", 10.0, stretch=30.0),
    "cone.speed": Promise(_CONE, "1000 rays of embreex", 10.0),
    "cone.error": _at_most("distance sensor, worst relative error", "extended precision, every triangle", 1e-12),
    "plate.speed": Promise(_PLATE, "midpoint at the splits that reach 1e-6, experiment I", 100.0),
    "plate.error": _at_most(f"{_PLATE}, worst relative error", "values of 60 digits", 1e-12),
    "plate.slivers": _at_most(f"{_PLATE}, worst relative error on slivers", "values of 60 digits", 1e-8),
    "tree.6": Promise(f"{_TREE}, rtol 1e-6", "our own exact sum", 20.0),
    "tree.4": Promise(f"{_TREE}, rtol 1e-4", "our own exact sum", 100.0, stretch=500.0),
    "tree.error": _at_most("capacitive sensor, worst error over rtol", "our own exact sum", 1.001),
    "field.worst": _at_most(f"{_FIELD}, worst plate", _KNOWN, 0.035),
    "field.median": _at_most(f"{_FIELD}, median plate", _KNOWN, 0.01),
    "field.covered": Promise("plates whose error field's own estimate covers", _KNOWN, 0.95, ""),
    "field.motions": _at_most("field between and at keys of three motions, worst reading", "bem, each frame", 0.035),
    "field.pace": Promise("field on carm_bodyguard, processor time, recording excluded", "-", 1000.0, "frames/s"),
    "bem.worst": _at_most("bem, worst plate, beyond what is doubted of the truth", _KNOWN, 0.006),
    "pipeline.peer": Promise(f"{_PIPELINE}, rtol 1e-6", "python-fcl + 1000 rays + midpoint n=4 in NumPy", 100.0),
    "pipeline.real_time": Promise("the same at rtol 1e-4, one core", "real time at 60 Hz", 5.0, stretch=20.0),
    "recording.ratio": _at_most("recording carm_bodyguard", _WITHOUT, 1.5, "x"),
    "recording.frame": _at_most("recording, a frame more, worst shipped scene", _WITHOUT, 100.0, "us"),
    "recording.all": _at_most("recording, all in all a frame, worst scene of 100 or more", _WITHOUT, 100.0, "us"),
    "recording.short": _at_most("recording, all in all a frame, worst scene of fewer", _WITHOUT, 100.0, "us"),
    "diff.equal": _at_most(f"{_DIFF}, equal", "-", 5.0, "s"),
    "diff.different": _at_most(f"{_DIFF}, all different", "-", 30.0, "s"),
    "diff.memory": _at_most(f"{_DIFF}, peak memory", "-", 1024.0, "MiB"),
    "start.help": _at_most("replay --help", "-", 0.4, "s"),
    "start.validate": _at_most("replay validate", "-", 1.0, "s"),
    "start.modules": _at_most("replay validate, of numba, rerun, trimesh loaded", "-", 0.0),
    "cold.kernels": Promise("compiling carm_bodyguard's kernels, CPU", "numba's public decorator", 2.0),
    "savings.same": _at_most("values that differ beyond their bound without savings", "the same run with", 0.0),
    "between.proven": Promise("pair-intervals of shipped scenes that are proven or found", "all of them", 0.9999, ""),
    "between.wrong": _at_most("times of contacts outside their brackets, contacts missed", "closed forms", 0.0),
    "between.own": Promise("collision with a look between frames, worst shipped scene", "the same run sampled", 1.0),
    "between.fast": Promise("the same at 1 kHz", "the same run sampled", 1.0, stretch=2.0),
    "stability": _at_most("hard families: wrong, NaN, refused, hangs, crashes of ours", "long precision", 0.0),
}
"""By key, in the order in which they are shown."""


@dataclass(frozen=True)
class Goal:
    """A promise beside what this run measured.

    Attributes:
        key: of the promise.
        measured: the figure; NaN when the run could not produce it.
        wrong: whether the method it is about answered wrongly; then it is not met, however fast.
    """

    key: str
    measured: float
    wrong: bool = False

    @property
    def promise(self) -> Promise:
        """Return what is promised."""
        return PROMISES[self.key]

    @property
    def verdict(self) -> str:
        """Return "met", "missed", "wrong", or "not measured" when the run could not produce the figure."""
        if self.wrong:
            return "wrong"
        if math.isnan(self.measured):
            return "not measured"
        promise = self.promise
        met = self.measured >= promise.required if promise.at_least else self.measured <= promise.required
        return "met" if met else "missed"

    @property
    def failed(self) -> bool:
        """Whether it was measured and is not met."""
        return self.verdict in ("missed", "wrong")

    def cells(self) -> tuple[str, ...]:
        """Return the goal as texts under `HEADINGS`."""
        promise = self.promise
        measured = "" if math.isnan(self.measured) else f"{self.measured:.3g} {promise.unit}".rstrip()
        return (promise.what, promise.against, promise.target, measured, self.verdict)

    def as_json(self) -> dict[str, object]:
        """Return the goal as JSON values; a NaN is null."""
        promise = self.promise
        return {
            "key": self.key,
            "what": promise.what,
            "against": promise.against,
            "target": promise.target,
            "measured": self.measured if math.isfinite(self.measured) else None,
            "unit": promise.unit,
            "verdict": self.verdict,
        }


HEADINGS = ("goal", "against", "target", "measured", "verdict")


def in_order(goals: Iterable[Goal]) -> list[Goal]:
    """Return goals in the order of the promises."""
    places = list(PROMISES)
    return sorted(goals, key=lambda goal: places.index(goal.key))


def advantage(key: str, rows: Sequence[Row], cases: Sequence[str], slower: str, faster: str) -> Goal:
    """Return the least advantage of one method over another over cases of a table.

    The fastest rounds are compared: other programs can only add time, and on a busy machine they do so in most rounds.

    Returns:
        the goal: NaN if either is absent in any case; wrong if the faster one failed in any.
    """
    ratios, wrong = [], False
    for case in cases:
        found = {row.method: row for row in rows if row.case == case and row.rounds}
        wrong = wrong or (faster in found and found[faster].failed)
        known = slower in found and faster in found
        ratios.append(found[slower].low / found[faster].low if known else math.nan)
    return Goal(key, math.nan if not ratios or any(map(math.isnan, ratios)) else min(ratios), wrong)
