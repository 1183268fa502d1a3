"""Travel of joints: exact where a closed form is known, never below what is sampled."""

import numpy as np
import pytest

from replay.kinematics.linkage import Joint, JointType, Link, Linkage
from replay.kinematics.motion import Keyframe, Move, Script, Track, Waypoint, plan
from replay.kinematics.timeline import FREE, timeline
from replay.kinematics.travel import (
    CHANGE,
    HALVINGS,
    HIGHEST,
    LOWEST,
    SHIFT,
    TRAVEL,
    TURN,
    free_travel,
    joint_travel,
    link_travel,
)
from replay.numerics import transforms
from tests.kinematics.scripts import random_motion


def travel_of(script, begin, end, kind=JointType.REVOLUTE, **limits):
    """What one joint does over [begin, end]."""
    linkage = Linkage([Link("l", None, np.identity(4), Joint("j", kind, **limits))])
    line = timeline(linkage, plan(linkage, script))
    found = np.empty(4)
    if kind is JointType.FREE:
        free_travel(line, 0, begin, end, found)
    else:
        joint_travel(line, 0, begin, end, np.empty((HALVINGS + 8, 8)), found)
    return found


def points(*written):
    return Script(points={"j": tuple(Waypoint(*point) for point in written)})


@pytest.mark.parametrize(
    ("script", "begin", "end", "expected"),
    [
        (points((0.0, 0.0), (1.0, 1.0), (2.0, 0.0)), 0.5, 1.25, 0.75),
        (points((0.0, 0.0), (1.0, 1.0), (2.0, 0.0)), 0.0, 2.0, 2.0),
        (points((0.0, 0.0), (1.0, 1.0), (2.0, 0.0)), -1.0, 3.0, 2.0),
        # x = t - t^2 ... as a cubic: velocity 1 at 0, -1 at 1: up to 1/4 and back
        (points((0.0, 0.0, 1.0), (1.0, 0.0, -1.0)), 0.0, 1.0, 0.5),
        (points((0.0, 0.0, 1.0), (1.0, 0.0, -1.0)), 0.25, 0.75, 0.125),
        # rest to rest by a quintic is monotone
        (points((0.0, 0.0, 0.0, 0.0), (2.0, 3.0, 0.0, 0.0)), 0.0, 2.0, 3.0),
        # t - 3 t^2 + 2 t^3: extrema at (3 +- sqrt 3)/6, values +-sqrt(3)/18
        (points((0.0, 0.0, 1.0), (1.0, 0.0, 1.0)), 0.0, 1.0, 4.0 * np.sqrt(3.0) / 18.0),
        (Script(recorded={"j": Track(np.array([0.0, 0.1, 0.3]), np.array([1.0, 3.0, 2.5]))}), -5.0, 0.2, 2.25),
        (Script(), 0.0, 9.0, 0.0),
        (points((0.0, 0.7), (1.0, 0.7)), 0.0, 2.0, 0.0),
    ],
)
def test_total_variation(script, begin, end, expected):
    found = travel_of(script, begin, end)[TRAVEL]
    assert found == pytest.approx(expected, rel=1e-12, abs=1e-300)
    assert found >= expected * (1.0 - 1e-15)


def test_a_move_there_and_back_counts_both_ways():
    moves = (Move({"j": 1.0}, start=0.0), Move({"j": 0.0}, start=3.0))
    found = travel_of(Script(moves=moves), 0.0, 10.0, velocity=1.0, acceleration=2.0)
    assert found[TRAVEL] == pytest.approx(2.0, rel=1e-12)
    assert found[CHANGE] == pytest.approx(0.0, abs=1e-14)
    assert found[HIGHEST] >= 1.0


def test_a_free_joint_adds_up_what_lies_between_its_key_frames():
    s = np.sqrt(0.5)
    keys = (
        Keyframe(0.0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)),
        Keyframe(1.0, (3.0, 4.0, 0.0), (0.0, 0.0, s, s)),
        Keyframe(2.0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, -1.0)),  # the same rotation as at first
    )
    found = travel_of(Script(free={"j": keys}), 0.5, 2.0, JointType.FREE)
    assert found[SHIFT] == pytest.approx(7.5, rel=1e-12)
    assert found[TURN] == pytest.approx(0.75 * np.pi, rel=1e-12)
    assert travel_of(Script(free={"j": keys}), -2.0, 0.0, JointType.FREE)[:2].tolist() == [0.0, 0.0]


@pytest.mark.parametrize("seed", range(12))
def test_it_is_never_below_what_is_sampled(seed):
    """The way along 4 000 samples is a bound from below of the total variation; deviations stay within their bounds."""
    rng = np.random.default_rng(seed)
    linkage, motion = random_motion(rng, links=10, span=10.0 ** rng.uniform(-2, 2), size=10.0 ** rng.uniform(-3, 3))
    line = timeline(linkage, motion)
    span = max([1e-9, *line.end.tolist(), *line.key_time.tolist()])
    found, work = np.empty(4), np.empty((HALVINGS + 8, 8))
    tight = 0
    for _ in range(20):
        begin, end = np.sort(rng.uniform(-0.1, 1.1, 2)) * span
        seconds = np.linspace(begin, end, 4001)
        states = motion.states(seconds)
        shares = (seconds - begin) / (end - begin)
        for joint in range(len(linkage.joints)):
            q = states.positions[:, joint]
            joint_travel(line, joint, begin, end, work, found)
            way = np.abs(np.diff(q)).sum()
            # 4 000 roundings of the samples against none
            assert way <= found[TRAVEL] + 4000 * 2.0**-52 * np.abs(q).max()
            tight += found[TRAVEL] <= way * (1.0 + 1e-3) + 1e-12
            deviation = q - q[0] - shares * found[CHANGE]
            assert found[LOWEST] <= deviation.min() + 1e-15 * np.abs(q).max()
            assert deviation.max() <= found[HIGHEST] + 1e-15 * np.abs(q).max()
        for free in range(len(linkage.free_joints)):
            free_travel(line, free, begin, end, found)
            poses = states.free_poses[:, free]
            steps = np.sqrt((np.diff(poses[:, :3, 3], axis=0) ** 2).sum(axis=1)).sum()
            assert steps <= found[SHIFT] * (1.0 + 1e-12) + 4000 * 2.0**-51 * np.abs(poses[:, :3, 3]).max()
            quat = transforms.to_quaternion(poses)
            chord = np.sqrt(np.minimum(((quat[1:] - quat[:-1]) ** 2).sum(1), ((quat[1:] + quat[:-1]) ** 2).sum(1)))
            assert (4.0 * np.arcsin(0.5 * chord)).sum() <= found[TURN] * (1.0 + 1e-12) + 4000 * 2.0**-50
    assert tight > 10 * len(linkage.joints)


@pytest.mark.parametrize("seed", range(3))
def test_all_links_and_intervals_at_once(seed):
    linkage, motion = random_motion(np.random.default_rng(100 + seed), links=7)
    line = timeline(linkage, motion)
    seconds = np.linspace(-0.2, 1.5, 30)
    travel = np.empty((len(linkage.links), len(seconds) - 1, 2))
    link_travel(line, seconds, travel)
    found = np.empty(4)
    for link in range(len(linkage.links)):
        for f in range(len(seconds) - 1):
            found[:2] = 0.0
            if line.joint[link] >= 0 and line.kind[link] == FREE:
                free_travel(line, line.joint[link], seconds[f], seconds[f + 1], found)
            elif line.joint[link] >= 0:
                joint_travel(line, line.joint[link], seconds[f], seconds[f + 1], np.empty((HALVINGS + 8, 8)), found)
                found[1] = 0.0
            np.testing.assert_array_equal(travel[link, f], found[:2])
