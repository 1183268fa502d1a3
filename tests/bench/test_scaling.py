"""The scaling benchmark, small."""

import json
import math

import numpy as np
import pytest

from replay.bench import broad_phase, scaling, set_up
from replay.bench.report import Report

pytestmark = pytest.mark.compiled  # it measures them


def test_every_law_has_points_and_an_exponent(small, monkeypatch):
    monkeypatch.setattr(scaling, "FRAMES", (2, 4))
    monkeypatch.setattr(scaling, "TRIANGLES", (100, 400))
    monkeypatch.setattr(scaling, "SENSORS", (1, 3))
    monkeypatch.setattr(broad_phase, "growth", lambda *_, **__: None)  # has a test of its own
    monkeypatch.setattr(set_up, "growth", lambda *_, **__: None)
    monkeypatch.setattr(scaling, "workers", lambda *_: scaling.Grid([{"workers": 1}]))  # so has this
    report = scaling.run(rounds=1, scene=small)
    assert len(report.tables) == len(report.plots) == 3
    assert not any(row.failed for rows in report.tables.values() for row in rows)
    for plot in report.plots:
        assert all(len(points) == 2 and min(min(point) for point in points) > 0.0 for points in plot.lines.values())
    assert sum("grows like n^" in note and "nan" not in note for note in report.notes) == 1 + 4 + 2
    json.dumps(report.as_json(), allow_nan=False)


def test_workers_run_the_same_scenarios():
    (line,) = scaling.workers(2, 20, counts=(2,)).lines
    assert line["workers"] == 2
    assert float(line["seconds"]) > 0.0


def test_readings_that_are_none_are_wrong():
    assert scaling._seen(np.array([[math.nan]])).failed
    assert not scaling._seen(np.array([[math.nan, 1.0]])).failed
    assert scaling._felt(np.array([[math.nan]])).failed
    assert scaling._felt(np.array([[-1.0]])).failed


def test_set_up_is_timed_for_each_body():
    report = Report("scaling")
    set_up.growth(report, sizes=(300, 2000), rounds=1)
    (rows,) = report.tables.values()
    counts = [int(row.case.split()[-2]) for row in rows]
    assert len(rows) == 6 and counts == pytest.approx([300, 2000] * 3, rel=0.4)
    assert all(row.median > 0.0 for row in rows) and len(report.notes) == 3


def test_of_the_times_of_set_up_the_least_the_middle_and_the_largest_are_told(monkeypatch):
    report, times = Report("scaling"), iter([9.0, 3.0, 1.0, 2.0] * 3)
    monkeypatch.setattr(set_up, "_seconds", lambda triangles: next(times))  # the first one of a body is not told
    set_up.growth(report, sizes=(300,), rounds=3)
    (rows,) = report.tables.values()
    assert [(row.low, row.median, row.high, row.rounds) for row in rows] == [(1.0, 2.0, 3.0, 3)] * 3


def test_growth_needs_two_sizes():
    report = Report("scaling")
    broad_phase.growth(report, most=30, rounds=1)
    assert len(report.plots) == 1
