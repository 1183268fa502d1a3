"""Scripted motion: what each joint does, and the joint states of all frames at once."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from replay.errors import InvalidValue, MotionLimitError
from replay.kinematics.clock import Clock
from replay.kinematics.linkage import Joint, Linkage, Mimic
from replay.kinematics.profiles import (
    Profile,
    Waypoint,
    from_pieces,
    through_samples,
    through_waypoints,
    trapezoid,
    trapezoid_time,
)
from replay.numerics import transforms
from replay.numerics.arrays import Floats

LIMIT_SLACK = 1e-9  # relative: a move planned exactly at its limit may exceed it by rounding, never by more


@dataclass(frozen=True)
class Move:
    """A move of one or more joints from rest to rest, each by a trapezoidal velocity profile.

    Attributes:
        to: target position [rad or m] by joint name.
        start: [s], or None: when the last earlier move of any of its joints has ended.
        speed: fraction of the joints' velocity and acceleration limits that is used, in (0, 1].
        synchronised: all joints arrive together with the slowest, each profile stretched in time.
    """

    to: Mapping[str, float]
    start: float | None = None
    speed: float = 1.0
    synchronised: bool = True


@dataclass(frozen=True)
class Keyframe:
    """Pose of a free joint's link, in the joint's frame, at one time [s]; xyz in m, a unit quaternion xyzw."""

    time: float
    xyz: tuple[float, float, float]
    quat_xyzw: tuple[float, float, float, float]


@dataclass(frozen=True, eq=False)
class Track:
    """Recorded positions of a joint.

    Attributes:
        seconds: (n,) times [s], strictly increasing; n >= 1.
        positions: (n,) [rad or m].
        tolerance: how far they may be beyond the joint's limits [rad or m]: what was measured has noise.
    """

    seconds: Floats
    positions: Floats
    tolerance: float = 0.0


@dataclass(frozen=True, eq=False)
class FreeTrack:
    """Recorded poses of a free joint's link, in the joint's frame.

    Attributes:
        seconds: (n,) times [s], strictly increasing; n >= 1.
        xyz: (n, 3) [m].
        quat_xyzw: (n, 4), not zero.
    """

    seconds: Floats
    xyz: Floats
    quat_xyzw: Floats


@dataclass(frozen=True)
class Script:
    """All scripted motion of a scenario; a joint that no entry names holds its initial position."""

    points: Mapping[str, tuple[Waypoint, ...]] = field(default_factory=dict)
    moves: tuple[Move, ...] = ()
    free: Mapping[str, tuple[Keyframe, ...]] = field(default_factory=dict)
    recorded: Mapping[str, Track] = field(default_factory=dict)
    recorded_free: Mapping[str, FreeTrack] = field(default_factory=dict)

    def tolerance(self, joint: str, followers: Mapping[str, Mimic]) -> float:
        """Return how far a joint may be beyond its position limits [rad or m]; of a follower by its leader."""
        mimic = followers.get(joint, Mimic(joint))
        track = self.recorded.get(mimic.joint)
        return abs(mimic.multiplier) * track.tolerance if track is not None else 0.0


@dataclass(frozen=True, eq=False)
class JointStates:
    """Joint states of n frames.

    Attributes:
        positions: (n, J) [rad or m], in the order of `Linkage.joint_names`.
        velocities: (n, J) [per s].
        free_poses: (n, K, 4, 4), T_joint_link of the free joints, in the order of `Linkage.free_names`.
    """

    positions: Floats
    velocities: Floats
    free_poses: Floats


@dataclass(frozen=True, eq=False)
class Motion:
    """A script planned for a linkage and checked against its limits; it answers for any times.

    Attributes:
        profiles: of the J joints, in the order of `Linkage.joint_names`.
        paths: of the K free joints, in the order of `Linkage.free_names`; None for one that stays where it is.
        clocks: of the J joints; none where no script is ever slowed down. Free joints go by the time itself.
    """

    profiles: tuple[Profile, ...]
    paths: tuple[FreePath | None, ...]
    clocks: tuple[Clock, ...] = ()

    def states(self, seconds: Floats) -> JointStates:
        """Return the joint states at times (n,) [s]; those at one time do not depend on the others."""
        n = len(seconds)
        positions = np.empty((n, len(self.profiles)))
        velocities = np.empty((n, len(self.profiles)))
        for k, profile in enumerate(self.profiles):
            if not self.clocks:
                positions[:, k], velocities[:, k] = profile.sample(seconds)
                continue
            script, rate = self.clocks[k].sample(seconds)
            positions[:, k], velocity = profile.sample(script)
            velocities[:, k] = velocity * rate
        free_poses = transforms.identity(n, len(self.paths))
        for k, path in enumerate(self.paths):
            if path is not None:
                free_poses[:, k] = path.poses(seconds)
        return JointStates(positions, velocities, free_poses)


def plan(linkage: Linkage, script: Script) -> Motion:
    """Return the motion that a script describes, after checking the whole of it against every limit.

    Args:
        linkage: whose joints the script moves.
        script: see `Script`; each joint may be moved by one kind of entry only.

    Raises:
        InvalidValue: a joint does not exist, is of the wrong type or scripted twice, or times are out of order.
        MotionLimitError: the script breaks a position, velocity or acceleration limit between or at frames.

    Accuracy: positions of moves and cubic points within 1e-14 of the range moved (tests/kinematics/test_motion.py).
    Along straight lines through waypoints the velocity jumps at each waypoint, so acceleration is checked only where
    it exists, inside the intervals.
    """
    profiles = joint_profiles(linkage, script)
    for joint in linkage.joints:
        check_limits(joint, profiles[joint.name], script.tolerance(joint.name, linkage.followers))
    paths = {name: FreePath.through(name, keyframes) for name, keyframes in script.free.items()}
    paths |= {name: FreePath.along(name, track) for name, track in script.recorded_free.items()}
    return Motion(tuple(profiles[joint.name] for joint in linkage.joints), tuple(map(paths.get, linkage.free_names)))


def sample(linkage: Linkage, script: Script, seconds: Floats) -> JointStates:
    """Return the joint states at times (n,) [s]; see `plan`."""
    return plan(linkage, script).states(seconds)


def joint_profiles(linkage: Linkage, script: Script) -> dict[str, Profile]:
    """Return the profile of every scalar joint by name; see `sample` for what is raised."""
    joints = {joint.name: joint for joint in linkage.joints}
    moved = {name for move in script.moves for name in move.to}
    for kind, names in (("points", set(script.points)), ("moves", moved), ("recorded", set(script.recorded))):
        for name in sorted(names - joints.keys()):
            raise InvalidValue(f"motion.{kind}", repr(name), f"names no such joint; joints are {sorted(joints)}")
    for name in sorted((set(script.free) | set(script.recorded_free)) - set(linkage.free_names)):
        raise InvalidValue(
            "motion.free", repr(name), f"names no free joint; free joints are {list(linkage.free_names)}"
        )
    for name in sorted(set(script.free) & set(script.recorded_free)):
        raise InvalidValue("motion.free", repr(name), "is moved by motion.recorded as well; keep one of the two")
    for name in sorted(moved & set(script.points)):
        raise InvalidValue("motion.moves", repr(name), "is moved by motion.points as well; keep one of the two")
    for name in sorted(set(script.recorded) & (moved | set(script.points))):
        raise InvalidValue("motion.recorded", repr(name), "is moved by motion.points or moves as well; keep one")
    for name in sorted((moved | set(script.points) | set(script.recorded)) & linkage.followers.keys()):
        leader = linkage.followers[name].joint
        raise InvalidValue("motion", repr(name), f"follows joint {leader!r}, which alone moves it; move that one")
    profiles = {name: from_pieces([], joint.initial, joint.initial) for name, joint in joints.items()}
    profiles |= {name: through_waypoints(name, points) for name, points in script.points.items()}
    profiles |= {name: through_samples(track.seconds, track.positions) for name, track in script.recorded.items()}
    profiles |= _planned(joints, script.moves)
    for name, mimic in linkage.followers.items():
        profiles[name] = profiles[mimic.joint].scaled(mimic.multiplier, mimic.offset)
    return profiles


def check_limits(joint: Joint, profile: Profile, tolerance: float = 0.0) -> None:
    """Raise MotionLimitError where the profile leaves the joint's limits, the worst place first.

    Args:
        joint: whose limits they are.
        profile: its motion.
        tolerance: how far positions may be beyond [rad or m].
    """
    unit = joint.type.unit
    faster, slower = joint.acceleration, joint.braking
    limits = [
        (profile, 0, "position", joint.lower, joint.upper, unit),
        (profile, 1, "velocity", -joint.velocity, joint.velocity, f"{unit}/s"),
    ]
    if faster == slower:
        limits.append((profile, 2, "acceleration", -faster, faster, f"{unit}/s^2"))
    else:  # against the velocity it is a deceleration
        rising, falling = profile.by_direction()
        limits.append((rising, 2, "acceleration", -slower, faster, f"{unit}/s^2"))
        limits.append((falling, 2, "acceleration", -faster, slower, f"{unit}/s^2"))
    for part, derivative, quantity, lower, upper, unit in limits:
        if math.isinf(lower) and math.isinf(upper):
            continue
        candidates = part.extremes(derivative)
        if not candidates:
            continue
        size = max(abs(bound) for bound in (lower, upper) if math.isfinite(bound))
        over_time, over = max(candidates, key=lambda item: item[1])
        under_time, under = min(candidates, key=lambda item: item[1])
        slack = LIMIT_SLACK * size + (tolerance if derivative == 0 else 0.0)
        if over > upper + slack:
            raise MotionLimitError(joint.name, over_time, quantity, over, upper, unit)
        if under < lower - slack:
            raise MotionLimitError(joint.name, under_time, quantity, under, lower, unit)


def _planned(joints: Mapping[str, Joint], moves: tuple[Move, ...]) -> dict[str, Profile]:
    """Plan the moves in the order they are written."""
    pieces: dict[str, list[list[float]]] = {}
    position: dict[str, float] = {}
    free_from: dict[str, float] = {}
    for number, move in enumerate(moves):
        place = f"motion.moves[{number}]"
        names = sorted(move.to)
        if not names:
            raise InvalidValue(f"{place}.to", "{}", "must name at least one joint")
        if not 0.0 < move.speed <= 1.0:
            raise InvalidValue(f"{place}.speed", move.speed, "must be above 0 and at most 1")
        ready = max(free_from.get(name, 0.0) for name in names)
        start = ready if move.start is None else move.start
        for name in names:
            joint = joints[name]
            if start < free_from.get(name, 0.0):
                rule = f"joint {name!r} is still moving until {free_from[name]:.6g} s; start then or later"
                raise InvalidValue(f"{place}.start", f"{start:.6g} s", rule)
            rates = {"velocity": joint.velocity, "acceleration": joint.acceleration, "deceleration": joint.braking}
            for limit, value in rates.items():
                if not (0.0 < value < math.inf):
                    rule = f"a move needs a finite {limit} limit above 0 on joint {name!r}; give it one, or use points"
                    raise InvalidValue(f"{place}.to.{name}", f"{limit} limit {value}", rule)
        origins = {name: position.get(name, joints[name].initial) for name in names}
        planned = {
            name: tuple(limit * move.speed for limit in (joint.velocity, joint.acceleration, joint.braking))
            for name, joint in ((name, joints[name]) for name in names)
        }
        times = {name: trapezoid_time(abs(move.to[name] - origins[name]), *planned[name]) for name in names}
        slowest = max(times.values())
        for name in names:
            velocity, acceleration, braking = planned[name]
            if move.synchronised and 0.0 < times[name] < slowest:
                stretch = times[name] / slowest  # a profile stretched in time keeps its shape and its limits
                velocity = velocity * stretch
                acceleration, braking = (rate * stretch * stretch for rate in (acceleration, braking))
            way = (origins[name], move.to[name])
            pieces.setdefault(name, []).extend(trapezoid(start, *way, velocity, acceleration, braking))
            position[name] = move.to[name]
            free_from[name] = start + (slowest if move.synchronised else times[name])
    return {name: from_pieces(parts, joints[name].initial, position[name]) for name, parts in pieces.items()}


@dataclass(frozen=True, eq=False)
class FreePath:
    """The way of a free joint: m times [s], positions (m, 3) [m] and unit quaternions (m, 4)."""

    times: Floats
    xyz: Floats
    quat_xyzw: Floats

    @staticmethod
    def through(name: str, keyframes: tuple[Keyframe, ...]) -> FreePath:
        """Return the path through key frames; InvalidValue when there are none, or their times do not increase."""
        if not keyframes:
            raise InvalidValue(f"motion.free.{name}", "[]", "must have at least one key frame")
        times, xyz, quat = zip(*((key.time, key.xyz, key.quat_xyzw) for key in keyframes), strict=True)
        return FreePath.along(name, FreeTrack(np.array(times), np.array(xyz), np.array(quat)))

    @staticmethod
    def along(name: str, track: FreeTrack) -> FreePath:
        """Return the path through recorded poses; InvalidValue when their times do not strictly increase."""
        if np.any(np.diff(track.seconds) <= 0.0):
            raise InvalidValue(f"motion.free.{name}", track.seconds.tolist(), "times must strictly increase")
        quat = track.quat_xyzw
        return FreePath(track.seconds, track.xyz, quat / np.sqrt(np.sum(quat**2, axis=-1))[:, None])

    def poses(self, seconds: Floats) -> Floats:
        """Poses (n, 4, 4) between key frames: position on a straight line, rotation by slerp, the end values hold."""
        times, xyz = self.times, self.xyz
        begin = np.clip(np.searchsorted(times, seconds, side="right") - 1, 0, len(times) - 1)
        end = np.minimum(begin + 1, len(times) - 1)
        span = np.where(end > begin, times[end] - times[begin], 1.0)
        fraction = np.clip((seconds - times[begin]) / span, 0.0, 1.0)
        poses = transforms.from_quaternion(transforms.slerp(self.quat_xyzw[begin], self.quat_xyzw[end], fraction))
        poses[:, :3, 3] = xyz[begin] + fraction[:, None] * (xyz[end] - xyz[begin])
        return poses
