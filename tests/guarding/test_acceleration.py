"""Where a joint's acceleration is beyond its limit: beside finite differences of its positions q(s(t))."""

import itertools
import math

import numpy as np
import pytest

from replay.guarding.acceleration import excesses, peak
from replay.kinematics.clock import Clock
from replay.kinematics.linkage import Joint, JointType
from replay.kinematics.profiles import from_pieces

STEP = 1e-4
"""Of the differences [s]."""
END = 3.0
"""Of the time looked at [s]."""


def joint(acceleration, deceleration=None):
    return Joint("j", JointType.PRISMATIC, acceleration=acceleration, deceleration=deceleration)


def moving(rng):
    """Return pieces of random polynomials, continuous in position."""
    pieces, place, time = [], 0.0, 0.0
    for length in (0.9, 1.3, 0.8):
        row = [place, *rng.uniform(-1.0, 1.0, 5)]
        pieces.append([time, time + length, *row])
        place, time = float(np.polynomial.polynomial.polyval(length, row)), time + length
    return from_pieces(pieces, 0.0, place)


def slowed(rng):
    """Return a clock that is the time itself, brakes, holds a rate, stands, and speeds up again."""
    rate = float(rng.uniform(0.3, 0.7))
    clock = Clock.steady().then(0.4, 1.0, -2.0).then(0.4 + 0.5 * (1.0 - rate), rate, 0.0)
    return clock.then(1.2, rate, -1.0).then(1.2 + rate, 0.0, 0.0).then(2.0, 0.0, 1.5).then(2.0 + 1.0 / 1.5, 1.0, 0.0)


def by_differences(profile, clock):
    """Return times without a knot near them, velocities and accelerations, and whether something acts on the clock."""
    times = np.linspace(0.0, END, 6001)[1:-1]
    script, rate = clock.sample(times)
    away = np.abs(times[:, None] - clock.start).min(axis=1) > 2.0 * STEP
    away &= np.abs(script[:, None] - np.append(profile.start, profile.end)).min(axis=1) > 2.0 * STEP
    before, here, after = (profile.sample(clock.sample(times + h)[0])[0] for h in (-STEP, 0.0, STEP))
    acts = (rate != 1.0) | (clock.sample(times + STEP)[1] != rate)
    velocity, acceleration = (after - before) / (2.0 * STEP), (after - 2.0 * here + before) / STEP**2
    return tuple(values[away] for values in (times, velocity, acceleration, acts))


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("limits", [(0.8, None), (1.5, 0.4), (0.3, math.inf)])
def test_stretches_beyond_a_limit_are_those_of_the_differences(seed, limits):
    rng = np.random.default_rng(seed)
    profile, clock, limited = moving(rng), slowed(rng), joint(*limits)
    times, velocity, acceleration, acts = by_differences(profile, clock)
    limit = np.where(acceleration * velocity < 0.0, limited.braking, limited.acceleration)
    clear = (np.abs(np.abs(acceleration) - limit) > 1e-5) & (np.abs(velocity) > 1e-6)  # of what differences can tell
    beyond = acts & (np.abs(acceleration) > limit)
    found = excesses(limited, profile, clock, 0.0, END)
    assert found and 0.05 < beyond.mean() < 0.95
    inside = np.zeros(len(times), dtype=bool)
    for one in found:
        within = (times >= one.begin) & (times <= one.end)
        inside |= within
        assert one.begin <= one.time <= one.end
        worst = (np.abs(acceleration[within]) / limit[within]).max(initial=0.0)
        assert one.acceleration / one.limit >= worst - 1e-5 / one.limit
    assert (inside == beyond)[clear].all()
    assert all(a.end < b.begin for a, b in itertools.pairwise(found)), "stretches that touch are one"


@pytest.mark.parametrize("seed", range(12))
def test_the_peak_is_the_largest_of_the_differences_where_something_acts(seed):
    rng = np.random.default_rng(seed)
    profile, clock = moving(rng), slowed(rng)
    times, _, acceleration, acts = by_differences(profile, clock)
    time, size = peak(profile, clock, 0.0, END)
    largest = np.abs(acceleration[acts]).max()
    assert largest - 1e-5 <= size <= largest + 0.05  # between two times looked at it rises a little
    nearest = np.abs(times - time) < 2.0 * END / 6000
    assert np.abs(acceleration[nearest]).max() == pytest.approx(size, abs=0.05)


def test_what_a_script_does_by_itself_is_not_looked_at():
    braking = from_pieces([[0.0, 2.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]], 0.0, 4.0)  # q = t^2
    for clock in (Clock.steady(), Clock.steady().then(0.5, 1.0, 0.0), Clock.steady().then(0.5, 0.0, 0.0)):
        assert excesses(joint(0.1), braking, clock, 0.0, 2.0) == []
        assert peak(braking, clock, 0.0, 2.0) == (0.0, 0.0)
    half = Clock.steady().then(0.5, 0.5, 0.0)
    (one,) = excesses(joint(0.1), braking, half, 0.0, 2.0)
    assert (one.begin, one.end, one.limit) == (0.5, 2.0, 0.1)
    assert one.acceleration == pytest.approx(2.0 * 0.25, rel=1e-12)
    assert excesses(joint(0.5), braking, half, 0.0, 2.0) == [], "at the limit is not beyond it"
    assert excesses(joint(math.inf), braking, half, 0.0, 2.0) == []
