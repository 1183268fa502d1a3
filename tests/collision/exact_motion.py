"""Poses of bodies over time and how far apart they are, written apart from the package, in doubles or in 50 digits.

A time is an array (n,) of doubles, or of mpmath numbers (dtype object): then everything that follows from it is one.
"""

from dataclasses import dataclass

import mpmath
import numpy as np

DIGITS = 50


def lift(values, like):
    """Numbers as exact ones where `like` has such."""
    values = np.asarray(values, dtype=np.float64)
    return values if like.dtype != object else np.array([mpmath.mpf(x) for x in values.flat]).reshape(values.shape)


def _each(double, exact, x):
    return double(x) if x.dtype != object else np.frompyfunc(exact, 1, 1)(x)


def _length(v):
    return _each(np.sqrt, mpmath.sqrt, (v * v).sum(axis=-1))


def _piece(times, t):
    """Each time's piece, and how far it is from its begin, held at the ends."""
    held = np.clip(t.astype(np.float64), times[0], times[-1])
    k = np.clip(np.searchsorted(times, held, side="right") - 1, 0, len(times) - 2)
    exact = lift(times, t)
    past = np.where(t < times[0], exact[0], np.where(t > times[-1], exact[-1], t))
    return k, past - exact[k], exact[k + 1] - exact[k]


@dataclass(frozen=True)
class Path:
    """Positions at m >= 2 times; straight lines between them, cubics where there are velocities."""

    times: np.ndarray
    positions: np.ndarray
    velocities: np.ndarray | None = None

    def at(self, t):
        k, u, h = _piece(self.times, t)
        q = lift(self.positions, t)
        change = (q[k + 1] - q[k]) / h
        if self.velocities is None:
            return q[k] + u * change
        v = lift(self.velocities, t)
        square, cube = (3 * change - 2 * v[k] - v[k + 1]) / h, (v[k] + v[k + 1] - 2 * change) / h**2
        return q[k] + u * (v[k] + u * (square + u * cube))


@dataclass(frozen=True)
class Keys:
    """Key frames of a free joint: times, positions (m, 3) and quaternions xyzw (m, 4), the short way between them."""

    times: np.ndarray
    xyz: np.ndarray
    quat: np.ndarray

    def at(self, t):
        k, u, h = _piece(self.times, t)
        share = (u / h)[:, None]
        xyz, quat = lift(self.xyz, t), lift(self.quat, t)
        quat = quat / _length(quat)[:, None]
        p, q = quat[k], quat[k + 1]
        dot = (p * q).sum(axis=1)[:, None]
        p = np.where(dot < 0, -p, p)
        angle = _each(np.arccos, mpmath.acos, abs(dot))
        sine = _each(np.sin, mpmath.sin, angle)
        x, y, z, w = ((_sin((1 - share) * angle) * p + _sin(share * angle) * q) / sine).T
        turn = [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
        return np.moveaxis(np.array(turn), 2, 0), xyz[k] + share * (xyz[k + 1] - xyz[k])


def _sin(x):
    return _each(np.sin, mpmath.sin, x)


@dataclass(frozen=True)
class Step:
    """A joint: where it is in its parent, and its motion.

    Attributes:
        place: (4, 4).
        kind: "fixed", "revolute", "prismatic" or "free".
        axis: (3,).
        path: a `Path`, `Keys` of a free joint, or None of a fixed one.
        leader: the step it follows by (multiplier, offset) = `ratio`, or None.
    """

    place: np.ndarray
    kind: str = "fixed"
    axis: tuple = (0.0, 0.0, 1.0)
    path: Path | Keys | None = None
    leader: "Step | None" = None
    ratio: tuple = (1.0, 0.0)

    def position(self, t):
        if self.leader is None:
            return self.path.at(t)
        return lift([self.ratio[0]], t) * self.leader.position(t) + lift([self.ratio[1]], t)

    def motion(self, t):
        """Rotation (n, 3, 3) and translation (n, 3)."""
        n, axis = len(t), lift(self.axis, t)
        still = lift(np.broadcast_to(np.identity(3), (n, 3, 3)), t), lift(np.zeros((n, 3)), t)
        if self.kind == "fixed":
            return still
        if self.kind == "free":
            return self.path.at(t)
        q = self.position(t)
        if self.kind == "prismatic":
            return still[0], q[:, None] * axis
        x, y, z = axis
        zero = x * 0
        cross = np.array([[zero, -z, y], [z, zero, -x], [-y, x, zero]])
        s, c = _each(np.sin, mpmath.sin, q)[:, None, None], _each(np.cos, mpmath.cos, q)[:, None, None]
        return c * np.identity(3) + s * cross + (1 - c) * np.outer(axis, axis), still[1]


def pose(steps, t):
    """Rotation (n, 3, 3) and translation (n, 3) of the last of some steps in the world."""
    turn = lift(np.broadcast_to(np.identity(3), (len(t), 3, 3)), t)
    origin = lift(np.zeros((len(t), 3)), t)
    for step in steps:
        for r, p in ((lift(step.place[None, :3, :3], t), lift(step.place[None, :3, 3], t)), step.motion(t)):
            origin = origin + (turn @ p[..., None])[..., 0]
            turn = turn @ r
    return turn, origin


@dataclass(frozen=True)
class Convex:
    """A convex body: corners (V, 3), directions (E, 3) of its edges, and pairs of these that span its faces."""

    corners: np.ndarray
    edges: np.ndarray
    faces: tuple


def gap(a, b, t):
    """How far apart two bodies (steps, convex) are along the best of the axes that can part them, negative where none
    does (n,); and of the last time what decides it: two directions (body, edge), corners of both, and the sign."""
    turned, corners = [], []
    for steps, convex in (a, b):
        turn, origin = pose(steps, t)
        turned.append(convex.edges @ np.swapaxes(turn, 1, 2))
        corners.append(convex.corners @ np.swapaxes(turn, 1, 2) + origin[:, None])
    pairs = [((side, i), (side, j)) for side in (0, 1) for i, j in (a, b)[side][1].faces]
    pairs += [((0, i), (1, j)) for i in range(len(a[1].edges)) for j in range(len(b[1].edges))]
    first = np.stack([turned[side][:, i] for (side, i), _ in pairs], axis=1)
    second = np.stack([turned[side][:, j] for _, (side, j) in pairs], axis=1)
    axes = np.cross(first, second)
    lengths = np.sqrt((axes**2).sum(axis=2, keepdims=True))
    axes = np.where(lengths > 1e-9, axes / np.maximum(lengths, 1e-300), 0.0)
    on_a, on_b = (axes @ np.swapaxes(points, 1, 2) for points in corners)
    ahead, behind = on_b.min(axis=2) - on_a.max(axis=2), on_a.min(axis=2) - on_b.max(axis=2)
    apart = np.where(lengths[..., 0] > 1e-9, np.maximum(ahead, behind), -np.inf)
    k = int(apart[-1].argmax())
    if ahead[-1, k] >= behind[-1, k]:
        feature = pairs[k], int(on_a[-1, k].argmax()), int(on_b[-1, k].argmin()), 1
    else:
        feature = pairs[k], int(on_a[-1, k].argmin()), int(on_b[-1, k].argmax()), -1
    return apart.max(axis=1), feature


def gap_along(a, b, feature, t):
    """The gap along one feature, at one time, with the digits of that time."""
    directions, corner_a, corner_b, sign = feature
    t = np.array([t])
    poses = [pose(steps, t) for steps, _ in (a, b)]
    u, v = ((poses[side][0] @ lift((a, b)[side][1].edges[i], t))[0] for side, i in directions)
    axis = np.array([u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]])
    points = [
        (turn @ lift(convex.corners[k], t))[0] + origin[0]
        for (turn, origin), (_, convex), k in zip(poses, (a, b), (corner_a, corner_b), strict=True)
    ]
    return sign * (axis * (points[1] - points[0])).sum() / _length(axis[None])[0]


def root(a, b, low, high):
    """The moment between two at which the gap of two bodies changes its sign, in 50 digits, and the slope [m/s]."""
    with mpmath.workdps(DIGITS):
        before = gap(a, b, np.array([low]))[0][0]
        for _ in range(20):  # until the two are neighbours
            inner = np.unique(np.linspace(low, high, 34))
            k = 1 + int(((gap(a, b, inner)[0][1:] > 0.0) != (before > 0.0)).argmax())
            low, high = inner[k - 1], inner[k]
        feature = gap(a, b, np.array([high if before > 0.0 else low]))[1]
        width = mpmath.mpf(max(high - low, 2e-16 * abs(high)))
        x, y = mpmath.mpf(low), mpmath.mpf(high) + width
        f, g = gap_along(a, b, feature, x), gap_along(a, b, feature, y)
        slope = (g - f) / (y - x)
        for _ in range(20):
            if f == g or abs(y - x) <= mpmath.mpf(10) ** -25 * width:
                break
            x, y, f = y, y - g * (y - x) / (g - f), g
            g = gap_along(a, b, feature, y)
        assert abs(y - high) <= 1e6 * width
        return y, float(slope)
