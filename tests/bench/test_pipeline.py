"""The pipeline benchmark with a body of 1 000 triangles."""

from types import SimpleNamespace

import numpy as np
import pytest

from replay.bench import pipeline
from replay.bench.runner import Readings
from replay.errors import ScenarioError

pytestmark = pytest.mark.compiled  # it measures them


def test_all_models_and_the_peer(small):
    report = pipeline.run(quick=True, rounds=1, frames=6, scene=small)
    rows = {row.method: row for row in report.tables[pipeline.TABLE]}
    assert list(rows) == [pipeline.DEFAULT, pipeline.FAST, pipeline.THESIS, pipeline.PEER]
    assert not any(row.failed for row in rows.values())
    assert rows[pipeline.DEFAULT].worst_error <= 1e-6
    assert rows[pipeline.FAST].worst_error <= 1e-4
    stages = report.grids[pipeline.STAGES].lines
    parts = {"kinematics", "broad phase", "narrow phase", "distance", "capacitive", "recording"}
    assert {stage for stage, taken in stages[0].items() if taken} == parts | {"method"}
    assert [goal.key for goal in report.goals] == ["pipeline.peer", "pipeline.real_time"]
    assert all(goal.measured > 0.0 and not goal.wrong for goal in report.goals)
    assert len(report.grids[pipeline.SENSORS].lines[0]) == 1 + 4 + 6
    errors = next(grid for title, grid in report.grids.items() if title.startswith("worst relative error")).lines
    assert [line["method"] for line in errors] == list(rows)
    sensors = list(small.sensors.distance) + list(small.sensors.capacitive)
    assert max(float(errors[3][name]) for name in sensors) > 1e-6  # 256 points a triangle, and rays see no border


def test_a_wrong_reading_is_wrong_however_small_the_rest():
    layout = SimpleNamespace(distance_sensors=("d",), capacitive_sensors=("c",))
    truth = Readings(np.zeros((2, 3), dtype=bool), np.array([[1.0], [np.nan]]), np.array([[0.0], [2.0]]))

    def verdict(contact=False, distance=1.0, capacitance=2.0):
        found = Readings(truth.contact | contact, np.array([[distance], [np.nan]]), np.array([[0.0], [capacitance]]))
        return pipeline.judge(pipeline.errors_of(found, truth, layout), layout, 1e-6)

    assert not verdict().failed
    assert verdict(contact=True).failed
    assert verdict(distance=np.nan).failed
    assert verdict(distance=1.0 + 1e-9).failed
    assert verdict(capacitance=2.0 + 1e-5).failed
    assert verdict(capacitance=np.nan).failed
    assert verdict(capacitance=np.inf).failed
    assert not verdict(capacitance=2.0 + 1e-6).failed


def test_a_missing_body_is_said(monkeypatch):
    def missing():
        raise ScenarioError([])

    monkeypatch.setattr(pipeline, "scenario", missing)
    report = pipeline.run(quick=True)
    (row,) = report.tables[pipeline.TABLE]
    assert row.rounds == 0
    assert [goal.verdict for goal in report.goals] == ["not measured", "not measured"]


def test_the_shipped_scene_has_what_the_goal_names():
    scenario = pipeline.scenario()
    assert len(scenario.sensors.distance) == 4
    assert [len(sensor.plates) for sensor in scenario.sensors.capacitive.values()] == [3] * 6
