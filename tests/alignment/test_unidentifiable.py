"""Families of logs that do not tell their clock: each is refused, whatever noise, rate and place are."""

import numpy as np
import pytest

from replay.alignment.clock import ClockEstimate, Undetermined
from replay.alignment.estimate import estimate_clock
from replay.alignment.pair import SignalPair

FRAMES = np.arange(361) / 60.0
SEEDS = range(10)


def hill(t):
    return np.exp(-(((t - 2.5) / 0.6) ** 2)) + 0.3 * np.tanh(t - 4.0)


def swing(t, begin=0.5, end=4.0):
    u = np.clip((t - begin) / (end - begin), 0.0, 1.0)
    return u * u * (3.0 - 2.0 * u)


def trapezoid(t):
    return np.clip(t - 1.0, 0.0, 3.0)


def log_times(rng, begin, end, offset):
    """Return times of a log's samples that lie between two times of the scenario, at 20 to 500 Hz with jitter."""
    rate = np.exp(rng.uniform(np.log(20.0), np.log(500.0)))
    time = np.arange(begin, end, 1.0 / rate) - offset
    return np.sort(time + rng.uniform(-0.1, 0.1, len(time)) / rate)


def measured(rng, function, log_time, offset, *, drift=0.0, noise=(0.0, 0.01, 0.1), name="/a", frames=FRAMES):
    value = function(log_time + offset + drift * log_time)
    value = value + rng.choice(noise) * np.std(value) * rng.normal(size=len(log_time))
    return SignalPair(name, frames, function(frames), log_time, value)


def coloured(rng, count):
    width = int(rng.choice([1, 3, 10, 30]))
    return np.convolve(rng.normal(size=count), np.full(width, 1.0 / width), "same")


def a_ramp_beside_a_curve(rng):
    time = np.arange(0.0, rng.uniform(1.0, 6.0), 0.01)
    value = rng.normal() * time + rng.normal() + rng.choice([0.0, 0.01, 0.1]) * rng.normal(size=len(time))
    return [SignalPair("/a", FRAMES, rng.choice([swing, hill])(FRAMES), time, value)]


def a_ramp_out_of_a_motion_with_corners(rng):
    begin, offset = rng.uniform(1.2, 2.0), rng.uniform(-2.0, 2.0)
    return [measured(rng, trapezoid, log_times(rng, begin, begin + rng.uniform(0.6, 1.7), offset), offset)]


def a_decay_that_is_itself_again_later(rng):
    lasts, offset = rng.uniform(0.5, 3.0), rng.uniform(-1.0, 1.0)
    return [measured(rng, lambda t: np.exp(-t / lasts), log_times(rng, 0.5, 5.5, offset), offset)]


def two_motions_of_one_period(rng):
    period, offset = rng.uniform(0.5, 1.2), rng.uniform(-1.0, 1.0)
    time = log_times(rng, 0.0, 6.0, offset)
    motions = {"/a": lambda t: np.sin(2.0 * np.pi * t / period), "/b": lambda t: np.abs(np.sin(np.pi * t / period))}
    return [measured(rng, motion, time, offset, name=name) for name, motion in motions.items()]


def a_sum_of_two_periods(rng):
    period, offset = rng.uniform(0.25, 0.4), rng.uniform(-1.0, 1.0)
    both = lambda t: np.sin(np.pi * t / period) + 0.7 * np.sin(2.0 * np.pi * t / period / 3.0)  # noqa: E731
    return [measured(rng, both, log_times(rng, 0.0, 6.0, offset), offset)]


def a_period_with_a_drift(rng):
    period, offset, frames = rng.uniform(0.3, 1.2), rng.uniform(-1.0, 1.0), np.arange(0.0, 60.0, 1.0 / 60.0)
    time = np.arange(0.0, rng.uniform(20.0, 60.0), 0.01) - offset
    motion = lambda t: np.sin(2.0 * np.pi * t / period)  # noqa: E731
    return [measured(rng, motion, time, offset, drift=rng.uniform(-1e-3, 1e-3), noise=(0.03, 0.3), frames=frames)]


def a_constant(rng):
    time = log_times(rng, 0.0, 6.0, 0.0)
    return [
        SignalPair("/a", FRAMES, hill(FRAMES), time, 1.0 + rng.choice([0.0, 1e-12, 1.0]) * rng.normal(size=len(time)))
    ]


def a_constant_that_flickers_between_two_values(rng):
    time = log_times(rng, 0.0, 6.0, 0.0)
    return [SignalPair("/a", FRAMES, hill(FRAMES), time, (rng.random(len(time)) > 0.5).astype(float))]


def one_jump_beside_a_curve(rng):
    time = log_times(rng, 0.0, 6.0, 0.0)
    return [SignalPair("/a", FRAMES, np.sin(1.3 * FRAMES), time, (time > rng.uniform(1.0, 5.0)).astype(float))]


def coloured_noise(rng):
    time = log_times(rng, 0.0, 6.0, 0.0)
    return [
        SignalPair(f"/{function.__name__}", FRAMES, function(FRAMES), time, coloured(rng, len(time)))
        for function in (hill, swing, trapezoid)[: rng.integers(1, 4)]
    ]


def another_smooth_signal(rng):
    time = np.arange(600) * 0.01
    value = sum(rng.normal() * np.sin(0.7 * k * time + rng.uniform(0.0, 6.0)) for k in range(1, 6))
    return [SignalPair("/a", FRAMES, hill(FRAMES), time, value + 0.01 * rng.normal(size=600))]


def a_gap_where_all_happens(rng):
    offset = rng.uniform(-1.0, 1.0)
    time = log_times(rng, 0.0, 6.0, offset)
    at = time + offset
    return [measured(rng, lambda t: swing(t, 2.0, 2.6), time[(at < 1.9) | (at > 2.7)], offset)]


def a_log_that_begins_or_ends_beside_the_motion(rng):
    offset, overlap = rng.uniform(-1.0, 1.0), rng.uniform(0.4, 1.6)
    begin, end = (6.0 - overlap, 14.0 - overlap) if rng.random() < 0.5 else (-8.0, overlap)
    return [measured(rng, lambda t: hill(np.clip(t, 0.0, 6.0)), log_times(rng, begin, end, offset), offset)]


FAMILIES = (
    a_ramp_beside_a_curve,
    a_ramp_out_of_a_motion_with_corners,
    a_decay_that_is_itself_again_later,
    two_motions_of_one_period,
    a_sum_of_two_periods,
    a_period_with_a_drift,
    a_constant,
    a_constant_that_flickers_between_two_values,
    one_jump_beside_a_curve,
    coloured_noise,
    another_smooth_signal,
    a_gap_where_all_happens,
    a_log_that_begins_or_ends_beside_the_motion,
)


@pytest.mark.parametrize("family", FAMILIES, ids=lambda family: family.__name__)
def test_what_does_not_tell_its_clock_is_refused(family):
    for seed in SEEDS:
        pairs = family(np.random.default_rng(seed))
        found = estimate_clock(pairs, drift=family is a_period_with_a_drift, lowest=-2.5, highest=2.5)
        assert isinstance(found, Undetermined), (seed, found)


@pytest.mark.parametrize("twin", [0.0, 0.003, 0.05, 0.3])
def test_a_motion_that_is_there_twice_is_refused(twin):
    time = np.arange(0.0, 16.0, 0.01)
    value = hill(time) + hill(time - 8.0) + 0.3 + twin * np.random.default_rng(1).normal(size=len(time))
    found = estimate_clock(
        [SignalPair("/a", FRAMES, hill(FRAMES), time, value)], drift=False, lowest=-20.0, highest=20.0
    )
    assert isinstance(found, Undetermined)


def clipped(rng, offset):
    pair = measured(rng, hill, log_times(rng, 0.0, 6.0, offset), offset, noise=(0.003, 0.03))
    return SignalPair(
        "/a", FRAMES, pair.value, pair.measured_time, np.minimum(pair.measured_value, rng.uniform(0.1, 0.8))
    )


def jumps(rng, offset):
    steps = lambda t: (t > 1.0).astype(float) + (t > 3.5)  # noqa: E731
    return measured(rng, steps, log_times(rng, 2.5, 5.0, offset), offset)


def corners(rng, offset):
    return measured(rng, trapezoid, log_times(rng, 1.5, rng.uniform(4.1, 6.0), offset), offset, noise=(0.003, 0.1))


@pytest.mark.parametrize("family", [clipped, jumps, corners])
def test_what_tells_little_is_told_within_a_frame_of_its_interval_or_not_at_all(family):
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        offset = rng.uniform(-1.0, 1.0)
        found = estimate_clock([family(rng, offset)], drift=False, lowest=-2.5, highest=2.5)
        if isinstance(found, ClockEstimate):
            low, high = found.offset_interval
            assert low - 1.0 / 60.0 <= offset <= high + 1.0 / 60.0
