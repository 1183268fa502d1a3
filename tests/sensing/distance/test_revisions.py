"""Frozen readings: a method whose readings change must get a new revision, or a night's comparison is meaningless."""

import json
from pathlib import Path

import numpy as np
import pytest

from replay.scenario.methods import METHOD_REVISIONS
from replay.sensing.distance import DistanceSuite
from replay.sensing.distance.suite import METHODS
from tests.sensing.distance.test_suite import SENSORS, TARGETS, machine, moving

FROZEN = Path(__file__).parents[2] / "data" / "distance_readings.json"


@pytest.mark.parametrize("method", METHODS)
def test_readings_of_this_revision_are_frozen(method):
    key = f"distance.{method}@{METHOD_REVISIONS[f'distance.{method}']}"
    frozen = json.loads(FROZEN.read_text())
    assert key in frozen, f"freeze the readings of {key} in {FROZEN}"
    expected = np.array(frozen[key], dtype=float)  # null becomes NaN
    columns = DistanceSuite(SENSORS, TARGETS, method=method, count=61).run(moving(machine(), frames=20))
    message = f"readings of {method} changed: if that is meant, raise its revision and freeze the new readings"
    np.testing.assert_allclose(columns.distance, expected, rtol=1e-9, atol=1e-12, err_msg=message)
