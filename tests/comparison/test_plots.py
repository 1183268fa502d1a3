"""Drawings of signals, read back from their paths: what is drawn is what both runs hold."""

import re

import numpy as np
import pytest

from replay.comparison.plots import HEIGHT, LOWER, WIDTH, plots
from replay.comparison.rules import Rule, Rules, Tolerance
from replay.comparison.runs import RecordingPair, diff_pair
from tests.comparison import made_up

BASELINE = made_up.recording()
NAME = "/joint_states/position/lift"
TENTH = 0.051  # of a pixel: paths have one digit


def moved(recording):
    recording.joint_positions[:, 0] = 0.5 - 0.7 * recording.joint_positions[:, 0]
    recording.joint_positions[50, 0] = 3.0
    recording.collision.level[40:42, 0] = 1


@pytest.fixture(scope="module")
def runs():
    """Baseline, candidate and the drawings by signal; the joint may be 0.25 m off."""
    candidate = made_up.altered(BASELINE, moved)
    pair = RecordingPair(BASELINE, candidate)
    rules = Rules((Rule(("/joint_states/*",), Tolerance(abs=0.25), "it is loose"),))
    return BASELINE, candidate, {plot.signal: plot for plot in plots(diff_pair(pair, rules=rules), pair)}


def points(path):
    """The points of a path of straight lines, (n, 2)."""
    return np.array([(float(x), float(y)) for x, y in re.findall(r"[ML](-?[\d.]+) (-?[\d.]+)", path)])


def upper(plot, values):
    """Where values are drawn, from the top."""
    return HEIGHT * (plot.high - values) / (plot.high - plot.low)


def test_values_are_drawn_over_time_between_the_least_and_the_largest(runs):
    baseline, candidate, drawn = runs
    plot = drawn[NAME]
    a, b = baseline.joint_positions[:, 0], candidate.joint_positions[:, 0]
    assert (plot.low, plot.high) == (min(a.min(), b.min()), 3.0)
    assert (plot.begin, plot.end) == (0.0, pytest.approx(99 / made_up.RATE))
    for path, values in ((plot.baseline, a), (plot.candidate, b)):
        x, y = points(path).T
        np.testing.assert_allclose(x, np.linspace(0.0, WIDTH, 100), rtol=0, atol=TENTH)
        np.testing.assert_allclose(y, upper(plot, values), rtol=0, atol=TENTH)


def test_the_band_is_what_the_tolerance_accepts_on_both_sides(runs):
    baseline, _, drawn = runs
    plot = drawn[NAME]
    x, y = points(plot.band).T
    a = baseline.joint_positions[:, 0]
    np.testing.assert_allclose(x, np.concatenate([np.linspace(0, WIDTH, 100), np.linspace(WIDTH, 0, 100)]), atol=TENTH)
    np.testing.assert_allclose(y[:100], upper(plot, a + 0.25), rtol=0, atol=TENTH)
    np.testing.assert_allclose(y[:99:-1], upper(plot, a - 0.25), rtol=0, atol=TENTH)


def test_the_difference_is_drawn_below_with_its_limit_and_marks_where_it_is_beyond(runs):
    baseline, candidate, drawn = runs
    plot = drawn[NAME]
    error = np.abs(baseline.joint_positions[:, 0] - candidate.joint_positions[:, 0])
    assert plot.largest == error.max()
    np.testing.assert_allclose(points(plot.error)[:, 1], LOWER * (1.0 - error / error.max()), rtol=0, atol=TENTH)
    np.testing.assert_allclose(points(plot.limit)[:, 1], LOWER * (1.0 - 0.25 / error.max()), rtol=0, atol=TENTH)
    beyond = np.linspace(0.0, WIDTH, 100)[error > 0.25]
    np.testing.assert_allclose(plot.marks, beyond, rtol=0, atol=0.5)


def test_states_are_steps_and_have_no_band(runs):
    plot = next(plot for signal, plot in runs[2].items() if "level" in signal or "/collision/" in signal)
    assert plot.band == plot.limit == "" and "L" not in plot.baseline and "H" in plot.baseline
    assert [mark[1] for mark in plot.levels] and len(plot.marks) == 2


def test_what_is_expected_of_a_clearance_is_drawn_at_its_height():
    def nearer(recording):
        recording.collision.clearance[25, 0] = 0.004

    pair = RecordingPair(BASELINE, made_up.altered(BASELINE, nearer))
    found = diff_pair(pair, rules=None)
    (plot,) = plots(found, pair, {made_up.LAYOUT.pairs[0]: 0.2})
    assert plot.high == 0.2
    ((at, _),) = plot.bounds
    assert at == pytest.approx(0.0, abs=TENTH)
    (bare,) = plots(found, pair)
    assert bare.bounds == () and bare.high == np.nanmax(BASELINE.collision.clearance)
