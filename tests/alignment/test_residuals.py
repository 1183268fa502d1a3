"""Measured samples at frames: where they are, where they are not, and what is counted."""

import dataclasses

import numpy as np
import pytest

from replay.alignment.clock import LogClock
from replay.alignment.pair import SignalPair, fitted
from replay.alignment.residuals import match
from replay.errors import InvalidValue

NOW = LogClock(0.0)
FRAMES = np.arange(11) / 10.0


def pair_of(measured_time, measured_value, *, value=None, steps=False, time=FRAMES):
    value = np.zeros(len(time)) if value is None else value
    return SignalPair(
        "/a",
        np.asarray(time),
        np.asarray(value, float),
        *(np.asarray(a, float) for a in (measured_time, measured_value)),
        steps,
    )


def test_a_line_is_read_exactly():
    log_time = np.arange(-3.0, 9.0) * 0.13 - 0.5
    pair = pair_of(log_time, 3.0 * (log_time + 0.5) - 1.0, value=3.0 * FRAMES)
    matched = match(pair, LogClock(0.5), max_gap=0.2)
    assert matched.frames.tolist() == list(range(11))
    assert matched.residual == pytest.approx(np.full(11, -1.0), abs=1e-15)
    assert (matched.n_unmatched_frames, matched.n_unmatched_samples) == (0, 4)


def test_values_between_samples_are_those_of_numpy():
    rng = np.random.default_rng(1)
    log_time, value = np.sort(rng.uniform(-0.2, 1.2, 50)), rng.normal(size=50)
    matched = match(pair_of(log_time, value), NOW, max_gap=10.0)
    assert matched.measured == pytest.approx(np.interp(FRAMES, log_time, value), rel=1e-12, abs=1e-15)


def test_nothing_is_joined_across_a_gap():
    pair = pair_of([0.0, 0.1, 0.2, 0.65, 0.7, 0.8, 0.9, 1.0], np.ones(8))
    matched = match(pair, NOW, max_gap=0.15)
    assert matched.frames.tolist() == [0, 1, 2, 7, 8, 9, 10]
    assert matched.n_unmatched_frames == 4
    assert matched.n_unmatched_samples == 0  # 0.65 is beside frame 7, which is on a sample
    assert match(pair, NOW, max_gap=0.5).n_unmatched_frames == 0


def test_nothing_is_extrapolated():
    matched = match(pair_of([0.25, 0.35, 0.45], [1.0, 2.0, 3.0]), NOW, max_gap=1.0)
    assert matched.frames.tolist() == [3, 4]
    assert matched.measured == pytest.approx([1.5, 2.5])
    assert matched.n_unmatched_frames == 9


def test_a_sample_on_a_frame_needs_no_neighbour():
    """Offsets of decimal numbers are not exact: 0.1 + 0.2 is not 0.3."""
    matched = match(pair_of([0.1], [5.0]), LogClock(0.2), max_gap=0.01)
    assert matched.frames.tolist() == [3]
    assert matched.measured.tolist() == [5.0]
    ends = match(pair_of(FRAMES - 0.7, np.arange(11.0)), LogClock(0.7), max_gap=0.2)
    assert ends.n_unmatched_frames == 0
    assert ends.n_unmatched_samples == 0


def test_samples_beside_no_frame_are_counted():
    pair = pair_of([-0.5, 0.32, 0.5, 0.6, 1.4, 2.0], np.ones(6))
    matched = match(pair, NOW, max_gap=0.1)
    assert matched.frames.tolist() == [5, 6]
    assert matched.n_unmatched_samples == 4  # 0.32 is between two frames without a value


def test_where_nothing_is_detected_there_is_no_value():
    value = np.where(FRAMES < 0.55, 1.0, np.nan)
    pair = pair_of(FRAMES + 0.04, np.where(FRAMES < 0.35, 1.0, np.nan), value=value)
    matched = match(pair, NOW, max_gap=0.2)
    assert matched.frames.tolist() == [1, 2, 3]
    assert matched.measured_there.tolist() == [False, True, True, True, False, *[False] * 6]
    assert (matched.both, matched.only_measured, matched.only_simulated) == (3, 0, 2)
    other = match(dataclasses.replace(pair, value=np.full(11, np.nan)), NOW, max_gap=0.2)
    assert (other.both, other.only_measured, other.only_simulated) == (0, 3, 0)


def test_states_hold_until_the_next():
    pair = pair_of([0.0, 0.26, 0.5, 1.2], [0.0, 1.0, 0.0, 1.0], steps=True)
    matched = match(pair, NOW, max_gap=1.0)
    assert matched.measured.tolist() == [0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]


def test_infinite_values_are_detected_but_no_numbers():
    value = np.zeros(11)
    value[4] = np.inf
    matched = match(pair_of(FRAMES, np.full(11, 1.0), value=value), NOW, max_gap=0.2)
    assert 4 not in matched.frames
    assert matched.both == 11


def test_a_log_without_samples_and_a_scenario_without_frames():
    assert match(pair_of([], []), NOW, max_gap=1.0).n_unmatched_frames == 11
    assert match(pair_of([0.0], [1.0], time=[]), NOW, max_gap=1.0).n_unmatched_samples == 1


def test_a_gap_must_be_above_0():
    with pytest.raises(InvalidValue, match="max_gap"):
        match(pair_of([0.0], [1.0]), NOW, max_gap=0.0)


def test_a_fit_is_applied_to_the_simulation():
    pair = fitted(pair_of(FRAMES, 2.0 * FRAMES + 1.0, value=FRAMES), 2.0, 1.0)
    assert match(pair, NOW, max_gap=0.2).residual == pytest.approx(np.zeros(11))


@pytest.mark.parametrize("seed", range(5))
def test_residuals_are_those_of_evo(seed):
    """Three joints as the position of a body, measured at a higher rate with a known offset: an independent tool."""
    from evo.core.metrics import APE, PoseRelation
    from evo.core.sync import associate_trajectories
    from evo.core.sync_method import SyncMethod
    from evo.core.trajectory import PoseTrajectory3D

    rng = np.random.default_rng(seed)
    offset = rng.uniform(-2.0, 2.0)
    time = np.arange(121) / 60.0
    log_time = np.sort(rng.uniform(-0.5, 2.5, 900)) - offset
    simulated = np.cumsum(rng.normal(size=(121, 3)), axis=0)
    measured = np.cumsum(rng.normal(size=(900, 3)), axis=0)

    def trajectory(stamps, xyz):
        return PoseTrajectory3D(xyz, np.tile([1.0, 0.0, 0.0, 0.0], (len(stamps), 1)), stamps)

    theirs = associate_trajectories(
        trajectory(time, simulated),
        trajectory(log_time, measured),
        sync_method=SyncMethod.interpolation,
        max_diff=1.0,
        offset_2=offset,
    )
    error = APE(PoseRelation.translation_part)
    error.process_data(theirs)
    ours = [
        match(SignalPair("/q", time, simulated[:, k], log_time, measured[:, k]), LogClock(offset), max_gap=1.0)
        for k in range(3)
    ]
    assert all(len(one.frames) == 121 for one in ours)
    assert np.sqrt(sum(one.residual**2 for one in ours)) == pytest.approx(error.error, abs=1e-9)
