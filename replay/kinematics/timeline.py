"""A planned motion as flat arrays, so that compiled code knows the pose of every link at any time.

The poses are those of `Motion.states` and `Linkage.forward`, bit for bit: the same operations in the same order
(tests/kinematics/test_timeline.py). So what is found between the frames holds for whoever asks those.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numba import float64, int64

from replay.kinematics.clock import Clock
from replay.kinematics.linkage import JointType, Linkage
from replay.kinematics.motion import Motion
from replay.numerics.arrays import Floats, Integers
from replay.numerics.jit import entry, leaf_kernel, record

FIXED, REVOLUTE, PRISMATIC, FREE = range(4)
"""Kinds of joints, as kernels see them."""

_KINDS = {
    JointType.FIXED: FIXED,
    JointType.REVOLUTE: REVOLUTE,
    JointType.CONTINUOUS: REVOLUTE,
    JointType.PRISMATIC: PRISMATIC,
    JointType.FREE: FREE,
}


class Timeline(NamedTuple):
    """L links of a linkage and the motion of their J scalar and K free joints.

    The pieces of scalar joint j are the rows `piece_first[j]:piece_first[j + 1]`, see `profiles.Profile`; the key
    frames of free joint k the rows `key_first[k]:key_first[k + 1]`, none if it stays where it is; the pieces of the
    clock of scalar joint j, see `clock.Clock`, the rows `clock_first[j]:clock_first[j + 1]`, none if it goes by time.
    """

    parent: Integers  # (L,), -1 for a root
    kind: Integers  # (L,)
    place: Floats  # (L, 4, 4), T_parent_joint
    axis: Floats  # (L, 3)
    joint: Integers  # (L,), index of the scalar or free joint, -1 if fixed
    piece_first: Integers  # (J + 1,)
    start: Floats  # (m,) [s]
    end: Floats  # (m,) [s]
    coefficients: Floats  # (m, 6)
    before: Floats  # (J,) [rad or m]
    after: Floats  # (J,) [rad or m]
    key_first: Integers  # (K + 1,)
    key_time: Floats  # (k,) [s]
    key_xyz: Floats  # (k, 3) [m]
    key_quat: Floats  # (k, 4)
    clock_first: Integers  # (J + 1,)
    clock_start: Floats  # (c,) [s]
    clock_script: Floats  # (c,) [s]
    clock_rate: Floats  # (c,)
    clock_ramp: Floats  # (c,) [1/s]


TIMELINE_TYPE = record(
    Timeline,
    int64[::1],
    int64[::1],
    float64[:, :, ::1],
    float64[:, ::1],
    int64[::1],
    int64[::1],
    float64[::1],
    float64[::1],
    float64[:, ::1],
    float64[::1],
    float64[::1],
    int64[::1],
    float64[::1],
    float64[:, ::1],
    float64[:, ::1],
    int64[::1],
    float64[::1],
    float64[::1],
    float64[::1],
    float64[::1],
)


def timeline(linkage: Linkage, motion: Motion) -> Timeline:
    """Return a linkage and its motion as arrays."""
    index = {name: k for k, name in enumerate(linkage.joint_names)}
    index |= {name: k for k, name in enumerate(linkage.free_names)}
    links, profiles = linkage.links, motion.profiles
    keys = [path for path in motion.paths if path is not None]
    clocks = motion.clocks or (Clock.steady(),) * len(profiles)
    return Timeline(
        parent=linkage.parents,
        kind=np.array([_KINDS[link.joint.type] for link in links], dtype=np.int64),
        place=np.array([link.T_parent_joint for link in links], dtype=np.float64).reshape(-1, 4, 4),
        axis=np.array([link.joint.axis for link in links], dtype=np.float64).reshape(-1, 3),
        joint=np.array([index.get(link.joint.name, -1) for link in links], dtype=np.int64),
        piece_first=_starts([len(profile.start) for profile in profiles]),
        start=_joined([profile.start for profile in profiles]),
        end=_joined([profile.end for profile in profiles]),
        coefficients=_joined([profile.coefficients for profile in profiles], 6),
        before=np.array([profile.before for profile in profiles], dtype=np.float64),
        after=np.array([profile.after for profile in profiles], dtype=np.float64),
        key_first=_starts([0 if path is None else len(path.times) for path in motion.paths]),
        key_time=_joined([path.times for path in keys]),
        key_xyz=_joined([path.xyz for path in keys], 3),
        key_quat=_joined([path.quat_xyzw for path in keys], 4),
        clock_first=_starts([len(clock.start) for clock in clocks]),
        clock_start=_joined([clock.start for clock in clocks]),
        clock_script=_joined([clock.script for clock in clocks]),
        clock_rate=_joined([clock.rate for clock in clocks]),
        clock_ramp=_joined([clock.ramp for clock in clocks]),
    )


def _starts(counts: Sequence[int]) -> Integers:
    return np.concatenate([[0], np.cumsum(counts, dtype=np.int64)]).astype(np.int64)


def _joined(parts: Sequence[Floats], *rest: int) -> Floats:
    return np.ascontiguousarray(np.concatenate([np.zeros((0, *rest)), *parts]))


@leaf_kernel
def last_at_or_before(times: Floats, begin: int, end: int, t: float) -> int:
    """Return the last k of begin..end-1 with times[k] <= t, begin - 1 if there is none."""
    while begin < end:
        middle = (begin + end) // 2
        if times[middle] <= t:
            begin = middle + 1
        else:
            end = middle
    return begin - 1


@leaf_kernel
def polynomial(c: Floats, tau: float) -> float:
    """Return c0 + c1 tau + .. + c5 tau^5 as `Profile.sample` computes it."""
    value = c[5]
    for power in range(4, -1, -1):
        value = value * tau + c[power]
    return float(value)


@leaf_kernel
def script_time(line: Timeline, joint: int, t: float) -> float:
    """Return how far the script of a scalar joint has come at time t [s], as `Clock.sample` computes it."""
    begin, end = line.clock_first[joint], line.clock_first[joint + 1]
    k = last_at_or_before(line.clock_start, begin, end, t)
    if k < begin:
        return float(t)
    u = t - line.clock_start[k]
    return float(line.clock_script[k] + u * (line.clock_rate[k] + 0.5 * line.clock_ramp[k] * u))


@leaf_kernel
def scripted(line: Timeline, joint: int, s: float) -> float:
    """Return the position [rad or m] of a scalar joint at script time s [s]."""
    begin, end = line.piece_first[joint], line.piece_first[joint + 1]
    if begin == end or s >= line.end[end - 1]:
        return float(line.after[joint])
    k = last_at_or_before(line.start, begin, end, s)
    if k < begin:
        return float(line.before[joint])
    return polynomial(line.coefficients[k], min(s, line.end[k]) - line.start[k])


@leaf_kernel
def position(line: Timeline, joint: int, t: float) -> float:
    """Return the position [rad or m] of a scalar joint at time t [s]."""
    return scripted(line, joint, script_time(line, joint, t))


@leaf_kernel
def segment(line: Timeline, free: int, t: float) -> tuple[int, int, float]:
    """Return the key frames before and after time t [s] of a free joint that has some, and the way between done."""
    begin, end = line.key_first[free], line.key_first[free + 1]
    first = max(last_at_or_before(line.key_time, begin, end, t), begin)
    second = min(first + 1, end - 1)
    span = line.key_time[second] - line.key_time[first] if second > first else 1.0
    return first, second, min(max((t - line.key_time[first]) / span, 0.0), 1.0)


@leaf_kernel
def half_turn(line: Timeline, first: int, second: int) -> tuple[float, float]:
    """Return half the angle [rad] that the shorter rotation between two key frames turns by, and its sign, +1 or -1.

    The sign is that of the second quaternion which makes the rotation the shorter one.
    """
    p, q = line.key_quat[first], line.key_quat[second]
    sign = -1.0 if p[0] * q[0] + p[1] * q[1] + p[2] * q[2] + p[3] * q[3] < 0.0 else 1.0
    apart, along = 0.0, 0.0
    for i in range(4):
        apart += (sign * q[i] - p[i]) ** 2
        along += (sign * q[i] + p[i]) ** 2
    return 2.0 * math.atan2(math.sqrt(apart), math.sqrt(along)), sign


@leaf_kernel
def _free_pose(line: Timeline, free: int, t: float, pose: Floats) -> None:
    """Write the pose (4, 4) of a free joint's link in its joint's frame."""
    for i in range(4):
        for j in range(4):
            pose[i, j] = 1.0 if i == j else 0.0
    if line.key_first[free] == line.key_first[free + 1]:
        return
    first, second, fraction = segment(line, free, t)
    angle, sign = half_turn(line, first, second)
    whole = math.sin(angle)
    if whole < 1e-8:
        a, b = 1.0 - fraction, fraction
    else:
        a, b = math.sin((1.0 - fraction) * angle) / whole, math.sin(fraction * angle) / whole
    p, q = line.key_quat[first], line.key_quat[second]
    x, y = a * p[0] + b * (sign * q[0]), a * p[1] + b * (sign * q[1])
    z, w = a * p[2] + b * (sign * q[2]), a * p[3] + b * (sign * q[3])
    for _ in range(2):  # `slerp` and `from_quaternion` both divide by the length
        length = math.sqrt(x * x + y * y + z * z + w * w)
        x, y, z, w = x / length, y / length, z / length, w / length
    pose[0, 0], pose[1, 1], pose[2, 2] = (
        1.0 - 2.0 * (y * y + z * z),
        1.0 - 2.0 * (x * x + z * z),
        1.0 - 2.0 * (x * x + y * y),
    )
    pose[0, 1], pose[1, 0] = 2.0 * (x * y - w * z), 2.0 * (x * y + w * z)
    pose[0, 2], pose[2, 0] = 2.0 * (x * z + w * y), 2.0 * (x * z - w * y)
    pose[1, 2], pose[2, 1] = 2.0 * (y * z - w * x), 2.0 * (y * z + w * x)
    for i in range(3):
        pose[i, 3] = line.key_xyz[first, i] + fraction * (line.key_xyz[second, i] - line.key_xyz[first, i])


@leaf_kernel
def compose(first: Floats, second: Floats, product: Floats) -> None:
    """Write first second, rigid transforms (4, 4), in the order of operations of `transforms.compose`."""
    for i in range(3):
        x, y, z = first[i, 0], first[i, 1], first[i, 2]
        for j in range(3):
            product[i, j] = x * second[0, j] + y * second[1, j] + z * second[2, j]
        product[i, 3] = x * second[0, 3] + y * second[1, 3] + z * second[2, 3] + first[i, 3]
        product[3, i] = 0.0
    product[3, 3] = 1.0


@leaf_kernel
def local_pose(line: Timeline, link: int, t: float, scratch: Floats, pose: Floats) -> None:
    """Write T_parent_link (4, 4) at time t [s]; `scratch` is (4, 4)."""
    kind = line.kind[link]
    if kind == FIXED:
        for i in range(4):
            for j in range(4):
                pose[i, j] = line.place[link, i, j]
        return
    if kind == FREE:
        _free_pose(line, line.joint[link], t, scratch)
    else:
        for i in range(4):
            for j in range(4):
                scratch[i, j] = 1.0 if i == j else 0.0
        q, axis = position(line, line.joint[link], t), line.axis[link]
        if kind == PRISMATIC:
            for i in range(3):
                scratch[i, 3] = q * axis[i]
        else:
            x, y, z = axis[0], axis[1], axis[2]
            s, c, half = math.sin(q), math.cos(q), math.sin(0.5 * q)
            k = 2.0 * half * half
            scratch[0, 0], scratch[0, 1], scratch[0, 2] = c + k * x * x, k * x * y - s * z, k * x * z + s * y
            scratch[1, 0], scratch[1, 1], scratch[1, 2] = k * x * y + s * z, c + k * y * y, k * y * z - s * x
            scratch[2, 0], scratch[2, 1], scratch[2, 2] = k * x * z - s * y, k * y * z + s * x, c + k * z * z
    compose(line.place[link], scratch, pose)


@entry(TIMELINE_TYPE, float64[::1], float64[:, ::1], float64[:, :, :, ::1])
@leaf_kernel
def local_poses(line: Timeline, seconds: Floats, scratch: Floats, poses: Floats) -> None:
    """Write T_parent_link (n, L, 4, 4) of all links at times (n,) [s]; `scratch` is (4, 4)."""
    for f in range(len(seconds)):
        for link in range(len(line.kind)):
            local_pose(line, link, seconds[f], scratch, poses[f, link])
