"""A pair of convex pieces stays apart along one direction: bounds that follow the joints instead of adding them up.

The direction n is fixed in the frame of a link m on the way between the pieces (`way_steps`). Let t be one end of an
interval, s any time in it and x in [0, 1] its share. As seen from m a point p of a piece moves by the steps between;
from m outwards, with the velocities at t
    v_j(p) = w_j x (p - o_j)  for a step that turns about w_j through o_j,   u_j  for one that moves along u_j,
taken backwards for the piece on the other side of the joint. Step j has moved by x D_j + e_j, D_j its change over the
interval, e_j within [lo_j, hi_j]. To first order n . p has changed by sum (x D_j + e_j) n . v_j(p), which is linear in
x, and least at a vertex and at x = 0 or x = 1. What is of second order is at most
    Q = sum_j R_j TV_j (m_j TV_j / 2 [j turns] + sum over k that turn, nearer m than j, of m_k TV_k),
    m_k = min(1, |n x w_k| + sum over l that turn, nearer m than k, of TV_l),
since d^2p / dq_j dq_k = w_k x v_j for k nearer m than j; R_j is the lever arm, TV_j the travel. With g the least of
this over B's vertices less the most over A's, at both x, the pieces are at least g - Q apart along n throughout.

Such a bound stands alone: it is no distance at one end less a way, and must not be added to that of the other end.

A free joint follows one stretch between two key frames; what it moves in others is taken off as it is.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from replay.collision.support import Sets
from replay.collision.way_steps import ALONG, BALL, Chains, Scratch
from replay.kinematics.timeline import FREE, PRISMATIC, Timeline, half_turn, segment
from replay.kinematics.travel import CHANGE, HIGHEST, LOWEST, joint_travel
from replay.numerics.arrays import Floats
from replay.numerics.jit import leaf_kernel, record_like


class Lines(NamedTuple):
    """The E steps of a way as lines that the bodies follow, in an interval and at both its ends."""

    change: Floats  # (E,) D
    low: Floats  # (E,) least of e
    high: Floats  # (E,) largest of e
    other: Floats  # (E,) travel of a free joint's other stretches
    axis: Floats  # (E, 3) in the link's frame, for a free joint's translation in the joint's
    origin: Floats  # (2, E, 3) o at either end, in the common ancestor [m]
    direction: Floats  # (2, E, 3) w or u at either end, in the common ancestor
    pose: Floats  # (2, 2, 4, 4) of the links of A and of B at either end, in the common ancestor
    normal: Floats  # (3,) n
    gradient: Floats  # (E, 3) of n . v_j, in the piece's frame
    offset: Floats  # (E,) n . v_j at the origin of that frame
    sum: Floats  # (2, 3) of n + x sum D_j n . v_j at x = 0 and 1, in the piece's frame


def lines(links: int) -> Lines:
    """Return scratch for ways of up to so many links a side."""
    steps = 4 * links + 2
    return Lines(
        np.empty(steps),
        np.empty(steps),
        np.empty(steps),
        np.empty(steps),
        np.empty((steps, 3)),
        np.empty((2, steps, 3)),
        np.empty((2, steps, 3)),
        np.empty((2, 2, 4, 4)),
        np.empty(3),
        np.empty((steps, 3)),
        np.empty(steps),
        np.empty((2, 3)),
    )


LINES_TYPE = record_like(lines(1))


@leaf_kernel
def measure_changes(line: Timeline, n: int, t0: float, t1: float, s: Scratch, d: Lines) -> None:
    """Write change, deviations, axis and other stretches of each of n steps over [t0, t1] [s]."""
    for i in range(n):
        link = s.link[i]
        d.other[i] = 0.0
        if line.kind[link] == FREE:
            _free_change(line, i, t0, t1, s, d)
            continue
        joint_travel(line, line.joint[link], t0, t1, s.variation, s.found)
        d.change[i], d.low[i], d.high[i] = s.found[CHANGE], s.found[LOWEST], s.found[HIGHEST]
        for k in range(3):
            d.axis[i, k] = line.axis[link, k]


@leaf_kernel
def _free_change(line: Timeline, i: int, t0: float, t1: float, s: Scratch, d: Lines) -> None:
    """Write the lines of a free joint: the stretch that takes most of the interval, the rest as `other`."""
    free = line.joint[s.link[i]]
    d.change[i], d.low[i], d.high[i], d.other[i] = 0.0, 0.0, 0.0, s.travel[i]
    d.axis[i, 0], d.axis[i, 1], d.axis[i, 2] = 0.0, 0.0, 1.0
    begin, end = line.key_first[free], line.key_first[free + 1]
    if end - begin < 2:
        return
    first, last = segment(line, free, t0)[0], segment(line, free, t1)[0]
    best, longest = -1, 0.0
    for k in range(first, min(last, end - 2) + 1):
        length = min(t1, line.key_time[k + 1]) - max(t0, line.key_time[k])
        if length > longest:
            best, longest = k, length
    if best < 0:
        return
    span = line.key_time[best + 1] - line.key_time[best]
    low, high = max(t0, line.key_time[best]), min(t1, line.key_time[best + 1])
    share = (high - low) / span
    if s.kind[i] == BALL:
        angle, sign = half_turn(line, best, best + 1)
        p, q = line.key_quat[best], line.key_quat[best + 1]
        # the vector part of p^-1 q, which is the axis in the link's frame
        x = p[3] * q[0] - q[3] * p[0] - (p[1] * q[2] - p[2] * q[1])
        y = p[3] * q[1] - q[3] * p[1] - (p[2] * q[0] - p[0] * q[2])
        z = p[3] * q[2] - q[3] * p[2] - (p[0] * q[1] - p[1] * q[0])
        length, change = sign * math.sqrt(x * x + y * y + z * z), 2.0 * angle * share
    else:
        x = line.key_xyz[best + 1, 0] - line.key_xyz[best, 0]
        y = line.key_xyz[best + 1, 1] - line.key_xyz[best, 1]
        z = line.key_xyz[best + 1, 2] - line.key_xyz[best, 2]
        length = math.sqrt(x * x + y * y + z * z)
        change = length * share
    if not abs(length) > 1e-12:  # no axis: all of it counts as what it moves
        return
    d.axis[i, 0], d.axis[i, 1], d.axis[i, 2] = x / length, y / length, z / length
    d.change[i], d.other[i] = change, max(s.travel[i] - change, 0.0)
    d.low[i], d.high[i] = -change * (low - t0) / (t1 - t0), change * (t1 - high) / (t1 - t0)


@leaf_kernel
def write_lines(line: Timeline, chains: Chains, way: int, end: int, n: int, s: Scratch, d: Lines) -> None:
    """Write origins, directions and poses at one end, 0 or 1, of an interval whose way is placed in `s`."""
    for side in range(2):
        pose = s.frames[side, chains.first[2 * way + side + 1] - chains.first[2 * way + side]]
        for i in range(4):
            for j in range(4):
                d.pose[end, side, i, j] = pose[i, j]
    for i in range(n):
        link, axis = s.link[i], d.axis[i]
        x, y, z = axis[0], axis[1], axis[2]
        pose = s.frames[s.side[i], s.row[i]]
        if s.kind[i] == ALONG and line.kind[link] != PRISMATIC:
            place = line.place[link]
            x, y, z = (
                place[0, 0] * x + place[0, 1] * y + place[0, 2] * z,
                place[1, 0] * x + place[1, 1] * y + place[1, 2] * z,
                place[2, 0] * x + place[2, 1] * y + place[2, 2] * z,
            )
            pose = s.frames[s.side[i], s.row[i] - 1]
        for k in range(3):
            d.direction[end, i, k] = pose[k, 0] * x + pose[k, 1] * y + pose[k, 2] * z
            d.origin[end, i, k] = s.frames[s.side[i], s.row[i], k, 3]


@leaf_kernel
def apart_along(
    sets: Sets, rows: tuple[int, int], end: int, split: int, n: int, slack: float, s: Scratch, d: Lines
) -> float:
    """Return a lower bound on how far two convex sets are apart along `d.normal` throughout an interval [m].

    Args:
        sets: of the scene.
        rows: of A's and of B's.
        end: at which the first order is taken, 0 or 1.
        split: how many steps lie between A and the link m.
        n: number of steps, whose travel, arms and lines are written.
        slack: rounding of what is added up [m].
    """
    highest = _reach(sets, rows[0], 0, end, split, n, s, d)
    lowest = _reach(sets, rows[1], 1, end, split, n, s, d)
    second = _second_order(0, end, split, n, s, d) + _second_order(1, end, split, n, s, d)
    return min(lowest[0] - highest[0], lowest[1] - highest[1]) - second * (1.0 + 2.0**-40) - slack


@leaf_kernel
def _reach(sets: Sets, row: int, body: int, end: int, split: int, n: int, s: Scratch, d: Lines) -> tuple[float, float]:
    """Return the most (body 0) or the least (body 1) that a set reaches along n to first order, at x = 0 and x = 1."""
    pose, normal = d.pose[end, body], d.normal
    begin, stop = (0, split) if body == 0 else (split, n)
    base = normal[0] * pose[0, 3] + normal[1] * pose[1, 3] + normal[2] * pose[2, 3]
    ahead = base
    for k in range(3):
        d.sum[0, k] = normal[0] * pose[0, k] + normal[1] * pose[1, k] + normal[2] * pose[2, k]
        d.sum[1, k] = d.sum[0, k]
    for i in range(begin, stop):
        # backwards where the body is not on the joint's own side, and where time is
        sign = 1.0 if s.side[i] == body else -1.0
        w, change = d.direction[end, i], d.change[i] if end == 0 else -d.change[i]
        if s.kind[i] == ALONG:
            d.offset[i] = sign * (normal[0] * w[0] + normal[1] * w[1] + normal[2] * w[2])
            d.gradient[i, 0], d.gradient[i, 1], d.gradient[i, 2] = 0.0, 0.0, 0.0
        else:
            x = sign * (normal[1] * w[2] - normal[2] * w[1])
            y = sign * (normal[2] * w[0] - normal[0] * w[2])
            z = sign * (normal[0] * w[1] - normal[1] * w[0])
            o = d.origin[end, i]
            d.offset[i] = x * (pose[0, 3] - o[0]) + y * (pose[1, 3] - o[1]) + z * (pose[2, 3] - o[2])
            for k in range(3):
                d.gradient[i, k] = x * pose[0, k] + y * pose[1, k] + z * pose[2, k]
        ahead += change * d.offset[i]
        for k in range(3):
            d.sum[1, k] += change * d.gradient[i, k]
    best0, best1 = np.inf, np.inf
    turn = 1.0 if body == 1 else -1.0  # the most is the least of the opposite
    for v in range(sets.first[row], sets.first[row + 1]):
        x, y, z = sets.flat[3 * v], sets.flat[3 * v + 1], sets.flat[3 * v + 2]
        strays = 0.0
        for i in range(begin, stop):
            if d.high[i] > d.low[i]:
                g = d.gradient[i]
                rate = turn * (d.offset[i] + g[0] * x + g[1] * y + g[2] * z)
                strays += min(d.low[i] * rate, d.high[i] * rate)
        best0 = min(best0, turn * (base + d.sum[0, 0] * x + d.sum[0, 1] * y + d.sum[0, 2] * z) + strays)
        best1 = min(best1, turn * (ahead + d.sum[1, 0] * x + d.sum[1, 1] * y + d.sum[1, 2] * z) + strays)
    return turn * best0, turn * best1


@leaf_kernel
def _second_order(body: int, end: int, split: int, n: int, s: Scratch, d: Lines) -> float:
    """Return Q of one body [m], and what a free joint moves it besides its line."""
    total, turned, crossed = 0.0, 0.0, 0.0
    count = split if body == 0 else n - split
    for step in range(count):  # from m outwards
        i = split - 1 - step if body == 0 else split + step
        travel = s.travel[i]
        if s.kind[i] == ALONG:
            total += travel * crossed + d.other[i]
            continue
        w, normal = d.direction[end, i], d.normal
        x = normal[1] * w[2] - normal[2] * w[1]
        y = normal[2] * w[0] - normal[0] * w[2]
        z = normal[0] * w[1] - normal[1] * w[0]
        share = min(1.0, math.sqrt(x * x + y * y + z * z) + turned)
        arm = s.arm[body, i]
        total += arm * (travel * (0.5 * share * travel + crossed) + d.other[i])
        crossed += share * travel
        turned += travel
    return total
