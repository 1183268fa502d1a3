"""Clocks of scripts: closed forms against integration, and bounds of what joints do by them against samples."""

import numpy as np
import pytest

from replay.kinematics.clock import Clock
from replay.kinematics.timeline import timeline
from replay.kinematics.travel import CHANGE, HALVINGS, HIGHEST, LOWEST, TRAVEL, joint_travel
from tests.kinematics.scripts import random_clocks, random_motion


def test_a_steady_clock_shows_the_time_itself():
    seconds = np.array([-1.0, 0.1 + 0.2, 7.0])
    script, rate = Clock.steady().sample(seconds)
    assert script.tobytes() == seconds.tobytes()
    assert rate.tolist() == [1.0, 1.0, 1.0]


def test_braking_and_going_on_are_the_integral_of_the_rate():
    clock = Clock.steady().then(1.0, 1.0, -2.0).then(1.5, 0.0, 0.0).then(3.0, 0.0, 0.5).then(5.0, 1.0, 0.0)
    assert clock.at(1.5) == (1.25, 0.0)
    assert clock.at(2.9) == (1.25, 0.0)
    assert clock.at(5.0) == (2.25, 1.0)
    assert clock.at(6.0) == (3.25, 1.0)
    times = np.linspace(0.0, 6.0, 60_001)
    script, rate = clock.sample(times)
    summed = np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(times))])
    np.testing.assert_allclose(script, summed, atol=1e-8)
    assert (np.diff(script) >= 0.0).all()


def test_a_clock_is_cut_and_replaced_where_it_changes():
    clock = Clock.steady().then(1.0, 1.0, -1.0).then(2.0, 0.0, 0.0)
    cut = clock.until(1.5)
    assert cut.start.tolist() == [1.0]
    again = cut.then(1.5, 0.5, 0.0)
    assert again.at(1.5)[0] == clock.at(1.5)[0]
    assert again.then(1.5, 0.25, 0.0).rate.tolist() == [1.0, 0.25]


@pytest.mark.parametrize("seed", range(60))
def test_travel_by_a_clock_bounds_what_is_sampled(seed):
    rng = np.random.default_rng(seed)
    linkage, motion = random_motion(rng, links=6)
    motion = random_clocks(rng, motion)
    line = timeline(linkage, motion)
    work, found = np.empty((HALVINGS + 8, 8)), np.empty(4)
    for _ in range(20):
        t0, t1 = np.sort(rng.uniform(-0.2, 1.5, 2)).tolist()
        times = np.linspace(t0, t1, 1001)
        positions = motion.states(times).positions
        for joint in range(len(motion.profiles)):
            joint_travel(line, joint, t0, t1, work, found)
            q = positions[:, joint]
            sampled = np.abs(np.diff(q)).sum()
            assert found[TRAVEL] >= sampled
            assert found[CHANGE] == q[-1] - q[0]
            apart = q - (q[0] + np.linspace(0.0, 1.0, 1001) * found[CHANGE])
            assert found[LOWEST] <= apart.min() + 1e-15
            assert found[HIGHEST] >= apart.max() - 1e-15
            size = 1.0 + np.abs(q).max()
            assert found[TRAVEL] <= sampled + 1e-2 * size + 0.1 * sampled, "a bound that says something"
