"""The benchmark of savings, small."""

import copy

import numpy as np
import pytest

from replay.bench import savings

pytestmark = pytest.mark.compiled  # it measures them


def test_rules_are_counted_and_results_are_the_same(small):
    report = savings.run(frames=3, scene=small)
    rules = {line["rule"]: line for line in report.grids[savings.RULES].lines}
    shares = {rule: float(line["share"].rstrip("%")) for rule, line in rules.items()}
    assert all(0.0 <= share <= 100.0 for share in shares.values())
    assert shares["pairs that cannot move are decided once"] > 0.0
    assert shares["all of these: no GJK"] > 50.0
    assert shares["box trees, the last frame's nearest sets, clearance only near"] > 90.0
    assert [goal.verdict for goal in report.goals] == ["met"]
    times = report.grids[savings.TIMES].lines
    assert float(times[-1]["ratio"]) > 1.0


def test_one_value_that_differs_is_found(small):
    runner = savings.Runner(small, savings.MODELS["replay, rtol 1e-6"])
    few = [290, 300]  # the detector touches the body
    blocks = runner.blocks(few)
    for stage, column, change, expected in (
        ("collision", "clearance", lambda x: x + 1e-15, 0),
        ("collision", "clearance", lambda x: x + 1e-9, 1),
        ("collision", "level", lambda x: x + 1, 1),
        ("capacitive", "capacitance", lambda x: x * (1.0 + 1e-7), 0),
        ("capacitive", "capacitance", lambda x: x * (1.0 + 1e-5), 1),
        ("capacitive", "capacitance", lambda _: np.nan, 1),
        ("distance", "distance", lambda _: np.inf, 1),
    ):
        others = copy.deepcopy(blocks)
        values = getattr(others[0][stage], column)
        place = tuple(np.argwhere(np.isfinite(values))[0])
        values[place] = change(values[place])
        assert savings.compare(blocks, others, range(2), 1e-6)[1] == expected, (stage, column)
