"""The pipeline benchmark with a body of 1 000 triangles."""

from importlib import resources

import pytest

from replay.bench import pipeline
from replay.errors import ScenarioError
from replay.scenario.load import load


@pytest.fixture
def small(tmp_path):
    text = resources.files("replay.bench").joinpath("pipeline.yaml").read_text()
    file = tmp_path / "small.yaml"
    file.write_text(text.replace("adult_male.stl", "adult_male_reduced_1000t.stl"))
    return load(file)


def test_all_models_and_the_peer(small):
    report = pipeline.run(quick=True, rounds=1, frames=6, scene=small)
    rows = {row.method: row for row in report.tables[pipeline.TABLE]}
    assert list(rows) == [pipeline.DEFAULT, pipeline.FAST, pipeline.THESIS, pipeline.PEER]
    assert not any(row.failed for row in rows.values())
    assert rows[pipeline.DEFAULT].worst_error <= 1e-6
    assert rows[pipeline.FAST].worst_error <= 1e-4
    stages = report.grids[pipeline.STAGES].lines
    assert set(stages[0]) == {"method", "kinematics", "collision", "distance", "capacitive"}
    assert [goal.required for goal in report.goals] == [100.0, 5.0]


def test_a_missing_body_is_said(monkeypatch):
    def missing():
        raise ScenarioError([])

    monkeypatch.setattr(pipeline, "scenario", missing)
    (row,) = pipeline.run(quick=True).tables[pipeline.TABLE]
    assert row.rounds == 0


def test_the_shipped_scene_has_what_the_goal_names():
    scenario = pipeline.scenario()
    assert len(scenario.sensors.distance) == 4
    assert [len(sensor.plates) for sensor in scenario.sensors.capacitive.values()] == [3] * 6
