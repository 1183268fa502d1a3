"""Statistics of residuals against NumPy and closed forms, and slips that are named."""

import numpy as np
import pytest

from replay.alignment.clock import ClockEstimate, LogClock
from replay.alignment.hints import hints
from replay.alignment.pair import SignalPair
from replay.alignment.residuals import match
from replay.alignment.statistics import statistics

FRAMES = np.arange(361) / 60.0
VALUE = np.sin(FRAMES) + 0.3 * np.cos(3.1 * FRAMES) + 2.0


def matched_of(change, *, noise=0.0, shift=0.0, seed=1, steps=False):
    log_time = np.arange(-60, 661) / 100.0
    value = np.sin(log_time - shift) + 0.3 * np.cos(3.1 * (log_time - shift)) + 2.0
    measured = change(value) + noise * np.random.default_rng(seed).normal(size=len(log_time))
    return match(SignalPair("/a", FRAMES, VALUE, log_time, measured, steps), LogClock(0.0), max_gap=0.05)


def test_numbers_are_those_of_numpy():
    matched = matched_of(lambda v: 1.1 * v - 0.2, noise=0.1)
    found, r = statistics(matched), matched.residual
    assert found.count == len(r) == 361
    assert found.bias == pytest.approx(np.mean(r), rel=1e-12)
    assert found.rms == pytest.approx(np.sqrt(np.mean(r**2)), rel=1e-12)
    assert abs(found.largest) == np.max(np.abs(r))
    assert matched.residual[found.frame] == found.largest
    assert found.percentiles == pytest.approx(np.percentile(r, [5, 50, 95]), rel=1e-12)
    assert found.correlation == pytest.approx(np.corrcoef(matched.simulated, matched.measured)[0, 1], rel=1e-12)


def test_without_noise_scale_and_offset_are_exact():
    """Measured on the lines between frames: nothing is left."""
    log_time = np.arange(0, 601) / 100.0
    measured = -3.0 * np.interp(log_time, FRAMES, VALUE) + 7.0
    fit = statistics(match(SignalPair("/a", FRAMES, VALUE, log_time, measured), LogClock(0.0), max_gap=0.05)).fit
    assert fit.scale == pytest.approx(-3.0, rel=1e-12)
    assert fit.offset == pytest.approx(7.0, rel=1e-12)


def test_intervals_of_scale_and_offset_hold_the_truth():
    """300 trials: a standard deviation of 1.3 %."""
    held = []
    for seed in range(300):
        fit = statistics(matched_of(lambda v: 1.5 * v - 0.2, noise=0.3, seed=seed)).fit
        held.append(
            (
                fit.scale_interval[0] <= 1.5 <= fit.scale_interval[1],
                fit.offset_interval[0] <= -0.2 <= fit.offset_interval[1],
            )
        )
    assert all(0.91 <= share <= 0.985 for share in np.mean(held, axis=0))


def test_what_is_not_known_of_the_clock_widens_the_intervals():
    sure = matched_of(lambda v: v, noise=0.01)
    clock = ClockEstimate(0.0, offset_interval=(-0.2, 0.2), spread=(0.5, 0.0))
    unsure = match(sure.pair, clock, max_gap=0.05)
    widths = [np.diff(statistics(one).fit.offset_interval)[0] for one in (sure, unsure)]
    assert widths[1] > 3.0 * widths[0]


def test_nothing_to_compare_is_an_answer_of_its_own():
    empty = match(SignalPair("/a", FRAMES, VALUE, np.zeros(0), np.zeros(0)), LogClock(0.0), max_gap=1.0)
    found = statistics(empty)
    assert (found.count, found.frame, found.fit) == (0, -1, None)
    assert np.isnan([found.bias, found.rms, found.largest, *found.percentiles, found.correlation]).all()
    assert hints(empty, found) == ()


def test_constant_signals_have_no_correlation_and_no_scale():
    log_time = np.arange(0, 601) / 100.0
    pair = SignalPair("/a", FRAMES, np.full(361, 2.0), log_time, np.full(601, 2.5))
    found = statistics(match(pair, LogClock(0.0), max_gap=0.05))
    assert found.bias == found.rms == found.largest == 0.5
    assert np.isnan(found.correlation)
    assert found.fit is None


def test_states_have_no_scale():
    assert statistics(matched_of(lambda v: (v > 2.0).astype(float), steps=True)).fit is None


@pytest.mark.parametrize("size", [1e-200, 1e200])
def test_sizes_at_the_ends_of_the_numbers_are_no_error(size):
    log_time = np.arange(0, 601) / 100.0
    measured = 1.5 * size * np.interp(log_time, FRAMES, VALUE)
    found = statistics(match(SignalPair("/a", FRAMES, size * VALUE, log_time, measured), LogClock(0.0), max_gap=0.05))
    assert found.rms > 0.0
    assert found.fit.scale == pytest.approx(1.5, rel=1e-9)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda v: 1000.0 * v, "1000 times"),
        (lambda v: v / 1000.0, "0.001 times"),
        (np.degrees, "degrees"),
        (np.radians, "radians"),
        (lambda v: -v, "sign"),
        (lambda v: v + 0.7, "a constant of 0.7"),
    ],
)
def test_slips_are_named(change, words):
    matched = matched_of(change, noise=1e-4)
    found = hints(matched, statistics(matched))
    assert len(found) == 1
    assert words in found[0]


def test_a_delay_of_one_signal_is_named():
    matched = matched_of(lambda v: v, noise=0.01, shift=0.25)
    (found,) = hints(matched, statistics(matched))
    assert "a delay of 25" in found
    assert "of this signal alone" in found


@pytest.mark.parametrize("change", [lambda v: v, lambda v: 1.2 * v - 0.1, lambda v: v * v, lambda v: 500.0 * v])
def test_where_no_slip_explains_it_none_is_named(change):
    matched = matched_of(change, noise=0.1)
    assert hints(matched, statistics(matched)) == ()
