"""Guards at work against an integration written apart from them, and against closed forms."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from replay.guarding.guard import Combined, Guard, SensorLeaf
from replay.guarding.outcome import GuardOutcomes
from replay.guarding.reaction import Reaction
from replay.kinematics.linkage import Joint, JointType
from replay.kinematics.motion import Motion
from replay.kinematics.profiles import Profile, from_pieces, trapezoid
from tests.guarding.integrator import HOLDING, Rule, Script, World

SCENES = 1_000
"""Random scenes; together 40 000 frames."""


def run(
    guards: list[Guard],
    profiles: list[Profile],
    seconds: np.ndarray,
    readings: Callable[[np.ndarray, np.ndarray], np.ndarray],
    step: int,
    joints: list[Joint] | None = None,
):
    """Return what a reaction makes of frames that are looked at `step` at a time, and the reaction."""
    joints = joints or [Joint(f"j{k}", JointType.PRISMATIC) for k in range(len(profiles))]
    reaction = Reaction(guards, Motion(tuple(profiles), ()), joints, range(len(profiles)))
    begin = 0
    while begin < len(seconds):
        part = seconds[begin : begin + step]
        values = readings(np.arange(begin, begin + len(part)), reaction.motion.states(part).positions)

        def told(kind: str, column: int, values: np.ndarray = values):
            return values[:, column], np.zeros(len(values), dtype=bool)

        begin += reaction.decide(begin, part, told, np.zeros((len(part), 0)))
    return reaction.columns(seconds), reaction


def line(speed: float, until: float = 100.0) -> Profile:
    return from_pieces([[0.0, until, 0.0, speed, 0.0, 0.0, 0.0, 0.0]], 0.0, speed * until)


def guard(joints: tuple[int, ...] = (0,), below: float = 0.5, column: int = 0, **changed) -> Guard:
    values = {
        "name": "g",
        "when": SensorLeaf("x", column, below, below + changed.pop("hysteresis", 0.0)),
        "directions": (),
        "hold_frames": 0,
        "reaction": 0.0,
        "target": 0.0,
        "joints": joints,
        "deceleration": (2.0,) * len(joints),
        "acceleration": (1.0,) * len(joints),
        "release_frames": None,
    }
    return Guard(**{**values, **changed})


def at_frame(trigger: int):
    """Return readings that are below the threshold from a frame on."""
    return lambda frames, positions: np.where(frames >= trigger, 0.0, 1.0)[:, None]


@pytest.mark.parametrize("trigger", [0, 1, 8, 9, 10, 37])
@pytest.mark.parametrize("reaction", [0.0, 1e-3, 0.1, 0.25, 1 / 3])
@pytest.mark.parametrize("step", [1, 7, 256])
def test_a_constant_speed_is_stopped_after_the_closed_forms_way_and_time(trigger, reaction, step):
    v, a, seconds = 0.37, 1.3, np.arange(121) / 60.0
    made = guard(reaction=reaction, deceleration=(a,))
    columns, done = run([made], [line(v)], seconds, at_frame(trigger), step)
    (episode,) = done.episodes()
    assert episode.trigger == seconds[trigger]
    assert episode.hold - episode.trigger == pytest.approx(reaction + v / a, rel=1e-12)
    place = done.motion.states(np.array([episode.trigger, 1e3])).positions[:, 0]
    assert place[1] - place[0] == pytest.approx(v * reaction + v * v / (2.0 * a), rel=1e-12)
    assert columns.state[trigger:, 0].tolist() == [
        1 if t < episode.brake else 2 if t < episode.hold else 3 for t in seconds[trigger:]
    ]
    assert not columns.state[:trigger].any()
    joints = [Joint("j0", JointType.PRISMATIC, acceleration=a)]
    outcomes = GuardOutcomes(done, joints, [np.zeros(0, dtype=np.int64)])
    outcomes.update(np.round(seconds * 1e9).astype(np.int64), None)
    (stop,) = outcomes.stops()
    assert stop.joints[0].reaction_distance == pytest.approx(v * reaction, abs=1e-14)
    assert stop.joints[0].stopping_distance == pytest.approx(v * reaction + v * v / (2.0 * a), rel=1e-12)
    assert stop.joints[0].peak_acceleration == pytest.approx(a, rel=1e-12)
    assert stop.joints[0].at_rest


def test_slowing_down_takes_the_closed_forms_time_and_way_and_goes_on_at_its_share():
    v, a, rho = 0.5, 0.8, 0.25
    made = guard(target=rho, deceleration=(a,))
    _, done = run([made], [line(v)], np.arange(301) / 60.0, at_frame(30), 256)
    (episode,) = done.episodes()
    took = v * (1.0 - rho) / a
    assert episode.hold - 0.5 == pytest.approx(took, rel=1e-12)
    places = done.motion.states(np.array([0.5, episode.hold, 5.0])).positions[:, 0]
    assert places[1] - places[0] == pytest.approx(0.5 * v * (1.0 + rho) * took, rel=1e-12)
    assert places[2] - places[1] == pytest.approx(rho * v * (5.0 - episode.hold), rel=1e-12)


def test_two_joints_share_the_longer_braking_and_stay_on_their_common_path():
    profiles = [line(0.3), line(0.9)]
    _, done = run([guard((0, 1), deceleration=(1.0, 1.5))], profiles, np.arange(200) / 60.0, at_frame(60), 256)
    (episode,) = done.episodes()
    assert episode.hold - episode.brake == pytest.approx(0.6, rel=1e-12)
    moved = done.motion.states(np.linspace(0.0, 3.0, 50)).positions
    np.testing.assert_allclose(moved[:, 1], 3.0 * moved[:, 0], rtol=1e-14)


def test_two_guards_on_one_joint_leave_it_the_lesser_factor():
    slow = guard(target=0.5, deceleration=(0.2,), name="a")
    stop = guard(below=0.5, column=1, deceleration=(2.0,), name="b")

    def readings(frames, positions):
        return np.stack([np.where(frames >= 10, 0.0, 1.0), np.where(frames >= 30, 0.0, 1.0)], axis=1)

    columns, done = run([slow, stop], [line(0.4)], np.arange(200) / 60.0, readings, 7)
    begin = 1.0 - (20 / 60) / 1.0  # the first takes 1 s for 0.4 * 0.5 / 0.2
    brake = next(item for item in done.episodes() if item.guard == 1)
    assert brake.hold - brake.brake == pytest.approx(0.4 * (1.0 - (20 / 60) * 0.5) / 2.0, rel=1e-12)
    assert columns.rate[-1, 0] == 0.0
    assert begin > 0.0


def test_a_release_goes_on_from_where_it_stood_and_what_is_left_is_not_played():
    made = guard(deceleration=(1.0,), acceleration=(0.5,), release_frames=30, hysteresis=0.2)

    def readings(frames, positions):
        return np.where((frames >= 30) & (frames < 60), 0.0, np.where(frames < 120, 0.6, 0.8))[:, None]

    columns, done = run([made], [line(0.4)], np.arange(400) / 60.0, readings, 64)
    (episode,) = done.episodes()
    assert episode.release == 150 / 60.0, "0.6 is not above the threshold and its hysteresis"
    assert episode.full - episode.release == pytest.approx(0.8, rel=1e-12)
    lag = 400 / 60.0 - done.motion.clocks[0].at(400 / 60.0)[0]
    held = episode.release - episode.hold
    assert lag == pytest.approx(0.5 * 0.4 + held + 0.5 * 0.8, rel=1e-12)
    assert columns.rate[-1, 0] == 1.0
    kinds = [(item.kind, item.begins) for item in columns.happenings if item.subject == "g"]
    assert kinds == [
        ("trigger", True),
        ("hold", True),
        ("hold", False),
        ("trigger", False),
        ("release", True),
        ("release", False),
    ]


def test_while_the_script_rests_the_clock_stops_at_once():
    profile = from_pieces([[1.0, 2.0, 0.0, 0.4, 0.0, 0.0, 0.0, 0.0]], 0.0, 0.4)
    columns, done = run([guard()], [profile], np.arange(100) / 60.0, at_frame(30), 256)
    (episode,) = done.episodes()
    assert episode.hold == episode.brake == 0.5
    assert columns.state[30, 0] == HOLDING
    assert columns.script_time[-1, 0] == 0.5
    knot = from_pieces([[0.5, 2.0, 0.0, 0.4, 0.0, 0.0, 0.0, 0.0]], 0.0, 0.6)
    _, done = run([guard()], [knot], np.arange(100) / 60.0, at_frame(30), 256)
    assert done.episodes()[0].hold - 0.5 == pytest.approx(0.2), "of both one-sided velocities at a knot"


def test_a_script_that_speeds_up_is_braked_within_the_deceleration_and_the_excess_is_told():
    joint = Joint("j0", JointType.PRISMATIC, acceleration=0.5)
    profile = from_pieces(trapezoid(0.0, 0.0, 2.0, 1.0, 0.5, 0.5), 0.0, 2.0)
    made = guard(deceleration=(0.5,), directions=((0, 1),))
    columns, done = run([made], [profile], np.arange(600) / 60.0, at_frame(30), 256, [joint])
    (episode,) = done.episodes()
    times = np.linspace(episode.brake, episode.hold, 2001)
    script, rate = done.motion.clocks[0].sample(times)
    velocity = profile.sample(script)[1]
    ramp = -1.0 / (episode.hold - episode.brake)
    assert np.abs(velocity * ramp).max() <= 0.5 * (1.0 + 1e-12)
    assert np.abs(velocity * ramp).max() == pytest.approx(0.5, rel=1e-9), "and no longer than it must be"
    outcomes = GuardOutcomes(done, [joint], [np.zeros(0, dtype=np.int64)])
    outcomes.update(np.round(np.arange(600) / 60.0 * 1e9).astype(np.int64), None)
    stopped = outcomes.stops()[0].joints[0]
    total = 0.5 * rate**2 + velocity * ramp
    inside = times < episode.hold
    assert stopped.peak_acceleration == pytest.approx(np.abs(total[inside]).max(), rel=1e-2)
    assert stopped.excess == 1.0, "speeding up and braking cancel here"
    late = guard(deceleration=(0.5,))
    trigger = 150  # the script brakes from 2 s on
    columns, done = run([late], [profile], np.arange(600) / 60.0, at_frame(trigger), 256, [joint])
    excess = [item for item in columns.happenings if item.kind == "excess acceleration"]
    assert [item.begins for item in excess] == [True, False]
    outcomes = GuardOutcomes(done, [joint], [np.zeros(0, dtype=np.int64)])
    outcomes.update(np.round(np.arange(600) / 60.0 * 1e9).astype(np.int64), None)
    stopped = outcomes.stops()[0].joints[0]
    assert stopped.excess == pytest.approx(2.0, rel=1e-12), "the script's and the guard's braking add up at first"
    assert stopped.peak_acceleration == pytest.approx(1.0, rel=1e-12)


def random_script(rng: np.random.Generator) -> tuple[Profile, Script]:
    """Return a script of straight lines, moves from rest to rest, or cubics, for both."""
    kind = rng.integers(0, 3)
    start = float(rng.choice([0.0, rng.uniform(0.0, 0.5)]))
    pieces, place = [], 0.0
    for _ in range(rng.integers(1, 5)):
        if kind == 0:
            length = float(rng.uniform(0.2, 1.5))
            velocity = float(rng.normal())
            row = [start, start + length, place, velocity, 0.0, 0.0, 0.0, 0.0]
            pieces.append(row)
        elif kind == 1:
            rows = trapezoid(start, place, place + float(rng.normal()), *rng.uniform(0.3, 2.0, size=3))
            pieces.extend(rows)
            length = rows[-1][1] - start
        else:
            length = float(rng.uniform(0.4, 1.5))
            c = rng.normal(size=3)
            pieces.append([start, start + length, place, *c.tolist(), 0.0, 0.0])
        last = pieces[-1]
        place = sum(value * (last[1] - last[0]) ** k for k, value in enumerate(last[2:]))
        start += length
    return from_pieces(pieces, 0.0, place), Script([(row[0], row[1], list(row[2:6])) for row in pieces])


def random_scene(seed: int):
    """Return guards, profiles, times and readings of a scene, and the same for the integrator."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(1, 4))
    scripts = [random_script(rng) for _ in range(count)]
    rate = float(rng.choice([10.0, 25.0, 60.0]))
    guards, rules = [], []
    sensors = 3
    for g in range(rng.integers(1, 4)):
        joints = tuple(sorted(rng.choice(count, size=rng.integers(1, count + 1), replace=False).tolist()))
        limits = {j: float(rng.uniform(0.3, 3.0)) for j in joints}
        faster = {j: float(rng.uniform(0.3, 3.0)) for j in joints}
        parts = tuple(
            SensorLeaf(
                "x",
                int(rng.integers(0, sensors)),
                below := float(rng.normal(0.0, 0.5)),
                below + float(rng.choice([0.0, 0.2])),
            )
            for _ in range(rng.integers(1, 3))
        )
        release = None if rng.random() < 0.3 else int(rng.integers(0, 6))
        made = Guard(
            name=f"g{g}",
            when=Combined(parts, all=bool(rng.random() < 0.5)),
            directions=(),
            hold_frames=int(rng.choice([0, 0, 1, 3])),
            reaction=float(rng.choice([0.0, 0.02, 1 / rate, rng.uniform(0.0, 0.3)])),
            target=float(rng.choice([0.0, 0.0, 0.25, rng.uniform(0.0, 0.9)])),
            joints=joints,
            deceleration=tuple(limits[j] for j in joints),
            acceleration=tuple(faster[j] for j in joints),
            release_frames=release,
        )
        guards.append(made)
        rules.append(Rule(list(joints), made.target, limits, faster, made.hold_frames, made.reaction, release))
    frames = 40
    noise = rng.normal(size=(frames, sensors))
    chatter = np.sign(np.sin(rng.uniform(0.1, 2.0) * np.arange(frames)))
    gaps = rng.random((frames, sensors)) < 0.1
    of = rng.integers(0, count, size=sensors)

    def readings(numbers: np.ndarray, positions: np.ndarray) -> np.ndarray:
        values = np.stack(
            [
                1.0 - positions[:, of[0]],
                chatter[numbers] + 0.1 * noise[numbers, 1],
                0.5 * positions[:, of[2]] + 0.3 * noise[numbers, 2],
            ],
            axis=1,
        )
        return np.where(gaps[numbers], np.nan, values)

    return guards, rules, scripts, np.arange(frames) / rate, readings


@pytest.mark.parametrize("part", range(10))
def test_random_scenes_are_what_the_integration_says(part: int) -> None:
    acted = stopped = released = 0
    for seed in range(part * SCENES // 10, (part + 1) * SCENES // 10):
        guards, rules, scripts, seconds, readings = random_scene(seed)
        profiles = [profile for profile, _ in scripts]
        columns, done = run(guards, profiles, seconds, readings, 256)
        for step in (1, 7):
            others, _ = run(guards, profiles, seconds, readings, step)
            for name in ("state", "condition", "factor", "rate", "script_time"):
                assert getattr(others, name).tobytes() == getattr(columns, name).tobytes(), (seed, step, name)
            assert others.happenings == columns.happenings
        world = World([script for _, script in scripts], rules)
        last = {}
        for number, second in enumerate(seconds.tolist()):
            world.advance(second)
            places = np.array([[script.position(s, 0.0) for (_, script), s in zip(scripts, world.clocks, strict=True)]])
            values = readings(np.array([number]), places)[0]
            said = []
            for which in ("below", "released"):
                found = []
                for g, made in enumerate(guards):
                    flags = []
                    for k, leaf in enumerate(made.when.parts):
                        key = (which, g, k)
                        if not math.isnan(values[leaf.column]):
                            last[key] = bool(values[leaf.column] < getattr(leaf, which))
                        flags.append(last.get(key, False))
                    found.append(all(flags) if made.when.all else any(flags))
                said.append(found)
            world.frame(number, *said)
            assert columns.state[number].tolist() == [world.shown(rule) for rule in world.rules], (seed, number)
            np.testing.assert_allclose(columns.script_time[number], world.clocks, rtol=0.0, atol=1e-12)
            rates = [world.rate(joint) for joint in range(len(scripts))]
            np.testing.assert_allclose(columns.rate[number], rates, rtol=0.0, atol=1e-12)
            np.testing.assert_allclose(columns.factor[number], [r.factor for r in world.rules], rtol=0.0, atol=1e-12)
        acted += any(item.hold < seconds[-1] for item in done.episodes())
        stopped += bool((columns.rate == 0.0).any())
        released += any(item.release < seconds[-1] for item in done.episodes())
    assert acted > 40, "of 100"
    assert stopped > 15
    assert released > 10
