"""Families of logs that do not tell their clock: each is refused, whatever noise, rate and place are."""

import dataclasses

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


def bump(t, at=3.0, width=0.5):
    return np.exp(-(((t - at) / width) ** 2)) - 0.4 * np.exp(-(((t - at - 1.1) / 0.6 / width) ** 2))


def done_twice(rng, jitter=0.0, wander=0.0, noise=0.0):
    """Return a log of 16 s that holds the motion twice, at two amplitudes, with errors that grow with it or do not."""
    time = np.cumsum(rng.uniform(0.5, 1.5, 1600)) * rng.uniform(0.005, 0.01)
    time *= 16.0 / time[-1]
    heights, read = rng.permutation([1.0, rng.uniform(0.15, 1.0)]), time + jitter * rng.normal(size=len(time))
    slow = [1.0 + wander * np.sin(rng.uniform(1.0, 4.0) * time + rng.uniform(0.0, 6.0)) for _ in heights]
    value = heights[0] * bump(read) * slow[0] + heights[1] * bump(read - 8.0) * slow[1]
    return [SignalPair("/a", FRAMES, bump(FRAMES), time, value + noise * rng.normal(size=len(time)))]


def a_motion_done_again_at_another_amplitude(rng):
    return done_twice(rng, noise=rng.choice([0.001, 0.01, 0.05]))


def a_motion_done_again_with_jitter(rng):
    return done_twice(rng, jitter=rng.choice([0.002, 0.01, 0.03]), noise=1e-4)


def a_motion_done_again_and_not_as_well(rng):
    return done_twice(rng, wander=rng.uniform(0.02, 0.1), noise=1e-3)


def one_of_two_corners_between_frames(rng):
    """A triangle that is there twice: where its corners are between frames differs."""
    width, height, offset = rng.uniform(0.1, 0.6), rng.uniform(0.15, 1.0), rng.uniform(-1.0, 1.0)
    begins = rng.uniform(1.0, 1.6), rng.uniform(4.0, 4.9)
    motion = lambda t: sum(  # noqa: E731
        h * np.maximum(1.0 - np.abs(t - at) / width, 0.0) for h, at in zip((1.0, height), begins, strict=True)
    )
    at = rng.choice(begins)
    return [measured(rng, motion, log_times(rng, at - 0.9, at + 0.9, offset), offset, noise=(0.01, 0.1, 0.3))]


def one_of_two_jumps(rng):
    begins, offset = (rng.uniform(0.8, 1.5), rng.uniform(3.6, 4.6)), rng.uniform(-0.5, 0.5)
    at = rng.choice(begins)
    jump = lambda t: (t > begins[0]) + 1.7 * (t > begins[1])  # noqa: E731
    return [measured(rng, jump, log_times(rng, at - 0.9, at + 0.9, offset), offset)]


def stairs(rng):
    period, offset = rng.uniform(0.5, 1.2), rng.uniform(-0.2, 0.2)
    return [measured(rng, lambda t: np.floor(t / period), log_times(rng, 1.0, 5.0, offset), offset)]


DONE_TWICE = (
    a_motion_done_again_at_another_amplitude,
    a_motion_done_again_with_jitter,
    a_motion_done_again_and_not_as_well,
    one_of_two_corners_between_frames,
    one_of_two_jumps,
)
FAMILIES = (
    *DONE_TWICE,
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
    stairs,
)


@pytest.mark.parametrize("family", FAMILIES, ids=lambda family: family.__name__)
def test_what_does_not_tell_its_clock_is_refused(family):
    bound = 20.0 if family in DONE_TWICE else 2.5
    for seed in SEEDS:
        pairs = family(np.random.default_rng(seed))
        found = estimate_clock(pairs, drift=family is a_period_with_a_drift, lowest=-bound, highest=bound)
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


def jump(rng):
    at = rng.uniform(2.0, 4.0)
    return lambda t: (t > at).astype(float)


def pulse(rng):
    at, lasts = rng.uniform(1.0, 3.0), rng.uniform(0.02, 1.5)
    return lambda t: (t > at).astype(float) - (t > at + lasts)


def two_jumps(rng):
    first, second = rng.uniform(0.8, 2.5), rng.uniform(2.7, 4.6)
    return lambda t: (t > first).astype(float) + (t > second)


def jumps_as_far_from_frames(rng):
    """As those of a script at round times are."""
    times = rng.choice(np.arange(30, 330), 8, replace=False) / 60.0 + rng.uniform(0.0, 1.0 / 60.0)
    heights = rng.normal(size=8)
    return lambda t: sum(height * (t > at) for height, at in zip(heights, times, strict=True))


@pytest.mark.parametrize("steps", [False, True], ids=["values", "states"])
@pytest.mark.parametrize("family", [jump, pulse, two_jumps, jumps_as_far_from_frames])
def test_jumps_are_told_to_a_frame_and_a_sample_or_not_at_all(family, steps):
    told = []
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        offset, motion = rng.uniform(-0.5, 0.5), family(rng)
        pair = measured(rng, motion, log_times(rng, 0.02, 5.98, offset), offset, noise=(0.0, 0.003, 0.03))
        found = estimate_clock([dataclasses.replace(pair, steps=steps)], drift=False, lowest=-2.5, highest=2.5)
        if isinstance(found, ClockEstimate):
            low, high = found.offset_interval
            assert low <= offset <= high, (seed, offset, found)
            told.append(high - low)
    assert np.median(told or [0.0]) < 0.1
