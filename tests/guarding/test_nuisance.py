"""Nuisance stops: noise alone passes a threshold as often as its distribution says."""

import numpy as np
import pytest
from scipy import stats

from replay.guarding.reaction import Reaction
from replay.kinematics.linkage import Joint, JointType
from replay.kinematics.motion import Motion
from replay.sensing.signal.chain import Chain
from replay.sensing.signal.part import VoltageSignal
from tests.guarding.test_reaction import guard, line

SWEEPS = 10_000


def triggers(reaction, seconds, told, near):
    """Return whether a guard is triggered by what a sensor tells."""
    begin = 0
    while begin < len(seconds):
        rest = slice(begin, None)
        nothing = np.zeros((len(seconds) - begin, 0))
        begin += reaction.decide(begin, seconds[rest], lambda kind, column: (told[rest], near[rest]), nothing)  # noqa: B023
    return bool(reaction.episodes())


@pytest.mark.parametrize(("frames_for", "deviations"), [(0, 3.0), (1, 1.8)])
def test_10_000_sweeps_over_seeds_stop_as_often_as_chance_says(frames_for, deviations):
    frames, level, std = 5, 2.0, 0.01
    seconds, motion = np.arange(frames) / 60.0, Motion((line(0.1),), ())
    made = [guard(below=level - deviations * std, hold_frames=frames_for)]
    reaction = Reaction(made, motion, [Joint("j0", JointType.PRISMATIC)], [0])
    stopped = 0
    for seed in range(SWEEPS):
        chain = Chain("capacitive", "side", VoltageSignal(noise={"std": std, "seed": seed}), 60, 0.0)
        told, near, _ = chain.run(0, np.full(frames, level), np.zeros(frames, dtype=bool), chain.begin())
        if seed % 100 and told.min() >= made[0].when.below:
            continue  # nothing is below, so there is nothing to react to; one in 100 is played all the same
        reaction.restart()
        stopped += triggers(reaction, seconds, told, near)
    once = stats.norm.cdf(-deviations)
    if frames_for == 0:
        chance = 1.0 - (1.0 - once) ** frames
    else:  # no two in a row: by the last one being below or not
        above, below = 1.0 - once, once
        for _ in range(frames - 1):
            above, below = (above + below) * (1.0 - once), above * once
        chance = 1.0 - above - below
    low, high = stats.binom.ppf([1e-4, 1.0 - 1e-4], SWEEPS, chance)
    assert low <= stopped <= high
