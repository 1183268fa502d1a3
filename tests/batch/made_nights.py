"""Made-up nights of any size: regressions as `regress` returns them, without a simulation."""

import datetime
import math
from pathlib import Path

from replay.batch.case import CaseResult, CaseStatus
from replay.batch.finding import Finding
from replay.batch.history import Night, Past
from replay.batch.judged import Judged, Regression, RegressVerdict
from replay.batch.metrics import MAIN
from replay.batch.run_file import Run
from replay.comparison.causes import Causes
from replay.comparison.effects import Effect, Severity
from replay.scenario.measures import Measure

SEVERITIES = (Severity.CONTACT, Severity.CONTACT_TIME, Severity.CLEARANCE, Severity.READING)


def judged(k, folder):
    """Return scenario k: all of them differ, each by another amount, of one of a hundred causes or of none."""
    name = f"carm_sweep[aperture={k % 50}deg,arm={k // 50}deg,person={k % 7}]"
    severity = SEVERITIES[k % len(SEVERITIES)]
    effect = Effect(
        severity,
        1.0 + k,
        f"clearance {2.1 + k / 997:.5f} -> {1.4 - k / 9973:.5f} cm",
        f"forearm/tube_{k} | person/body",
    )
    why = Causes() if k % 101 == 100 else Causes(inputs=(f"person/part_{k % 101} radius 20 -> {21 + k % 101} cm",))
    measures = (Measure(MAIN, 0.014 + 1e-4 * math.sin(k), "m", 3.2, effect.subject),)
    status = CaseStatus.BROKEN if k % 500 == 7 else CaseStatus.PASSED
    result = CaseResult(name, status, frames=600, seconds=0.1, measures=measures)
    verdict = RegressVerdict.BROKEN if status is CaseStatus.BROKEN else RegressVerdict.DIFFERENT
    finding = Finding(folder / name / f"{name}.mcap", (effect,), 3, why, "different")
    return Judged(name, verdict, f"{effect}; 2 more readings", result, finding, "carm.yaml", (f"tag{k % 5}",))


def regression(count, folder=Path("night")):
    items = tuple(judged(k, folder) for k in range(count))
    started = datetime.datetime(2026, 11, 30, 2, 0, tzinfo=datetime.UTC)
    run = Run(folder, tuple(item.result for item in items), False, started, 1234.0, 2)
    return Regression(run, Path("baseline"), "rules.yaml", "", items, ())


def past(count, nights=30):
    names = [judged(k, Path("night")).name for k in range(count)]
    history = (
        Night(
            f"2026-11-{day + 1:02d}T02:00:00+00:00",
            "0.1.0",
            dict.fromkeys(names, "same"),
            frozenset(names[:: day + 1]),
            {MAIN: {name: 0.014 + 1e-3 * math.sin(day + k) for k, name in enumerate(names)}},
        )
        for day in range(nights)
    )
    return Past(history, MAIN)
