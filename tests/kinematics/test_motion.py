"""Scripted motion against closed forms, finite differences and its limits."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from replay.errors import InvalidValue, MotionLimitError
from replay.kinematics.linkage import Joint, JointType, Link, Linkage, Mimic
from replay.kinematics.motion import Keyframe, Move, Script, Track, Waypoint, plan, sample
from replay.kinematics.profiles import from_pieces, through_waypoints, trapezoid, trapezoid_time
from replay.numerics import transforms
from tests.amounts import cases

LOGGED = Track(np.arange(3.0), np.zeros(3))


def linkage(*joints: Joint) -> Linkage:
    return Linkage([Link(f"link_{joint.name}", None, transforms.identity(), joint) for joint in joints])


def hinge(name: str = "hinge", **limits: float) -> Joint:
    return Joint(name, JointType.REVOLUTE, **limits)


@pytest.mark.parametrize(
    ("powers", "with_velocity", "with_acceleration"), [(1, False, False), (3, True, False), (5, True, True)]
)
def test_waypoints_reproduce_any_polynomial_of_their_order(powers, with_velocity, with_acceleration):
    truth = np.polynomial.Polynomial(np.random.default_rng(powers).normal(size=powers + 1))
    first, second = truth.deriv(1), truth.deriv(2)
    waypoints = tuple(
        Waypoint(t, truth(t), first(t) if with_velocity else None, second(t) if with_acceleration else None)
        for t in (0.5, 1.25, 3.0)
    )
    seconds = np.linspace(0.5, 3.0, 101)
    states = sample(linkage(hinge()), Script(points={"hinge": waypoints}), seconds)
    # 1e-12: the polynomial reaches about 200 here, and its coefficients are quotients of h^5
    np.testing.assert_allclose(states.positions[:, 0], truth(seconds), rtol=0, atol=1e-12 * 200)
    inner = np.abs(seconds[:, None] - [0.5, 1.25, 3.0]).min(axis=1) > 1e-9
    np.testing.assert_allclose(states.velocities[inner, 0], first(seconds[inner]), rtol=0, atol=1e-12 * 500)


def test_positions_hold_before_the_first_and_after_the_last_waypoint():
    waypoints = (Waypoint(1.0, 0.3, 0.5), Waypoint(2.0, -0.4, 0.5))
    states = sample(linkage(hinge()), Script(points={"hinge": waypoints}), np.array([0.0, 0.999, 2.001, 9.0]))
    assert states.positions[:, 0].tolist() == [0.3, 0.3, -0.4, -0.4]
    assert states.velocities[:, 0].tolist() == [0.0, 0.0, 0.0, 0.0]


@given(
    distance=st.floats(1e-6, 1e3),
    velocity=st.floats(1e-3, 1e2),
    acceleration=st.floats(1e-3, 1e2),
    sign=st.sampled_from([-1.0, 1.0]),
)
@settings(max_examples=cases(200), deadline=None)
def test_trapezoid_arrives_at_rest_within_its_limits(distance, velocity, acceleration, sign):
    target = 0.25 + sign * distance
    profile = from_pieces(trapezoid(2.0, 0.25, target, velocity, acceleration), 0.25, target)
    total = trapezoid_time(distance, velocity, acceleration)
    seconds = 2.0 + total * np.linspace(0.0, 1.0, 401)
    position, speed = profile.sample(seconds)
    # area under the velocity, by Simpson over each piece exactly: quadratic positions telescope
    assert position[0] == 0.25
    assert position[-1] == pytest.approx(target, abs=1e-13 * (1 + distance))
    assert np.all(np.diff(position) * sign >= -1e-12 * (1 + distance))
    assert np.abs(speed).max() <= velocity * (1 + 1e-12)
    steps = np.abs(np.diff(speed)) / np.diff(seconds)
    assert steps.max() <= acceleration * (1 + 1e-6)  # 1e-6: difference quotients over a 400th of the way
    bound = max(distance / velocity, math.sqrt(2 * distance / acceleration))
    assert total >= bound * (1 - 1e-12)


def test_trapezoid_in_closed_form():
    assert trapezoid_time(10.0, 2.0, 1.0) == 7.0  # 2 s up, 3 s at 2 m/s, 2 s down
    assert trapezoid_time(1.0, 2.0, 1.0) == 2.0  # never reaches 2 m/s
    profile = from_pieces(trapezoid(1.0, 0.0, 10.0, 2.0, 1.0), 0.0, 10.0)
    position, velocity = profile.sample(np.array([1.0, 2.0, 3.0, 4.0, 6.0, 7.0, 8.0]))
    assert position.tolist() == [0.0, 0.5, 2.0, 4.0, 8.0, 9.5, 10.0]
    assert velocity.tolist() == [0.0, 1.0, 2.0, 2.0, 2.0, 1.0, 0.0]


def test_synchronised_joints_arrive_together_and_keep_their_limits():
    fast, slow = hinge("fast", velocity=2.0, acceleration=4.0), hinge("slow", velocity=0.5, acceleration=1.0)
    script = Script(moves=(Move({"fast": 1.0, "slow": -1.0}, start=0.5), Move({"fast": 0.0})))
    seconds = np.linspace(0.0, 6.0, 6001)
    states = sample(linkage(fast, slow), script, seconds)
    end = 0.5 + trapezoid_time(1.0, 0.5, 1.0)
    before = seconds < end - 1e-3
    assert np.all(np.abs(states.positions[before] - [1.0, -1.0]) > 0.0)
    at_end = np.searchsorted(seconds, end)
    np.testing.assert_allclose(states.positions[at_end], [1.0, -1.0], atol=1e-5)  # one millisecond of motion
    own = trapezoid_time(1.0, 2.0, 4.0)  # the fast joint runs its own profile, stretched in time
    alone = from_pieces(trapezoid(0.0, 0.0, 1.0, 2.0, 4.0), 0.0, 1.0)
    stretched = alone.sample((seconds[before] - 0.5) * own / (end - 0.5))[0]
    np.testing.assert_allclose(states.positions[before, 0], stretched, atol=1e-12)
    assert states.positions[-1].tolist() == [0.0, -1.0]


@pytest.mark.parametrize(
    ("script", "message"),
    [
        (Script(points={"hinge": (Waypoint(0.0, 0.0), Waypoint(2.0, 3.0))}), "position = 3 rad at t = 2 s is above"),
        (
            Script(points={"hinge": (Waypoint(0.0, 0.0), Waypoint(0.5, -1.0))}),
            "velocity = -2 rad/s at t = 0 s is below",
        ),
        # the cubic swings below both ends between the frames; only its stationary point shows it
        (
            Script(points={"hinge": (Waypoint(0, -1.9, -0.9), Waypoint(1, -1.9, 0.9))}),
            "position = -2.125 rad at t = 0.5",
        ),
        (Script(points={"hinge": (Waypoint(0, 0, 0.0), Waypoint(1, 1, 0.0))}), "velocity = 1.5 rad/s at t = 0.5 s"),
        (Script(points={"hinge": (Waypoint(0, 0, 0), Waypoint(2, 1, 0))}), "acceleration = 1.5 rad/s^2 at t = 0 s"),
        (Script(moves=(Move({"hinge": -2.5}),)), "position = -2.5 rad"),
    ],
)
def test_a_script_beyond_a_limit_names_joint_time_value_and_limit(script, message):
    joint = hinge(lower=-2.0, upper=2.0, velocity=1.0, acceleration=1.0)
    with pytest.raises(MotionLimitError, match="joint 'hinge'") as caught:
        sample(linkage(joint), script, np.array([0.0, 1.0]))
    assert message in str(caught.value)


def test_a_move_at_exactly_its_limits_is_accepted():
    rng = np.random.default_rng(1)
    for _ in range(200):
        joint = hinge(lower=-10, upper=10, velocity=rng.uniform(0.01, 3), acceleration=rng.uniform(0.01, 3))
        script = Script(moves=(Move({"hinge": 10.0}), Move({"hinge": -10.0}), Move({"hinge": rng.uniform(-10, 10)})))
        sample(linkage(joint), script, np.array([0.0]))


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(("excess", "accepted"), [(1e-10, True), (1e-8, False), (1e-6, False), (1e-4, False)])
def test_a_limit_is_exceeded_by_no_more_than_rounding(excess, accepted, sign):
    beyond = sign * (1.0 + excess)
    size = 3.0
    still = Script(points={"hinge": (Waypoint(0.0, size * beyond),)})
    evenly = Script(points={"hinge": (Waypoint(0.0, 0.0), Waypoint(2.0, 2.0 * size * beyond))})
    # from rest to rest by a cubic: the acceleration is largest at both ends, 6 d / T^2
    smooth = Script(points={"hinge": (Waypoint(0.0, 0.0, 0.0), Waypoint(1.0, size * beyond / 6.0, 0.0))})
    for limits, script in (
        ({"lower": -size, "upper": size}, still),
        ({"velocity": size}, evenly),
        ({"acceleration": size}, smooth),
    ):
        joints = linkage(hinge(**limits))
        if accepted:
            sample(joints, script, np.array([0.0]))
        else:
            with pytest.raises(MotionLimitError, match="joint 'hinge'"):
                sample(joints, script, np.array([0.0]))


@pytest.mark.parametrize(
    ("script", "message"),
    [
        (Script(points={"knee": (Waypoint(0, 0),)}), "names no such joint"),
        (Script(points={"hinge": ()}), "at least one point"),
        (Script(points={"hinge": (Waypoint(1, 0), Waypoint(1, 1))}), "must be above the one before"),
        (Script(moves=(Move({"hinge": 1.0}), Move({"hinge": 0.0}, start=0.1))), "still moving until"),
        (Script(moves=(Move({"free_wheel": 1.0}),)), "finite velocity limit"),
        (Script(moves=(Move({"hinge": 1.0}, speed=1.5),)), "above 0 and at most 1"),
        (Script(points={"hinge": (Waypoint(0, 0),)}, moves=(Move({"hinge": 1.0}),)), "keep one of the two"),
        (Script(free={"hinge": ()}), "names no free joint"),
        (Script(points={"hinge": (Waypoint(0, 0),)}, recorded={"hinge": LOGGED}), "moved by motion.points or moves"),
        (Script(moves=(Move({"hinge": 1.0}),), recorded={"hinge": LOGGED}), "moved by motion.points or moves"),
    ],
)
def test_a_script_that_makes_no_sense_says_what_would(script, message):
    joints = linkage(hinge(velocity=1.0, acceleration=1.0), Joint("free_wheel", JointType.CONTINUOUS))
    with pytest.raises(InvalidValue, match=message):
        sample(joints, script, np.array([0.0]))


def test_free_joint_walks_straight_and_turns_evenly():
    body = Joint("body", JointType.FREE)
    quarter = (0.0, 0.0, math.sin(math.pi / 4), math.cos(math.pi / 4))
    keys = (Keyframe(1.0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)), Keyframe(3.0, (2.0, 4.0, 0.0), quarter))
    seconds = np.array([0.0, 1.0, 1.5, 3.0, 5.0])
    poses = sample(linkage(body), Script(free={"body": keys}), seconds).free_poses[:, 0]
    np.testing.assert_allclose(poses[:, :3, 3], [[0, 0, 0], [0, 0, 0], [0.5, 1, 0], [2, 4, 0], [2, 4, 0]], atol=1e-15)
    angle = np.arctan2(poses[:, 1, 0], poses[:, 0, 0])
    np.testing.assert_allclose(angle, np.array([0, 0, 0.25, 1, 1]) * math.pi / 2, atol=1e-15)


def test_waypoint_velocity_is_the_derivative_of_position():
    rng = np.random.default_rng(4)
    points = tuple(Waypoint(t, *rng.normal(size=3)) for t in (0.0, 0.7, 1.1, 2.4))
    profile = through_waypoints("hinge", points)
    seconds = rng.uniform(0.01, 2.39, 200)
    step = 1e-6
    ahead, behind = profile.sample(seconds + step)[0], profile.sample(seconds - step)[0]
    # central differences: h^2 f'''/6 ~ 1e-12 * 1e3 plus rounding eps/h ~ 1e-9
    np.testing.assert_allclose(profile.sample(seconds)[1], (ahead - behind) / (2 * step), atol=1e-7)


@given(cuts=st.lists(st.integers(0, 700), max_size=6))
def test_a_moment_does_not_depend_on_what_is_sampled_with_it(cuts):
    """Blocks are sampled one by one, so that memory does not grow with the length of a scenario."""
    quarter = (0.3, 0.1, math.sin(math.pi / 4), math.cos(math.pi / 4))
    script = Script(
        points={"through": tuple(Waypoint(t, t * t, t, 1.0) for t in (0.5, 1.25, 3.0))},
        moves=(Move({"hinge": 1.0}, start=0.3), Move({"hinge": -0.5}, speed=0.4)),
        free={"body": (Keyframe(1.0, (0, 0, 0), (0, 0, 0, 1)), Keyframe(5.0, (2, 4, 1), quarter))},
        recorded={"logged": Track(np.arange(8.0), np.sin(np.arange(8.0)))},
    )
    joints = [hinge(velocity=1.0, acceleration=2.0), hinge("through"), hinge("logged"), hinge("still")]
    motion = plan(linkage(*joints, Joint("body", JointType.FREE)), script)
    seconds = np.arange(700) / 90.0
    whole = motion.states(seconds)
    parts = [motion.states(part) for part in np.split(seconds, sorted(cuts))]
    for name in ("positions", "velocities", "free_poses"):
        assert np.concatenate([getattr(part, name) for part in parts]).tobytes() == getattr(whole, name).tobytes()


@pytest.mark.parametrize("distance", [0.05, 0.3, 2.0])  # the second is where the top velocity is just reached
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_move_slows_down_at_its_own_rate(distance, sign):
    velocity, faster, slower = 0.6, 2.0, 0.75
    joint = hinge(velocity=velocity, acceleration=faster, deceleration=slower)
    motion = plan(linkage(joint), Script(moves=(Move({"hinge": sign * distance}),)))
    top = min(velocity, math.sqrt(2.0 * distance * faster * slower / (faster + slower)))
    ramps = 0.5 * top**2 * (1.0 / faster + 1.0 / slower)
    total = top / faster + top / slower + (distance - ramps) / top
    seconds = np.array([0.0, 0.5 * top / faster, top / faster, total - top / slower, total - 0.5 * top / slower, total])
    states = motion.states(seconds)
    rise, fall = 0.5 * top**2 / faster, 0.5 * top**2 / slower
    expected = np.array([0.0, 0.25 * rise, rise, distance - fall, distance - 0.25 * fall, distance])
    np.testing.assert_allclose(states.positions[:, 0], sign * expected, rtol=0, atol=1e-14)
    np.testing.assert_allclose(
        states.velocities[:-1, 0], sign * np.array([0, 0.5, 1, 1, 0.5]) * top, rtol=0, atol=1e-14
    )


def test_slowing_down_is_held_against_the_deceleration_in_both_directions():
    # x = 3 t^2 - 2 t^3 on [0, 1]: speeds up by 6 at the start, slows down by 6 at the end
    for sign in (1.0, -1.0):
        there = (Waypoint(0.0, 0.0, 0.0), Waypoint(1.0, sign, 0.0))
        plan(linkage(hinge(acceleration=6.0, deceleration=7.0)), Script(points={"hinge": there}))
        plan(linkage(hinge(acceleration=7.0, deceleration=6.0)), Script(points={"hinge": there}))
        for limits, time in (
            ({"acceleration": 5.0, "deceleration": 7.0}, 0.0),
            ({"acceleration": 7.0, "deceleration": 5.0}, 1.0),
        ):
            with pytest.raises(MotionLimitError) as caught:
                plan(linkage(hinge(**limits)), Script(points={"hinge": there}))
            assert caught.value.time == pytest.approx(time, abs=1e-12)
            assert abs(caught.value.limit) == 5.0


def test_a_joint_that_follows_moves_with_its_leader_and_keeps_its_own_limits():
    leader = hinge("leader", velocity=1.0, acceleration=2.0)
    follower = Joint("follower", JointType.PRISMATIC, upper=0.2, velocity=0.5, mimic=Mimic("leader", -0.1, 0.05))
    machine = linkage(leader, follower)
    seconds = np.linspace(0.0, 3.0, 50)
    states = sample(machine, Script(moves=(Move({"leader": 1.0}),)), seconds)
    at, of = machine.joint_names.index("leader"), machine.joint_names.index("follower")
    np.testing.assert_allclose(states.positions[:, of], 0.05 - 0.1 * states.positions[:, at], rtol=0, atol=1e-16)
    np.testing.assert_allclose(states.velocities[:, of], -0.1 * states.velocities[:, at], rtol=0, atol=1e-16)
    with pytest.raises(MotionLimitError, match=r"'follower': position = 0\.25 m"):
        plan(machine, Script(moves=(Move({"leader": -2.0}),)))
    for script in (Script(moves=(Move({"follower": 0.1}),)), Script(points={"follower": (Waypoint(0.0, 0.1),)})):
        with pytest.raises(InvalidValue, match="follows joint 'leader'"):
            plan(machine, script)
