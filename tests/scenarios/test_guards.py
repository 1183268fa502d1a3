"""The shipped scenarios in which the machine reacts: what they show, held against closed forms."""

from pathlib import Path

import pytest

import replay
from replay.batch.case import CaseOrder, CaseStatus, run_case
from replay.scenario.load import load_cases

pytestmark = pytest.mark.compiled  # phantoms of thousands of triangles

SCENARIOS = Path(__file__).parents[2] / "scenarios"
SPEED, DECELERATION = 0.125, 0.5  # of the table: half its limit, and its limit


def done(scenario, folder):
    return run_case(CaseOrder(scenario, folder, rrd=False), lambda frames, total: None)


@pytest.mark.parametrize("name", ["carm_bodyguard_stops", "carm_bodyguard_stops_thesis"])
def test_the_table_stops_before_the_head_touches(name, tmp_path):
    result = done(replay.load(SCENARIOS / f"{name}.yaml"), tmp_path)
    assert result.status is CaseStatus.PASSED
    (stop,) = result.guards
    way = SPEED * 0.05 + SPEED**2 / (2.0 * DECELERATION)
    assert stop["joints"][0]["stopping_distance"] == pytest.approx(way, rel=1e-12)
    assert stop["stopping_time"] == pytest.approx(0.05 + SPEED / DECELERATION, rel=1e-12)
    assert 0.02 < stop["clearance_at_stop"] < 0.1


def test_a_sensor_that_is_too_slow_lets_them_meet(tmp_path):
    result = done(replay.load(SCENARIOS / "carm_bodyguard_stops_late.yaml"), tmp_path)
    assert result.status is CaseStatus.PASSED
    (stop,) = result.guards
    assert stop["clearance_at_stop"] == 0.0
    assert stop["contact_speed"]["table_long"] > 0.1


def test_the_way_grows_with_the_reaction_time_as_the_closed_form_says(tmp_path):
    cases = load_cases(SCENARIOS / "carm_bodyguard_reaction.yaml")
    left = []
    for case in cases:
        (stop,) = done(case, tmp_path / case.name).guards
        reaction = case.guards["patient"].reaction
        way = SPEED * reaction + SPEED**2 / (2.0 * DECELERATION)
        assert stop["joints"][0]["stopping_distance"] == pytest.approx(way, rel=1e-12)
        left.append(stop["clearance_at_stop"])
    assert left == sorted(left, reverse=True)
