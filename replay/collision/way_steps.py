"""The way of joints between two links, step by step, and how far it moves one body as seen from the other.

The steps lead from link a up to the nearest common ancestor and down to link b. For any link m on the way no point of
B moves, as seen from m, farther in an interval than
    L_m = sum over steps between A and m of TV R^A + sum over steps between m and B of TV R^B,
TV the travel of the step's joint and R^X the lever arm of body X: 1 for a joint that moves along an axis; for one that
turns, the distance of X's bounding sphere from the axis at one end, its radius, and what the steps between may add. The
least over m counts (`least_way`). A free joint is two steps: a translation and, on the side of its link, a rotation
about the link's origin. With the arms of an interval, its parts have bounds that add up to no more than its own.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import int64

from replay.collision.bodies import Volumes
from replay.kinematics.linkage import POSE_ROUNDING
from replay.kinematics.timeline import FIXED, FREE, PRISMATIC, Timeline, compose, local_pose
from replay.kinematics.travel import HALVINGS, SHIFT, TRAVEL, TURN, free_travel, joint_travel
from replay.numerics.arrays import Floats, Integers
from replay.numerics.jit import leaf_kernel, record, record_like

ROUNDING_UP = 1.0 + 2.0**-40

ALONG, ABOUT, BALL = range(3)
"""Kinds of steps: along an axis or a path, about an axis, about a point."""


class Chains(NamedTuple):
    """Ways between links: the links of side s of way q, from below the common ancestor down, are `link[first[2 q + s]:
    first[2 q + s + 1]]`."""

    first: Integers
    link: Integers


CHAINS_TYPE = record(Chains, int64[::1], int64[::1])


class Scratch(NamedTuple):
    """What a search works in: the way of the pair at one time, and its steps from A to B."""

    frames: Floats  # (2, D + 1, 4, 4) identity, then the poses of the links of each side in their common ancestor
    pose: Floats  # (4, 4, 4): local pose, its scratch, an inverse, and T_a_b
    kind: Integers  # (E,)
    side: Integers  # (E,)
    row: Integers  # (E,) of `frames`: of the link whose joint it is
    link: Integers  # (E,)
    travel: Floats  # (E,) in an interval
    arm: Floats  # (2, E): lever arms of A and of B
    sum: Floats  # (E + 1,)
    variation: Floats  # (HALVINGS + 8, 8)
    found: Floats  # (4,)
    boxes: Floats  # (8, 4)
    turn: Floats  # (3, 3)
    center: Floats  # (2, 3) of the bodies' spheres, in the common ancestor


def way_scratch(links: int) -> Scratch:
    """Return scratch for ways of up to so many links a side."""
    steps = 4 * links + 2
    frames = np.zeros((2, links + 1, 4, 4))
    for side in range(2):
        for i in range(4):
            frames[side, 0, i, i] = 1.0
    return Scratch(
        frames,
        np.zeros((4, 4, 4)),
        np.empty(steps, np.int64),
        np.empty(steps, np.int64),
        np.empty(steps, np.int64),
        np.empty(steps, np.int64),
        np.empty(steps),
        np.empty((2, steps)),
        np.empty(steps + 1),
        np.empty((HALVINGS + 8, 8)),
        np.empty(4),
        np.zeros((8, 4)),
        np.zeros((3, 3)),
        np.empty((2, 3)),
    )


SCRATCH_TYPE = record_like(way_scratch(1))


@leaf_kernel
def place(line: Timeline, chains: Chains, way: int, t: float, s: Scratch) -> None:
    """Write the poses of a way's links at time t [s], and T_a_b, as `RelativePoses.of` computes it."""
    local, spare, inverse, relative = s.pose[0], s.pose[1], s.pose[2], s.pose[3]
    for side in range(2):
        begin, end = chains.first[2 * way + side], chains.first[2 * way + side + 1]
        for k in range(end - begin):
            local_pose(line, chains.link[begin + k], t, spare, local)
            compose(s.frames[side, k], local, s.frames[side, k + 1])
    a = s.frames[0, chains.first[2 * way + 1] - chains.first[2 * way]]
    for i in range(3):
        for j in range(3):
            inverse[i, j] = a[j, i]
        inverse[i, 3] = -(a[0, i] * a[0, 3] + a[1, i] * a[1, 3] + a[2, i] * a[2, 3])
    compose(inverse, s.frames[1, chains.first[2 * way + 2] - chains.first[2 * way + 1]], relative)


@leaf_kernel
def list_steps(line: Timeline, chains: Chains, way: int, s: Scratch) -> int:
    """Write the steps of the way from A to B; return how many."""
    n = 0
    for side in range(2):
        begin, end = chains.first[2 * way + side], chains.first[2 * way + side + 1]
        for place in range(end - begin):
            k = place if side == 1 else end - begin - 1 - place
            link = chains.link[begin + k]
            kind = line.kind[link]
            for part in range(2 if kind == FREE else 1 if kind != FIXED else 0):
                s.side[n], s.row[n], s.link[n] = side, k + 1, link
                if kind == FREE:  # the rotation is on the side of the link
                    s.kind[n] = BALL if part == side else ALONG
                else:
                    s.kind[n] = ALONG if kind == PRISMATIC else ABOUT
                n += 1
    return n


@leaf_kernel
def measure_travel(line: Timeline, n: int, t0: float, t1: float, s: Scratch) -> None:
    """Write the travel of each of n steps over [t0, t1] [s]."""
    for i in range(n):
        link = s.link[i]
        if line.kind[link] == FREE:
            free_travel(line, line.joint[link], t0, t1, s.found)
            s.travel[i] = s.found[TURN if s.kind[i] == BALL else SHIFT]
        else:
            joint_travel(line, line.joint[link], t0, t1, s.variation, s.found, False)
            s.travel[i] = s.found[TRAVEL]


@leaf_kernel
def measure_arms(
    line: Timeline, chains: Chains, volumes: Volumes, way: int, a: int, b: int, n: int, s: Scratch
) -> float:
    """Write the lever arms of A and B over an interval whose travel is written, from the poses at one end of it.

    Returns the rounding of a pose [m], of either body as seen from the other.
    """
    size = volumes.radius[a] + volumes.radius[b]
    for side in range(2):
        begin, end = chains.first[2 * way + side], chains.first[2 * way + side + 1]
        pose, c = s.frames[side, end - begin], volumes.center[a if side == 0 else b]
        for i in range(3):
            s.center[side, i] = pose[i, 0] * c[0] + pose[i, 1] * c[1] + pose[i, 2] * c[2] + pose[i, 3]
            size += abs(c[i])
        for k in range(end - begin):
            joint = line.place[chains.link[begin + k]]
            for i in range(3):
                # a step's length is at most the way from the step before
                size += abs(joint[i, 3]) + abs(s.frames[side, k + 1, i, 3] - s.frames[side, k, i, 3])
    for body in range(2):
        moved, radius = 0.0, volumes.radius[a if body == 0 else b]
        for step in range(n):
            i = step if body == 0 else n - 1 - step
            arm = 1.0
            if s.kind[i] != ALONG:
                pose, axis = s.frames[s.side[i], s.row[i]], line.axis[s.link[i]]
                x, y, z = (
                    s.center[body, 0] - pose[0, 3],
                    s.center[body, 1] - pose[1, 3],
                    s.center[body, 2] - pose[2, 3],
                )
                square = x * x + y * y + z * z
                if s.kind[i] == ABOUT:
                    u = pose[0, 0] * axis[0] + pose[0, 1] * axis[1] + pose[0, 2] * axis[2]
                    v = pose[1, 0] * axis[0] + pose[1, 1] * axis[1] + pose[1, 2] * axis[2]
                    w = pose[2, 0] * axis[0] + pose[2, 1] * axis[1] + pose[2, 2] * axis[2]
                    square = (y * w - z * v) ** 2 + (z * u - x * w) ** 2 + (x * v - y * u) ** 2
                arm = (math.sqrt(square) + radius + moved) * ROUNDING_UP + POSE_ROUNDING * size
            s.arm[body, i] = arm
            moved += arm * s.travel[i]
        size += moved
    return float(POSE_ROUNDING * size)


@leaf_kernel
def least_way(n: int, s: Scratch) -> tuple[float, int]:
    """Return the least L_m [m] of an interval whose travel is written, and how many steps lie between A and that m."""
    s.sum[n] = 0.0
    for i in range(n - 1, -1, -1):
        s.sum[i] = s.sum[i + 1] + s.travel[i] * s.arm[1, i]
    before, least, split = 0.0, s.sum[0], 0
    for i in range(n):
        before += s.travel[i] * s.arm[0, i]
        if before + s.sum[i + 1] < least:
            least, split = before + s.sum[i + 1], i + 1
    return float(least * ROUNDING_UP), split
