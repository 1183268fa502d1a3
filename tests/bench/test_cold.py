"""What compiling costs, as it is told; measuring it takes minutes."""

import pytest

from replay.bench import cold
from replay.bench.goals import Goal
from replay.bench.report import Report


@pytest.mark.parametrize("quick", [False, True])
def test_kernels_are_listed_by_what_they_cost_beside_numbas_own_decorator(monkeypatch, quick):
    measured = {
        "ours": (2.5, {"a.quick": 0.5, "a.slow": 2.0}),
        "plain": (7.5, {"a.quick": 3.0, "a.slow": 4.0, "b": 0.5}),
    }
    monkeypatch.setattr(cold, "_compiling", lambda how, scenes: measured[how])
    monkeypatch.setattr(cold, "_first_run", lambda name: {"scenario": name})
    report = Report("cold")
    cold.measure(report, quick=quick)
    told = [
        {"kernel": "a.slow", "CPU [s]": "2.00"},
        {"kernel": "a.quick", "CPU [s]": "0.50"},
        {"kernel": "all 2", "CPU [s]": "2.5"},
    ]
    if not quick:
        told.append({"kernel": "all 3, by numba's public decorator", "CPU [s]": "7.5"})
    assert report.grids[cold.KERNELS].lines == told
    assert report.goals == ([] if quick else [Goal("cold.kernels", 3.0)])
    names = [line["scenario"] for line in report.grids[cold.SCENES].lines]
    assert names == sorted(names[:2]) if quick else len(names) > 10
