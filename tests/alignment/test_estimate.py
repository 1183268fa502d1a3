"""Clocks against brute force, and what is refused: what data cannot tell, and nothing else."""

import dataclasses

import numpy as np
import pytest

from replay.alignment.clock import ClockEstimate, LogClock, Undetermined
from replay.alignment.estimate import estimate_clock
from replay.alignment.pair import SignalPair
from replay.errors import InvalidValue

FRAMES = np.arange(361) / 60.0
RANGE = {"lowest": -2.0, "highest": 2.0}


def hill(t, at=2.5, width=0.6):
    return np.exp(-(((t - at) / width) ** 2)) + 0.3 * np.tanh(t - 4.0)


def pair_of(function, log_time, offset, *, noise=0.0, seed=0, drift=0.0, name="/a", scale=1.0, bias=0.0, steps=False):
    """Return a signal measured at times of the log, whose clock is `offset` behind."""
    log_time = np.asarray(log_time, dtype=float)
    value = scale * function(log_time + offset + drift * log_time) + bias
    value = value + noise * np.random.default_rng(seed).normal(size=len(log_time))
    return SignalPair(name, FRAMES, function(FRAMES), log_time, value, steps)


def told(pairs, *, drift=False, **bounds):
    return estimate_clock(pairs, drift=drift, **(RANGE | bounds))


@pytest.mark.parametrize("offset", [-1.8, -0.3, 0.0, 0.0123, 1.2])
@pytest.mark.parametrize("rate", [7.0, 60.0, 900.0])
def test_the_best_offset_is_that_of_a_fine_search(offset, rate):
    """Brute force: correlation of both on a grid of 1/6000 s, over what overlaps, with the best scale and bias."""
    pair = pair_of(hill, np.arange(0.0, 6.0, 1.0 / rate) - offset, offset, noise=0.02, scale=-2.0, bias=5.0)
    clock = told([pair])
    tried = np.round(offset, 3) + np.arange(-600, 601) / 6000.0
    left = []
    for one in tried:
        at = pair.measured_time + one
        there = (at >= 0.0) & (at <= 6.0)
        s, y = np.interp(at[there], FRAMES, pair.value), pair.measured_value[there]
        left.append(1.0 - np.corrcoef(s, y)[0, 1] ** 2)
    half = 0.5 * (clock.offset_interval[1] - clock.offset_interval[0])
    assert abs(clock.offset - tried[np.argmin(left)]) < max(0.1 * half, 1.0 / 6000.0)
    assert abs(clock.offset - offset) < 2.0 * half


def test_the_best_offset_is_where_scipy_finds_the_highest_correlation():
    """Signals that rest at 0 at both ends, on one grid of 1 ms, without gaps: no mask is needed."""
    from scipy.signal import correlate, correlation_lags

    grid = np.arange(0.0, 6.0, 1e-3)
    bell = lambda t: np.exp(-(((t - 3.0) / 0.5) ** 2))  # noqa: E731
    pair = pair_of(bell, grid, 0.347, noise=0.05)
    simulated = np.interp(grid, FRAMES, pair.value)
    lags = correlation_lags(len(grid), len(grid))
    best = lags[np.argmax(correlate(simulated, pair.measured_value))]
    assert told([pair]).offset == pytest.approx(best * 1e-3, abs=2e-3)


def test_drift_is_found_in_a_long_log():
    frames = np.arange(0.0, 600.0, 0.05)
    motion = lambda t: np.sin(0.7 * t) + np.sin(0.311 * t + 1.0) + 0.5 * np.sin(2.9 * t)  # noqa: E731
    log_time = np.arange(0.0, 595.0, 0.013)
    rng = np.random.default_rng(1)
    measured = motion(log_time + 1.3 + 8e-4 * log_time) + 0.1 * rng.normal(size=len(log_time))
    clock = told([SignalPair("/a", frames, motion(frames), log_time, measured)], drift=True)
    assert clock.drift == pytest.approx(8e-4, abs=5e-6)
    assert clock.drift_interval[0] <= 8e-4 <= clock.drift_interval[1]
    low, high = clock.offset_interval
    assert low <= 1.3 + 8e-4 * clock.reference <= high
    at_start, (low, high) = clock.offset_at(0.0)
    assert low <= 1.3 <= high
    assert at_start == pytest.approx(1.3, abs=2e-3)


def test_a_drift_that_data_do_not_tell_is_not_applied():
    clock = told([pair_of(hill, np.arange(0.0, 6.0, 0.02), 0.1, noise=0.2)], drift=True)
    assert clock.drift == 0.0
    assert clock.drift_interval[0] < 0.0 < clock.drift_interval[1]
    assert clock.offset_interval[0] <= 0.1 <= clock.offset_interval[1]


def test_states_tell_the_clock_too():
    """Edges are known to a frame and a sample; many of them to less."""
    lamp = lambda t: ((np.floor(t * 1.3) % 2) * (t > 0.9) * (t < 4.0) + (t > 4.7)).astype(float)  # noqa: E731
    clock = told([pair_of(lamp, np.arange(0.0, 7.0, 0.011), -0.42, steps=True)])
    assert isinstance(clock, ClockEstimate)
    assert clock.offset == pytest.approx(-0.42, abs=1.0 / 60.0)


@pytest.mark.parametrize("interval", [0.004, 0.02, 0.2])
def test_one_edge_tells_the_clock_to_a_sample(interval):
    pair = pair_of(lambda t: (t > 3.0).astype(float), np.arange(0.0, 6.0, interval), 0.137, steps=True)
    clock = told([pair])
    if isinstance(clock, ClockEstimate):
        assert clock.offset_interval[0] <= 0.137 <= clock.offset_interval[1]
        assert clock.offset == pytest.approx(0.137, abs=interval + 1.0 / 60.0)


def test_a_state_without_noise_leaves_the_others_their_say():
    edge = pair_of(lambda t: (t > 3.0).astype(float), np.arange(0.0, 6.0, 0.02), 0.137, steps=True, name="/edge")
    clock = told([edge, pair_of(hill, np.arange(0.0, 6.0, 0.02), 0.137, noise=0.1)])
    assert clock.offset_interval[0] <= 0.137 <= clock.offset_interval[1]


def test_without_noise_the_interval_is_what_lines_between_frames_may_hide():
    """Of a hill 36 frames wide little, and never less than a nanosecond."""
    pair = SignalPair("/a", FRAMES, hill(FRAMES), FRAMES - 0.1, hill(FRAMES))
    clock = told([pair])
    assert clock.offset == pytest.approx(0.1, abs=1e-9)
    assert 2e-9 <= np.diff(clock.offset_interval)[0] < 2e-4


def test_a_jump_that_samples_pass_by_is_not_told_better_than_it_is():
    for seed in range(10):
        offset = 0.1 + 0.013 * seed
        pair = pair_of(lambda t: (t > 3.0).astype(float), np.arange(0.0, 6.0, 0.02), offset)
        clock = told([pair])
        if isinstance(clock, ClockEstimate):
            assert clock.offset_interval[0] - 1.0 / 60.0 <= offset <= clock.offset_interval[1] + 1.0 / 60.0


def test_several_signals_share_the_clock():
    pairs = [
        pair_of(hill, np.arange(0.0, 6.0, 0.02), 0.4, noise=0.3, seed=1, name="/hill"),
        pair_of(lambda t: np.tanh(3.0 * (t - 2.0)), np.arange(0.0, 6.0, 0.005), 0.4, noise=0.3, seed=2, name="/edge"),
        pair_of(lambda t: 0.0 * t, np.arange(0.0, 6.0, 0.02), 0.4, noise=0.1, seed=3, name="/still"),
    ]
    together, alone = told(pairs), told(pairs[:1])
    assert together.used == ("/hill", "/edge")
    assert together.unused == (("/still", "the simulated signal is constant"),)
    assert (
        together.offset_interval[1] - together.offset_interval[0] < alone.offset_interval[1] - alone.offset_interval[0]
    )
    assert together.agree


def test_a_signal_of_its_own_delay_is_told_and_widens_the_interval():
    pairs = [
        pair_of(hill, np.arange(0.0, 6.0, 0.01), 0.4, noise=0.01, seed=1, name="/prompt"),
        pair_of(hill, np.arange(0.0, 6.0, 0.01), 0.3, noise=0.01, seed=2, name="/late"),
    ]
    clock = told(pairs)
    assert not clock.agree
    assert clock.offset_interval[0] <= 0.3 < 0.4 <= clock.offset_interval[1]
    delays = {one.name: one.delay for one in clock.delays}
    assert delays["/late"] - delays["/prompt"] == pytest.approx(0.1, abs=0.01)


@pytest.mark.parametrize("period", [0.8, 1.0, 1.5, 1.9])
def test_a_periodic_motion_has_several_offsets(period):
    swing = lambda t: np.sin(2.0 * np.pi * t / period)  # noqa: E731
    found = told([pair_of(swing, np.arange(0.0, 6.0, 0.01), 0.1, noise=0.1)])
    assert isinstance(found, Undetermined)
    assert "several offsets" in found.reason
    assert any(abs(one - 0.1) < 0.05 for one in found.candidates)
    gaps = np.diff(found.candidates)
    assert np.allclose(gaps, period, atol=0.05)


def test_a_periodic_motion_without_noise_has_several_offsets():
    swing = lambda t: np.sin(2.0 * np.pi * t / 1.27)  # noqa: E731
    assert isinstance(told([pair_of(swing, np.arange(0.0, 6.0, 0.01), 0.1)]), Undetermined)


def test_bounds_choose_among_the_offsets_of_a_periodic_motion():
    swing = lambda t: np.sin(2.0 * np.pi * t / 1.5)  # noqa: E731
    clock = told([pair_of(swing, np.arange(0.0, 6.0, 0.01), 0.1, noise=0.1)], lowest=-0.5, highest=0.5)
    assert clock.offset_interval[0] <= 0.1 <= clock.offset_interval[1]
    other = told([pair_of(swing, np.arange(0.0, 6.0, 0.01), 0.1, noise=0.1)], lowest=1.2, highest=2.0)
    assert other.offset == pytest.approx(1.6, abs=0.02)


def test_a_log_of_two_runs_of_the_motion_has_two_offsets():
    twice = np.arange(0.0, 16.0, 0.01)
    value = hill(twice) + hill(twice - 8.0) + 0.05 * np.random.default_rng(1).normal(size=len(twice))
    found = told([SignalPair("/a", FRAMES, hill(FRAMES), twice, value)], lowest=-20.0, highest=20.0)
    assert isinstance(found, Undetermined)
    assert len(found.candidates) == 2


@pytest.mark.parametrize(
    ("function", "reason"),
    [
        (lambda t: 0.0 * t + 3.0, "constant"),
        (lambda t: 0.1 * t + 3.0, ""),
    ],
)
def test_constant_and_straight_signals_tell_nothing(function, reason):
    found = told([pair_of(function, np.arange(0.0, 6.0, 0.01), 0.1, noise=0.01)])
    assert isinstance(found, Undetermined)
    assert reason in found.reason


def test_a_constant_measurement_tells_nothing():
    pair = dataclasses.replace(pair_of(hill, np.arange(0.0, 6.0, 0.01), 0.0), measured_value=np.full(600, 2.0))
    found = told([pair])
    assert isinstance(found, Undetermined)
    assert "the measured signal is constant" in found.reason


@pytest.mark.parametrize("seed", range(20))
def test_noise_that_hides_everything_is_no_clock(seed):
    pair = pair_of(lambda t: 0.0 * hill(t), np.arange(0.0, 6.0, 0.01), 0.0, noise=1.0, seed=seed)
    pair = SignalPair("/a", FRAMES, hill(FRAMES), pair.measured_time, pair.measured_value)
    found = told([pair])
    assert isinstance(found, Undetermined)


def test_signals_that_wander_by_themselves_are_hardly_ever_taken_for_the_simulated_one():
    """A random walk is like anything for a while: of 60, one at most is taken for it."""
    taken = 0
    for seed in range(60):
        walk = np.cumsum(np.random.default_rng(seed).normal(size=600))
        found = told([SignalPair("/a", FRAMES, hill(FRAMES), np.arange(600) * 0.01, walk)])
        taken += isinstance(found, ClockEstimate)
    assert taken <= 1


def test_a_log_that_hardly_overlaps_is_refused():
    found = told([pair_of(hill, np.arange(5.5, 20.0, 0.01), 0.0, noise=0.01)])
    assert isinstance(found, Undetermined)


def test_a_best_offset_outside_the_bounds_is_refused():
    found = told([pair_of(hill, np.arange(0.0, 9.0, 0.01) - 3.0, 3.0, noise=0.01)])
    assert isinstance(found, Undetermined)
    assert "is not within -2 .. 2 s" in found.reason


def test_too_few_samples_tell_nothing():
    assert "of 4 samples" not in told([pair_of(hill, np.arange(600) * 0.01, 0.0, noise=0.01)]).unused
    found = told([pair_of(hill, np.arange(4) * 1.0, 0.0)])
    assert isinstance(found, Undetermined)
    assert found.unused == (("/a", "4 of 4 samples have a value, at times that may be the scenario's"),)
    assert told([]).reason == "there is no signal"


def test_times_that_are_far_off_do_not_matter():
    """A stray sample of another epoch; and an hour of a log of which the motion is 6 s."""
    pair = pair_of(hill, np.arange(0.0, 6.0, 0.01), 0.4, noise=0.05)
    stray = SignalPair(
        "/a", FRAMES, pair.value, np.append(pair.measured_time, 1.7e9), np.append(pair.measured_value, 0)
    )
    assert told([stray]) == told([pair])
    hour = np.arange(-1800.0, 1800.0, 0.01)
    rest = np.where((hour >= 0.0) & (hour < 6.0), hill(hour + 0.4), hill(np.where(hour < 3.0, 0.4, 6.4)))
    rest += 0.05 * np.random.default_rng(1).normal(size=len(hour))
    clock = told([SignalPair("/a", FRAMES, pair.value, hour, rest)], lowest=-1e3, highest=1e3)
    assert clock.offset_interval[0] <= 0.4 <= clock.offset_interval[1]


@pytest.mark.parametrize("rate", [9.0, 100.0])
def test_single_values_far_off_do_not_matter(rate):
    pair = pair_of(hill, np.arange(0.0, 6.0, 1.0 / rate), 0.4, noise=0.1)
    spoilt = pair.measured_value.copy()
    spoilt[[7, len(spoilt) // 2]] = 50.0, -1e6
    clock = told([dataclasses.replace(pair, measured_value=spoilt)])
    half = 0.5 * np.diff(clock.offset_interval)[0]
    assert abs(clock.offset - told([pair]).offset) < half
    assert clock.offset_interval[0] <= 0.4 <= clock.offset_interval[1]


def test_the_same_logs_give_the_same_numbers_whatever_their_unit():
    pair = pair_of(hill, np.arange(0.0, 6.0, 0.01), 0.1, noise=0.1)
    clock = told([pair])
    assert told([pair]) == clock
    small = dataclasses.replace(pair, measured_value=pair.measured_value * 2.0**-70)
    large = dataclasses.replace(pair, value=pair.value * 2.0**900)
    assert told([small]) == clock
    assert told([large]) == clock


def test_a_signal_of_denormal_numbers_is_no_error():
    pair = pair_of(hill, np.arange(0.0, 6.0, 0.01), 0.1, noise=0.1)
    told([dataclasses.replace(pair, measured_value=pair.measured_value * 1e-310)])


def test_a_clock_turns_times_both_ways():
    clock = LogClock(0.5, 1e-3, reference=2.0)
    log_time = np.array([0.0, 2.0, 10.0])
    assert clock.simulated(log_time) == pytest.approx([0.498, 2.5, 10.508])
    assert clock.logged(clock.simulated(log_time)) == pytest.approx(log_time)


@pytest.mark.parametrize("bad", [{"offset": np.nan}, {"offset": 0.0, "drift": -1.0}, {"offset": np.inf}])
def test_a_clock_that_is_none_is_refused(bad):
    with pytest.raises(InvalidValue, match="clock"):
        LogClock(**bad)


def test_bounds_that_are_none_are_refused():
    with pytest.raises(InvalidValue, match="the first below the second"):
        estimate_clock([], drift=False, lowest=1.0, highest=1.0)
    with pytest.raises(InvalidValue, match="confidence"):
        estimate_clock([], drift=False, lowest=0.0, highest=1.0, confidence=1.0)


def test_times_that_do_not_increase_are_refused():
    with pytest.raises(InvalidValue, match="strictly increasing"):
        SignalPair("/a", np.array([0.0, 0.0]), np.zeros(2), np.zeros(0), np.zeros(0))
    with pytest.raises(InvalidValue, match="measured_value"):
        SignalPair("/a", np.array([0.0, 1.0]), np.zeros(2), np.zeros(1), np.zeros(2))
