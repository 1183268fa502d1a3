"""How far each joint moves within an interval of time: rigorous bounds, rounded up.

The travel of a joint is its total variation: what it moves, added up without sign. Equal positions at both ends do not
mean rest. A piece of a motion is a polynomial; with b_0 .. b_5 its Bernstein coefficients over an interval of local
time its total variation is at most sum |b_k+1 - b_k|, and equal to that where the differences have one sign. Where they
do not, the interval is halved until they do or nothing is left to gain. Jumps between pieces (roundings) count as well.

Besides, for bounds that follow a joint along its way: q(s) - q(t0) = x D + e with D = q(t1) - q(t0), x = (s - t0) /
(t1 - t0), and e between two bounds that are found by the same coefficients.

The rotation of a free joint is about one axis between two key frames, by twice the angle between their quaternions.
"""

from __future__ import annotations

import numpy as np
from numba import float64

from replay.kinematics.timeline import (
    FREE,
    TIMELINE_TYPE,
    Timeline,
    half_turn,
    last_at_or_before,
    polynomial,
    script_time,
    scripted,
    segment,
)
from replay.numerics.arrays import Floats
from replay.numerics.constants import EPSILON
from replay.numerics.jit import entry, kernel, leaf_kernel

HALVINGS = 40
"""Cap: an extremum is then known to 1e-12 of the interval, and what is still counted twice is its square."""

ROUNDING = 32.0 * EPSILON
"""Of the largest sum of |terms| of a polynomial: far above the rounding of its value and of its coefficients."""

TURN_ROUNDING = 32.0 * EPSILON
"""Error of the angle [rad] between two poses of a free joint."""

TRAVEL, CHANGE, LOWEST, HIGHEST = range(4)
"""What is written of a scalar joint: total variation, D, and the bounds of e [rad or m]."""

SHIFT, TURN = range(2)
"""What is written of a free joint: translation [m] and rotation [rad], total variations."""


@leaf_kernel
def joint_travel(
    line: Timeline, joint: int, t0: float, t1: float, work: Floats, found: Floats, follows: bool = True
) -> None:
    """Write TRAVEL .. HIGHEST of a scalar joint over [t0, t1] [s]; `work` is (HALVINGS + 8, 8) scratch.

    LOWEST and HIGHEST mean nothing where it is not asked how the joint `follows` its chord.
    """
    s0, s1 = script_time(line, joint, t0), script_time(line, joint, t1)
    first = line.clock_first[joint]
    slowed = first < line.clock_first[joint + 1] and line.clock_start[first] < t1  # later is another interval's affair
    _script_travel(line, joint, s0, s1, slowed, follows, work, found)
    if follows and slowed and s1 > s0:
        _add_warp(line, joint, t0, t1, s0, s1, found)


@leaf_kernel
def _add_warp(line: Timeline, joint: int, t0: float, t1: float, s0: float, s1: float, found: Floats) -> None:
    """Widen LOWEST and HIGHEST, which follow the chord over script time, to those that follow it over time.

    With y = (s - s0) / (s1 - s0) they are bounds of q - q(s0) - y D; to those of x come the bounds of (y - x) D. On a
    piece of the clock s lies between its Bernstein coefficients: its values at the ends, and where its tangents meet.
    """
    begin, end = line.clock_first[joint], line.clock_first[joint + 1]
    low, high = 0.0, 0.0
    for k in range(max(last_at_or_before(line.clock_start, begin, end, t0), begin - 1), end):
        a = t0 if k < begin else max(t0, line.clock_start[k])
        b = t1 if k + 1 == end else min(t1, line.clock_start[k + 1])
        if not a < b:
            continue
        rate = 1.0 if k < begin else line.clock_rate[k] + line.clock_ramp[k] * (a - line.clock_start[k])
        at_a, at_b = script_time(line, joint, a), script_time(line, joint, b)
        for i in range(3):
            s = at_a if i == 0 else at_b if i == 2 else at_a + 0.5 * rate * (b - a)
            apart = (s - s0) / (s1 - s0) - (0.5 * (a + b) - t0 + (0.5 * i - 0.5) * (b - a)) / (t1 - t0)
            low, high = min(low, apart), max(high, apart)
    change = abs(found[CHANGE])
    # of y and x, that of s against the interval it is divided by
    rounding = ROUNDING * (1.0 + (abs(s1) + abs(t1)) / (s1 - s0))
    least, most = (low, high) if found[CHANGE] > 0.0 else (-high, -low)
    found[LOWEST] += change * (least - rounding)
    found[HIGHEST] += change * (most + rounding)


@leaf_kernel
def _script_travel(
    line: Timeline, joint: int, t0: float, t1: float, slowed: bool, follows: bool, work: Floats, found: Floats
) -> None:
    """Write TRAVEL .. HIGHEST over [t0, t1] [s] of script time, the bounds as they follow the chord over it."""
    q0, q1 = scripted(line, joint, t0), scripted(line, joint, t1)
    begin, end = line.piece_first[joint], line.piece_first[joint + 1]
    total, rounding, last = 0.0, 0.0, q0
    low, high = 0.0, 0.0
    speed = (q1 - q0) / (t1 - t0) if t1 > t0 else 0.0
    for k in range(max(last_at_or_before(line.start, begin, end, t0), begin), end):
        c, s = line.coefficients[k], line.start[k]
        if s > t1:
            break
        a, b = max(t0, s), min(t1, line.end[k])
        if not a < b:
            continue
        value = polynomial(c, a - s)
        # what holds before the piece, and the jump onto it
        total += abs(value - last)
        chord = q0 + speed * (a - t0)
        low, high = min(low, last - chord, value - chord), max(high, last - chord, value - chord)
        last = polynomial(c, b - s)
        if c[1] == 0.0 and c[2] == 0.0 and c[3] == 0.0 and c[4] == 0.0 and c[5] == 0.0:
            chord = q0 + speed * (b - t0)
            low, high = min(low, last - chord), max(high, last - chord)
            continue
        size, power = 0.0, 1.0
        for i in range(6):
            size += abs(c[i]) * power
            if slowed and i < 5:  # script time is rounded as well
                size += (i + 1) * abs(c[i + 1]) * power * abs(t1)
            power *= b - s
        rounding = max(rounding, ROUNDING * (size + abs(q0) + abs(q1)))
        total += _variation(c, a - s, b - s, size, work)
        if not follows:
            continue
        _bernstein(c, a - s, b - a, work[0])
        for i in range(6):
            deviation = work[0, i] - (q0 + speed * (a - t0 + (b - a) * (i / 5.0)))
            low, high = min(low, deviation), max(high, deviation)
    chord = q1 if t1 > t0 else q0
    low, high = min(low, last - chord), max(high, last - chord)
    total += abs(q1 - last)
    found[TRAVEL] = total * (1.0 + ROUNDING) + rounding
    found[CHANGE] = q1 - q0
    found[LOWEST], found[HIGHEST] = low - rounding, high + rounding


@leaf_kernel
def _bernstein(c: Floats, a: float, h: float, b: Floats) -> None:
    """Write the Bernstein coefficients (6,) of a polynomial over [a, a + h]."""
    # about a, in units of h
    for i in range(6):
        b[i] = c[i]
    for i in range(5):
        for k in range(4, i - 1, -1):
            b[k] += a * b[k + 1]
    power = 1.0
    for i in range(6):
        b[i] *= power
        power *= h
    # b_k = sum_i C(k, i) / C(5, i) d_i, by adding up differences
    b[1] /= 5.0
    b[2] /= 10.0
    b[3] /= 10.0
    b[4] /= 5.0
    for i in range(5):
        for k in range(5, i, -1):
            b[k] += b[k - 1]


@leaf_kernel
def _variation(c: Floats, a: float, b: float, size: float, work: Floats) -> float:
    """Return a bound from above of the total variation of a polynomial over [a, b]; `size` is that of its terms."""
    total, waiting = 0.0, 1
    work[1, 6], work[1, 7] = a, b
    while waiting > 0:
        row = work[waiting]
        low, high = row[6], row[7]
        _bernstein(c, low, high - low, row)
        path = 0.0
        for k in range(5):
            path += abs(row[k + 1] - row[k])
        gained = path - abs(row[5] - row[0])
        if gained <= 4.0 * EPSILON * size or waiting > HALVINGS:
            total += path
            waiting -= 1
            continue
        middle = 0.5 * low + 0.5 * high
        row[6], row[7] = middle, high
        waiting += 1
        work[waiting, 6], work[waiting, 7] = low, middle
    return total


@leaf_kernel
def free_travel(line: Timeline, free: int, t0: float, t1: float, found: Floats) -> int:
    """Write SHIFT and TURN of a free joint over [t0, t1] [s]; return how many stretches between key frames that is."""
    found[SHIFT], found[TURN] = 0.0, 0.0
    begin, end = line.key_first[free], line.key_first[free + 1]
    if end - begin < 2 or t1 <= line.key_time[begin] or t0 >= line.key_time[end - 1] + 1.0:
        return 0
    stretches, shift, turn, size = 0, 0.0, 0.0, 0.0
    first, _, from_fraction = segment(line, free, t0)
    last, _, to_fraction = segment(line, free, t1)
    for k in range(first, min(last, end - 2) + 1):
        a = from_fraction if k == first else 0.0
        b = to_fraction if k == last else 1.0
        square = 0.0
        for i in range(3):
            square += (line.key_xyz[k + 1, i] - line.key_xyz[k, i]) ** 2
            size = max(size, abs(line.key_xyz[k, i]), abs(line.key_xyz[k + 1, i]))
        if b > a:
            stretches += 1
        shift += np.sqrt(square) * (b - a)
        turn += 2.0 * half_turn(line, k, k + 1)[0] * (b - a)
    found[SHIFT] = shift * (1.0 + ROUNDING) + ROUNDING * size
    found[TURN] = turn * (1.0 + ROUNDING) + TURN_ROUNDING
    return stretches


@entry(TIMELINE_TYPE, float64[::1], float64[:, :, ::1])
@kernel
def link_travel(line: Timeline, seconds: Floats, travel: Floats) -> None:
    """Write how far the joint of each link moves in the intervals between times.

    Args:
        line: of L links.
        seconds: (n + 1,) increasing [s].
        travel: (L, n, 2) out: of a scalar joint its total variation [rad or m] and 0, of a free one SHIFT and TURN.
    """
    work, found = np.empty((HALVINGS + 8, 8)), np.empty(4)
    for link in range(len(line.kind)):
        joint = line.joint[link]
        moves = joint >= 0
        if moves and line.kind[link] != FREE:
            moves = line.piece_first[joint] < line.piece_first[joint + 1]
        for f in range(len(seconds) - 1):
            travel[link, f, 0], travel[link, f, 1] = 0.0, 0.0
            if not moves:
                continue
            if line.kind[link] == FREE:
                free_travel(line, joint, seconds[f], seconds[f + 1], travel[link, f])
            else:
                joint_travel(line, joint, seconds[f], seconds[f + 1], work, found, False)
                travel[link, f, 0] = found[TRAVEL]
