"""Rigid transforms in batch: 4x4 matrices, roll-pitch-yaw and quaternions, in plain IEEE arithmetic.

Nothing here calls BLAS or NumPy's vectorised sine and cosine: their last digit depends on the processor, and these
numbers are on the way to a reading. `T_a_b` maps coordinates of b into a; quaternions are xyzw with w >= 0.
"""

from __future__ import annotations

import math

import numpy as np

from replay.numerics.arrays import Floats


def identity(*shape: int) -> Floats:
    """Return identity transforms of shape (*shape, 4, 4)."""
    result = np.zeros((*shape, 4, 4))
    for axis in range(4):
        result[..., axis, axis] = 1.0
    return result


def compose(T_a_b: Floats, T_b_c: Floats) -> Floats:
    """Return T_a_c = T_a_b T_b_c for rigid transforms of shape (..., 4, 4), broadcast against each other."""
    result = np.empty(np.broadcast_shapes(T_a_b.shape, T_b_c.shape))
    rows = result[..., :3, :]
    np.multiply(T_a_b[..., :3, 0, None], T_b_c[..., None, 0, :], out=rows)
    rows += T_a_b[..., :3, 1, None] * T_b_c[..., None, 1, :]
    rows += T_a_b[..., :3, 2, None] * T_b_c[..., None, 2, :]
    rows[..., 3] += T_a_b[..., :3, 3]
    result[..., 3, :] = (0.0, 0.0, 0.0, 1.0)
    return result


def invert(T_a_b: Floats) -> Floats:
    """Return T_b_a for rigid transforms of shape (..., 4, 4): rotation transposed, origin taken back."""
    result = np.zeros(T_a_b.shape)
    result[..., :3, :3] = np.swapaxes(T_a_b[..., :3, :3], -1, -2)
    for row in range(3):
        value = T_a_b[..., 0, row] * T_a_b[..., 0, 3]
        value = value + T_a_b[..., 1, row] * T_a_b[..., 1, 3]
        value = value + T_a_b[..., 2, row] * T_a_b[..., 2, 3]
        result[..., row, 3] = -value
    result[..., 3, 3] = 1.0
    return result


def apply(T_a_b: Floats, points: Floats) -> Floats:
    """Return points (..., 3) given in b, in a; leading shapes are broadcast."""
    x, y, z = points[..., 0], points[..., 1], points[..., 2]
    rows = [T_a_b[..., r, 0] * x + T_a_b[..., r, 1] * y + T_a_b[..., r, 2] * z + T_a_b[..., r, 3] for r in range(3)]
    return np.stack(rows, axis=-1)


def sine(angle: Floats) -> Floats:
    """Return the sine [-] of angles [rad], element by element with the C library's function."""
    return np.array([math.sin(value) for value in angle.ravel().tolist()]).reshape(angle.shape)


def cosine(angle: Floats) -> Floats:
    """Return the cosine [-] of angles [rad], element by element with the C library's function."""
    return np.array([math.cos(value) for value in angle.ravel().tolist()]).reshape(angle.shape)


def from_translation(xyz: Floats) -> Floats:
    """Return transforms (..., 4, 4) that move by xyz (..., 3) [m]."""
    xyz = np.asarray(xyz, dtype=np.float64)
    result = identity(*xyz.shape[:-1])
    result[..., :3, 3] = xyz
    return result


def from_axis_angle(axis: Floats, angle: Floats) -> Floats:
    """Return transforms (..., 4, 4) that turn by angle (...) [rad] about the unit axis (3,) (Rodrigues)."""
    x, y, z = (float(value) for value in axis)
    s, c = sine(angle), cosine(angle)
    half = sine(0.5 * angle)
    k = 2.0 * half * half  # 1 - cos without cancellation
    result = identity(*angle.shape)
    result[..., 0, 0], result[..., 0, 1], result[..., 0, 2] = c + k * x * x, k * x * y - s * z, k * x * z + s * y
    result[..., 1, 0], result[..., 1, 1], result[..., 1, 2] = k * x * y + s * z, c + k * y * y, k * y * z - s * x
    result[..., 2, 0], result[..., 2, 1], result[..., 2, 2] = k * x * z - s * y, k * y * z + s * x, c + k * z * z
    return result


def from_rpy(rpy: Floats) -> Floats:
    """Return transforms (..., 4, 4) for roll, pitch, yaw (..., 3) [rad]: R = Rz(yaw) Ry(pitch) Rx(roll), as in URDF."""
    rpy = np.asarray(rpy, dtype=np.float64)
    roll = from_axis_angle(np.array([1.0, 0.0, 0.0]), rpy[..., 0])
    pitch = from_axis_angle(np.array([0.0, 1.0, 0.0]), rpy[..., 1])
    yaw = from_axis_angle(np.array([0.0, 0.0, 1.0]), rpy[..., 2])
    return compose(yaw, compose(pitch, roll))


def from_quaternion(quat_xyzw: Floats) -> Floats:
    """Return transforms (..., 4, 4) for quaternions (..., 4) in xyzw order; they are normalised first."""
    q = np.asarray(quat_xyzw, dtype=np.float64)
    q = q / np.sqrt(q[..., 0] ** 2 + q[..., 1] ** 2 + q[..., 2] ** 2 + q[..., 3] ** 2)[..., None]
    x, y, z, w = q[..., 0], q[..., 1], q[..., 2], q[..., 3]
    result = identity(*q.shape[:-1])
    result[..., 0, 0], result[..., 1, 1] = 1.0 - 2.0 * (y * y + z * z), 1.0 - 2.0 * (x * x + z * z)
    result[..., 2, 2] = 1.0 - 2.0 * (x * x + y * y)
    result[..., 0, 1], result[..., 1, 0] = 2.0 * (x * y - w * z), 2.0 * (x * y + w * z)
    result[..., 0, 2], result[..., 2, 0] = 2.0 * (x * z + w * y), 2.0 * (x * z - w * y)
    result[..., 1, 2], result[..., 2, 1] = 2.0 * (y * z - w * x), 2.0 * (y * z + w * x)
    return result


def to_quaternion(T_a_b: Floats) -> Floats:
    """Return unit quaternions (..., 4), xyzw, w >= 0, of rigid transforms (..., 4, 4).

    The largest of the four squared components is taken from the diagonal and the others from it (Shepperd 1978), so
    that no component comes from a difference of nearly equal numbers.
    """
    R = T_a_b[..., :3, :3]
    xx, yy, zz = R[..., 0, 0], R[..., 1, 1], R[..., 2, 2]
    squares = np.stack([1.0 + xx - yy - zz, 1.0 - xx + yy - zz, 1.0 - xx - yy + zz, 1.0 + xx + yy + zz], axis=-1)
    xy, xz, yz = R[..., 0, 1] + R[..., 1, 0], R[..., 0, 2] + R[..., 2, 0], R[..., 1, 2] + R[..., 2, 1]
    xw, yw, zw = R[..., 2, 1] - R[..., 1, 2], R[..., 0, 2] - R[..., 2, 0], R[..., 1, 0] - R[..., 0, 1]
    rows = np.stack(
        [
            np.stack([squares[..., 0], xy, xz, xw], axis=-1),
            np.stack([xy, squares[..., 1], yz, yw], axis=-1),
            np.stack([xz, yz, squares[..., 2], zw], axis=-1),
            np.stack([xw, yw, zw, squares[..., 3]], axis=-1),
        ],
        axis=-2,
    )
    largest = np.argmax(squares, axis=-1)
    q = np.take_along_axis(rows, largest[..., None, None], axis=-2)[..., 0, :]
    q = q / np.sqrt(q[..., 0] ** 2 + q[..., 1] ** 2 + q[..., 2] ** 2 + q[..., 3] ** 2)[..., None]
    q = np.where(q[..., 3:4] < 0.0, -q, q)
    return q + 0.0  # -0.0 becomes 0.0


def slerp(start: Floats, end: Floats, fraction: Floats) -> Floats:
    """Return unit quaternions (..., 4) xyzw on the shortest arc from start to end at fraction (...) in [0, 1]."""
    dot = np.sum(start * end, axis=-1)
    end = np.where(dot[..., None] < 0.0, -end, end)
    chord = end - start
    total = end + start
    angle = 2.0 * np.array(
        [
            math.atan2(math.sqrt(a), math.sqrt(b))
            for a, b in zip(np.sum(chord**2, -1).ravel().tolist(), np.sum(total**2, -1).ravel().tolist(), strict=True)
        ]
    ).reshape(dot.shape)
    whole = sine(angle)
    straight = whole < 1e-8  # the arc is its chord to 1e-17, and the quotient would be 0/0
    safe = np.where(straight, 1.0, whole)
    a = np.where(straight, 1.0 - fraction, sine((1.0 - fraction) * angle) / safe)
    b = np.where(straight, fraction, sine(fraction * angle) / safe)
    q: Floats = a[..., None] * start + b[..., None] * end
    unit: Floats = q / np.sqrt(np.sum(q**2, axis=-1))[..., None]
    return unit
