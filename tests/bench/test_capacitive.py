"""The capacitive benchmark, small."""

import math

import numpy as np
import pytest

from replay.bench import capacitive
from replay.bench.inputs import box_surface

pytestmark = pytest.mark.compiled  # it measures them


def test_every_method_on_a_box():
    rows = capacitive.on_body("box", box_surface((0.6, 0.5, 0.4)), poses=3, splits=(0, 4), rounds=1)
    found = {row.method: row for row in rows}
    assert len(rows) == 1 + 2 + len(capacitive.TOLERANCES)
    assert not any(row.failed for row in rows)
    assert found["midpoint n=4"].worst_error < found["midpoint n=0"].worst_error
    assert found["tree rtol 1e-06"].worst_error <= 1e-6


def test_experiment_one_finds_the_splits_that_reach_a_millionth():
    rows, splits = capacitive.inclined_plate(1)
    assert splits is not None
    assert 6 <= splits <= 10
    assert not any(row.failed for row in rows)


def test_the_closed_form_reaches_its_digits():
    worst, slivers = capacitive.plate_errors()
    assert 0.0 < worst <= 1e-12
    assert 0.0 < slivers <= 1e-8


def test_judge():
    truth = np.array([1.0, math.inf, 0.0])
    assert not capacitive.judge(np.array([1.0 + 1e-7, math.inf, 0.0]), truth, 1e-6).failed
    assert capacitive.judge(np.array([1.0 + 1e-5, math.inf, 0.0]), truth, 1e-6).wrong == 1
    assert capacitive.judge(np.array([1.0, 5.0, 0.0]), truth, 1e-6).wrong == 1
    assert capacitive.judge(np.array([math.nan, math.inf, 0.0]), truth, math.inf).wrong == 1
