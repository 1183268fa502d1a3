"""Spreads against what they are of: means of noise that is white, coloured, and larger in some places."""

import numpy as np
import pytest

from replay.alignment.spread import BINS, SpreadSums


def share_held(make_noise, n, trials, seed):
    """Return how often the interval of a mean of 0 holds 0."""
    rng = np.random.default_rng(seed)
    time = np.arange(n, dtype=float)
    held = 0
    for _ in range(trials):
        y = make_noise(rng, n)
        mean = y.mean()
        sums = SpreadSums(0.0, n - 1.0)
        column = np.full((1, n), n**-0.5)
        sums.add(sums.bins(time), np.full(n, 1.0 / n), y - mean, float(y.std()), column)
        held += abs(mean) <= sums.spread(np.zeros((0, BINS))).half(0.95)
    return held / trials


def white(rng, n):
    return rng.normal(size=n)


def coloured(rng, n):
    """Noise with a memory of 10 samples."""
    from scipy.signal import lfilter

    return lfilter([1.0], [1.0, -0.9], rng.normal(size=n + 100))[100:]


def larger_in_the_middle(rng, n):
    return rng.normal(size=n) * (1.0 + 3.0 * np.sin(np.linspace(0.0, np.pi, n)))


@pytest.mark.parametrize("noise", [white, coloured, larger_in_the_middle])
def test_the_interval_of_a_mean_holds_it_in_95_of_100(noise):
    """400 trials: a standard deviation of 1.1 %."""
    assert 0.92 <= share_held(noise, 2000, 400, seed=1) <= 0.98


def test_as_many_cosines_as_degrees_of_freedom_are_the_textbook_interval_of_a_mean():
    """Of 13 samples the 12 cosines hold everything but the mean, whatever the order of samples."""
    y = np.random.default_rng(2).normal(size=13)
    y -= y.mean()
    sums = SpreadSums(0.0, 12.0)
    sums.add(sums.bins(np.arange(13.0)), np.full(13, 1 / 13), y, 1.0, np.full((1, 13), 13**-0.5))
    spread = sums.spread(np.zeros((0, BINS)))
    assert spread.freedom == pytest.approx(12.0, rel=1e-9)
    assert spread.deviation == pytest.approx(np.std(y, ddof=1) / np.sqrt(13), rel=1e-9)


def test_few_samples_have_few_degrees_of_freedom():
    sums = SpreadSums(0.0, 4.0)
    y = np.array([1.0, -2.0, 0.5, 1.5, -1.0])
    sums.add(sums.bins(np.arange(5.0)), np.full(5, 0.2), y, 1.0, np.full((1, 5), 5**-0.5))
    assert 1.0 <= sums.spread(np.zeros((0, BINS))).freedom <= 4.0 + 1e-9


def test_what_lines_may_be_off_is_added_to_what_is_seen():
    sums, weight = SpreadSums(0.0, 12.0), np.full(13, 1 / 13)
    sums.add(sums.bins(np.arange(13.0)), weight, np.zeros(13), 1.0, np.full((1, 13), 13**-0.5))
    sums.hide(weight, np.full(13, 2.0), np.zeros(13))
    assert sums.spread(np.zeros((0, BINS))).deviation == pytest.approx(2.0 / np.sqrt(13.0), rel=1e-12)


def test_jumps_are_off_all_alike():
    """At round times they all are as far from the frame before: their mean is no better known than one of them."""
    sums, weight = SpreadSums(0.0, 12.0), np.full(13, 1 / 13)
    sums.add(sums.bins(np.arange(13.0)), weight, np.zeros(13), 1.0, np.full((1, 13), 13**-0.5))
    sums.hide(-weight, np.zeros(13), np.full(13, 2.0))
    assert sums.spread(np.zeros((0, BINS))).deviation == pytest.approx(2.0, rel=1e-12)
