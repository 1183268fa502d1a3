"""Random numbers by their place: statistics under fixed seeds, and that blocks do not matter."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from scipy import stats

from replay.sensing.signal.noise import noise_key, random_numbers

SAMPLES = 100_000
KEYS = {
    place: noise_key(*place)
    for place in ((7, "distance", "a"), (7, "distance", "b"), (7, "capacitive", "a"), (8, "distance", "a"))
}


@pytest.mark.parametrize("place", KEYS)
def test_mean_deviation_and_shape_are_those_of_the_normal_distribution(place: tuple[int, str, str]) -> None:
    normal, uniform = random_numbers(KEYS[place], 0, SAMPLES)
    assert abs(normal.mean()) < 4.0 / math.sqrt(SAMPLES)
    assert abs(normal.std() - 1.0) < 4.0 / math.sqrt(2.0 * SAMPLES)
    assert stats.kstest(normal, "norm").pvalue > 1e-3
    assert stats.kstest(uniform, "uniform").pvalue > 1e-3
    assert uniform.min() >= 0.0
    assert uniform.max() < 1.0


@pytest.mark.parametrize("place", KEYS)
def test_samples_are_white(place: tuple[int, str, str]) -> None:
    for values in random_numbers(KEYS[place], 0, SAMPLES):
        centred = (values - values.mean()) / values.std()
        lags = np.array([np.mean(centred[lag:] * centred[:-lag]) for lag in range(1, 50)])
        # under whiteness lags are normal with 1 / sqrt(n), and their squares add up to a chi-squared number
        assert np.abs(lags).max() < 4.5 / math.sqrt(SAMPLES)
        assert stats.chi2.sf(SAMPLES * np.sum(lags**2), len(lags)) > 1e-3


def test_sensors_kinds_seeds_and_both_numbers_are_independent() -> None:
    columns = [values for key in KEYS.values() for values in random_numbers(key, 0, SAMPLES)]
    for a, b in itertools.combinations(columns, 2):
        assert abs(np.corrcoef(a, b)[0, 1]) < 4.5 / math.sqrt(SAMPLES)


def test_a_samples_numbers_depend_on_its_place_alone() -> None:
    key = noise_key(3, "distance", "tip")
    whole = np.stack(random_numbers(key, 0, 500))
    for first, count in ((0, 1), (1, 1), (17, 83), (499, 1), (250, 0)):
        assert np.array_equal(np.stack(random_numbers(key, first, count)), whole[:, first : first + count])


def test_the_numbers_stay_for_ever() -> None:
    """Of other releases: recordings of noise are compared."""
    normal, uniform = random_numbers(noise_key(7, "capacitive", "side"), 1000, 3)
    np.testing.assert_allclose(normal, FROZEN[0], rtol=1e-14)
    np.testing.assert_allclose(uniform, FROZEN[1], rtol=0)


FROZEN = (
    [-0.260114812807218, 0.39432835002766925, -0.7046348597552978],
    [0.22948715853781898, 0.5182045740416164, 0.17237180362692128],
)
