"""The search for the smallest box around points, whatever its axes.

The smallest box has two adjacent faces that touch the body along edges (O'Rourke 1985). Axes that the hull suggests are
tried, each with its best rectangle; the best of these boxes, and some turned at random, are then improved by turning
them about their own axes, one exact rectangle at a time. That can end in a groove of this piecewise smooth function
where no turn about an axis of the box helps but one about a slanted axis does (an octahedron's box stays 10 % too
big), so the best boxes are also turned by ever smaller angles about axes of 26 directions.
"""

from __future__ import annotations

import math

import numpy as np
from numba import float64

from replay.geometry.calipers import turn_about
from replay.numerics.arrays import Floats
from replay.numerics.jit import entry, kernel

_GAIN = 1e-9  # a smaller box is smaller by more than this, relative
_MOST_TURNS = 60
_MOST_NUDGES = 200
_FIRST_NUDGE, _LAST_NUDGE = 0.3, 1e-6  # [rad]
_ROUNDING = 1e-13  # of heights over points of extent 1, and of angles
_NUDGED = 3  # best boxes that are nudged


def _nudge_axes() -> Floats:
    """Return the 26 unit directions to the faces, edges and corners of a cube."""
    steps = (-1, 0, 1)
    ways = [(x, y, z) for x in steps for y in steps for z in steps if (x, y, z) != (0, 0, 0)]
    return np.array([[c / math.sqrt(x * x + y * y + z * z) for c in (x, y, z)] for x, y, z in ways])


_NUDGES = _nudge_axes()


@entry(float64[:, ::1], float64[:, ::1])
@kernel
def box_volume(points: Floats, axes: Floats) -> float:
    """Return the volume of the box along axes (3, 3 rows) around points (n, 3)."""
    volume = 1.0
    for i in range(3):
        x, y, z = axes[i, 0], axes[i, 1], axes[i, 2]
        low, high = np.inf, -np.inf
        for k in range(len(points)):
            value = x * points[k, 0] + y * points[k, 1] + z * points[k, 2]
            low, high = min(low, value), max(high, value)
        volume *= high - low
    return volume


def smallest_box(points: Floats, axes: Floats, trials: Floats, starts: Floats, kept: int, floor: float) -> Floats:
    """Return the axes (3, 3 rows) of the smallest box found around points; never a larger one than along `axes`.

    Args:
        points: (n, 3), the hull's vertices, of extent about 1.
        axes: (3, 3) to begin with.
        trials: (t, 3) unit axes; the `kept` smallest of their boxes are improved.
        starts: (s, 3, 3) axes of other boxes to improve.
        kept: at least 1.
        floor: volume of the hull; a box this small cannot be beaten.
    """
    total = 1 + kept + len(starts)
    boxes, volumes = np.empty((total, 3, 3)), np.full(total, np.inf)
    result, trial, scratch = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    result[:] = boxes[0] = axes
    best = box_volume(points, axes)
    volumes[0] = best
    for k in range(len(trials)):
        volume = turn_about(points, trials[k], trial)
        worst = 1 + int(np.argmax(volumes[1 : kept + 1]))
        if volume < volumes[worst]:
            volumes[worst], boxes[worst] = volume, trial
    for k in range(len(starts)):
        boxes[1 + kept + k] = starts[k]
        volumes[1 + kept + k] = box_volume(points, starts[k])
    for k in range(total):
        if volumes[k] < best * (1.0 - _GAIN):
            best, result[:] = volumes[k], boxes[k]
    if best <= floor * (1.0 + 1e-6):
        return result
    for k in range(total):
        if volumes[k] < np.inf:
            volumes[k] = _turn(points, boxes[k], volumes[k], trial)
    for _ in range(_NUDGED):
        least = int(np.argmin(volumes))
        if volumes[least] < np.inf:
            volume = _nudge(points, boxes[least], volumes[least], trial, scratch)
            volume = _turn(points, boxes[least], volume, trial)
            if volume < best * (1.0 - _GAIN):
                best, result[:] = volume, boxes[least]
            volumes[least] = np.inf
    return result


@kernel
def _copy(source: Floats, target: Floats) -> None:
    for i in range(3):
        for j in range(3):
            target[i, j] = source[i, j]


def _turn(points: Floats, axes: Floats, volume: float, trial: Floats) -> float:
    """Turn a box about its own axes in turn, in place, until none of the three makes it smaller; return its volume."""
    failed, i = 0, 0
    for _ in range(_MOST_TURNS):
        turned = turn_about(points, axes[i], trial)
        if turned < volume * (1.0 - _GAIN):
            volume, failed, axes[:] = turned, 0, trial
            i = 1  # the axis just used is now the first
        else:
            failed += 1
            i = (i + 1) % 3
        if failed == 3:
            break
    return volume


@entry(float64[:, ::1], float64[:, ::1], float64, float64[:, ::1], float64[:, ::1])
@kernel
def _nudge(points: Floats, axes: Floats, volume: float, trial: Floats, best: Floats) -> float:
    """Turn a box, in place, by small angles about the 26 directions, the best first; return its volume."""
    angle = _FIRST_NUDGE
    for _ in range(_MOST_NUDGES):
        c, s = math.cos(angle), math.sin(angle)
        least = volume * (1.0 - _GAIN)
        found = False
        outer = _outermost_within(points, axes, angle)
        for k in range(len(_NUDGES)):
            u = _NUDGES[k]
            x = u[0] * axes[0, 0] + u[1] * axes[1, 0] + u[2] * axes[2, 0]
            y = u[0] * axes[0, 1] + u[1] * axes[1, 1] + u[2] * axes[2, 1]
            z = u[0] * axes[0, 2] + u[1] * axes[1, 2] + u[2] * axes[2, 2]
            for i in range(3):  # Rodrigues: c a + s u x a + (1 - c) (u . a) u, and u . a_i = u_i of the box
                ax, ay, az = axes[i, 0], axes[i, 1], axes[i, 2]
                w = (1.0 - c) * u[i]
                trial[i, 0] = c * ax + s * (y * az - z * ay) + w * x
                trial[i, 1] = c * ay + s * (z * ax - x * az) + w * y
                trial[i, 2] = c * az + s * (x * ay - y * ax) + w * z
            turned = box_volume(outer, trial)
            if turned < least:
                least, found = turned, True
                _copy(trial, best)
        if found:
            volume = least
            _copy(best, axes)
            angle = min(1.5 * angle, _FIRST_NUDGE)
        else:
            angle *= 0.5
            if angle < _LAST_NUDGE:
                break
    return volume


@kernel
def _outermost_within(points: Floats, axes: Floats, angle: float) -> Floats:
    """Return the points (k, 3) that may be outermost along any of the axes turned by up to an angle < pi / 2.

    Along an axis turned by phi, a point h below the outermost one and r away from it comes to lie at least
    h cos(phi) - r sin(phi) below.
    """
    slope = math.tan(angle)
    ends = np.zeros((3, 2), np.int64)
    far = np.empty((3, 2))
    for i in range(3):
        x, y, z = axes[i, 0], axes[i, 1], axes[i, 2]
        low, high = np.inf, -np.inf
        for k in range(len(points)):
            along = x * points[k, 0] + y * points[k, 1] + z * points[k, 2]
            if along < low:
                low, ends[i, 0] = along, k
            if along > high:
                high, ends[i, 1] = along, k
        far[i, 0], far[i, 1] = low, high
    result = np.empty((len(points), 3))
    count = 0
    for k in range(len(points)):
        p = points[k]
        kept = False
        for i in range(3):
            along = axes[i, 0] * p[0] + axes[i, 1] * p[1] + axes[i, 2] * p[2]
            for end in range(2):
                height = abs(far[i, end] - along) - _ROUNDING
                q = points[ends[i, end]]
                x, y, z = p[0] - q[0], p[1] - q[1], p[2] - q[2]
                kept = kept or height <= 0.0 or height * height <= slope * slope * (x * x + y * y + z * z)
        if kept:
            result[count, 0], result[count, 1], result[count, 2] = p[0], p[1], p[2]
            count += 1
    return result[:count]
