"""Compiled poses are those of `Motion.states` and `Linkage.forward`."""

import numpy as np
import pytest

from replay.kinematics.timeline import local_poses, timeline
from tests.kinematics.scripts import random_clocks, random_motion


@pytest.mark.parametrize("slowed", [False, True])
@pytest.mark.parametrize("seed", range(40))
def test_poses_are_the_same_bit_for_bit(seed, slowed):
    rng = np.random.default_rng(seed)
    linkage, motion = random_motion(rng, links=8)
    if slowed:
        motion = random_clocks(rng, motion)
    line = timeline(linkage, motion)
    seconds = np.sort(
        np.concatenate([rng.uniform(-0.5, 2.5, 100), line.start, line.end, line.key_time, line.clock_start])
    )
    states = motion.states(seconds)
    expected = linkage.forward(states.positions, states.free_poses).local
    poses = np.empty_like(expected)
    local_poses(line, seconds, np.empty((4, 4)), poses)
    np.testing.assert_array_equal(poses, expected)
