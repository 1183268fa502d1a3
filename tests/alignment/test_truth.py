"""Intervals cover the truth as often as they say, for logs made of recordings; what cannot be told is refused."""

import numpy as np
import pytest

from replay.alignment.clock import Undetermined
from replay.alignment.estimate import estimate_clock
from replay.alignment.statistics import best_line
from tests.alignment.injected import BASELINES, injected, recorded

SOME = ("carm_head_contact", "carm_parking", "panda_meets_person", "carm_bodyguard_stops")


def tally(count, names, seed):
    """Return how often intervals hold the truth, errors of the offset in samples, and how many logs are refused."""
    rng = np.random.default_rng(seed)
    held = {"offset": [], "drift": [], "scale": [], "bias": []}
    refused = 0
    for number in range(count):
        log = injected(rng, names[number % len(names)], drifts=number % 2 == 0)
        clock = estimate_clock(log.pairs, drift=log.drift != 0.0, lowest=-2.5, highest=2.5)
        if isinstance(clock, Undetermined):
            refused += 1
            continue
        low, high = clock.offset_interval
        held["offset"].append(low <= log.offset_at(clock.reference) <= high)
        if log.drift:
            held["drift"].append(clock.drift_interval[0] <= log.drift <= clock.drift_interval[1])
        for pair in log.pairs:
            line = best_line(pair, clock, confidence=0.95)
            if line is not None:
                held["scale"].append(line.scale_interval[0] <= log.scale[pair.name] <= line.scale_interval[1])
                held["bias"].append(line.offset_interval[0] <= log.bias[pair.name] <= line.offset_interval[1])
    return {name: float(np.mean(values)) for name, values in held.items()}, refused / count


def test_intervals_hold_the_truth_in_a_sample_of_logs():
    """Of 80 logs, between 87 and 100 % would be expected of 95 % by chance in 99 of 100 samples."""
    held, refused = tally(80, SOME, seed=1)
    assert min(held.values()) >= 0.87, held
    assert refused < 0.2


@pytest.mark.soak
def test_intervals_hold_the_truth_in_a_thousand_logs():
    names = sorted(path.name for path in BASELINES.iterdir() if (path / f"{path.name}.mcap").exists())
    held, refused = tally(1000, names, seed=101)
    assert all(0.93 <= share <= 0.97 for share in held.values()), held
    assert refused < 0.15


def errors(rate, count, seed):
    """Return errors of offsets [samples] and what the lower bound of Cramér and Rao is for them, at 20 dB."""
    rng = np.random.default_rng(seed)
    found = []
    for number in range(count):
        name = SOME[number % len(SOME)]
        log = injected(rng, name, drifts=False, signals=len(recorded(name)[1]), rate=rate, decibel=20.0, clean=True)
        clock = estimate_clock(log.pairs, drift=False, lowest=-2.5, highest=2.5)
        information = 0.0
        for pair in log.pairs:
            at = np.sort(pair.measured_time + log.offset)
            slope = np.interp(at, pair.time, np.gradient(pair.value, pair.time)) / np.nanstd(pair.value)
            value = np.interp(at, pair.time, pair.value)
            there = np.isfinite(slope) & np.isfinite(value)
            columns = np.stack([np.ones(there.sum()), value[there]], axis=1)
            off = slope[there] - columns @ np.linalg.lstsq(columns, slope[there], rcond=None)[0]
            information += off @ off / 0.1**2
        found.append(((clock.offset - log.offset) / log.sample, information**-0.5 / log.sample))
    return np.array(found).T


@pytest.mark.parametrize("rate", [60.0, 500.0])
def test_offsets_at_20_dB_are_as_good_as_the_noise_allows(rate):
    """What noise allows at best is the bound of Cramér and Rao; at 500 Hz it is a twentieth of a frame or less."""
    error, bound = errors(rate, 12, seed=3)
    assert np.sqrt(np.mean((error / bound) ** 2)) < 1.7


@pytest.mark.soak
def test_offsets_at_20_dB_are_within_a_twentieth_of_a_frame():
    error, bound = errors(500.0, 100, seed=4)
    assert np.sqrt(np.mean((error / bound) ** 2)) < 1.2
    assert np.median(np.abs(error)) <= 0.05
