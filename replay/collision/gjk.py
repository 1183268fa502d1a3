"""Do two convex sets meet, and how far apart are they: the public face of GJK."""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from replay.collision import gjk_exact, gjk_kernel
from replay.collision.support import Sets, make_sets
from replay.errors import InvalidValue
from replay.numerics.arguments import as_floats

Floats = NDArray[np.float64]

RIGID_TOLERANCE = 1e-6
"""Largest accepted |R^T R - I|. The vertices are mapped by the matrix as given, so a pose that is rigid to this
tolerance costs no accuracy; a larger error is a scaled, sheared or mistyped matrix."""

LARGEST_COORDINATE = 1e100
"""Coordinates beyond this [m] are refused: their squares would overflow."""


class Status(enum.Enum):
    """The three answers about a pair of convex sets."""

    SEPARATED = gjk_exact.SEPARATED
    CONTACT = gjk_exact.CONTACT
    UNDECIDED = gjk_exact.UNDECIDED


@dataclass(frozen=True, eq=False)
class Verdict:
    """Whether two convex sets meet, and the proof.

    Attributes:
        status: SEPARATED, CONTACT (touching included) or UNDECIDED.
        direction: (3,) unit vector in world, from a to b, if SEPARATED: along it, every vertex of b is at least
            `gap_lower_bound` beyond every vertex of a. Else None.
        gap_lower_bound: proven lower bound on the distance [m], > 0 if SEPARATED, else 0.
        point: (3,) a point of both sets in world if CONTACT [m], exact to rounding. Else None.
    """

    status: Status
    direction: Floats | None
    gap_lower_bound: float
    point: Floats | None


@dataclass(frozen=True, eq=False)
class Separation:
    """The distance of two convex sets, and the proof.

    Attributes:
        status: SEPARATED, CONTACT (touching included) or UNDECIDED.
        distance: [m]; 0 in CONTACT. It is the distance of the witness points, hence an upper bound in any case.
        lower_bound: proven lower bound on the distance [m]; `distance - lower_bound` bounds the error. 0 in CONTACT.
        point_a: (3,) point of a nearest to b in world [m]; in CONTACT a point of both.
        point_b: (3,) point of b nearest to a in world [m]; in CONTACT a point of both.
        direction: (3,) unit vector in world from a to b, None unless SEPARATED.
    """

    status: Status
    distance: float
    lower_bound: float
    point_a: Floats
    point_b: Floats
    direction: Floats | None


def intersect(
    a: ArrayLike, b: ArrayLike, *, pose_a: ArrayLike | None = None, pose_b: ArrayLike | None = None
) -> Verdict:
    """Return whether the convex hulls of two vertex sets meet; touching is meeting.

    Args:
        a: (n, 3) vertices [m], n >= 1, in any order; duplicate, collinear, coplanar and inner points are allowed.
        b: (m, 3) vertices [m].
        pose_a: (4, 4) rigid transform of a into world; identity if None.
        pose_b: (4, 4) rigid transform of b into world; identity if None.

    Raises:
        InvalidValue: wrong shape, not finite, beyond 1e100 m, or a pose that is not rigid to 1e-6.

    Accuracy:
        Exact for the vertices rounded to doubles about a common origin: gaps down to 2^-90 of the scene's size are
        told from contact (tests/collision/test_gjk.py). Poses and coordinates are rounded at 2^-53 of bodies and
        offset.

    Source: Gilbert, Johnson, Keerthi 1988; see `gjk_kernel`.
    """
    problem = _Problem(a, b, pose_a, pose_b)
    status = problem.solve(cutoff=0.0)
    if status is Status.CONTACT:
        return Verdict(status, None, 0.0, problem.world(0.5 * (problem.point_a + problem.point_b)))
    if status is Status.UNDECIDED:
        return Verdict(status, None, 0.0, None)
    return Verdict(status, problem.direction, problem.lower_bound, None)


def distance(
    a: ArrayLike, b: ArrayLike, *, pose_a: ArrayLike | None = None, pose_b: ArrayLike | None = None
) -> Separation:
    """Return the distance of the convex hulls of two vertex sets, with witness points; 0 where they meet or touch.

    Args and Raises: as `intersect`.

    Accuracy:
        For the vertices rounded to doubles about a common origin: relative 1e-12, plus 2^-70 of the scene's size
        (bodies and their offset), proven by `lower_bound`. That rounding is below 3e-15 of the scene's size
        (tests/collision/test_hard_cases.py). Swapping a and b gives the same bits.

    Source: Gilbert, Johnson, Keerthi 1988; see `gjk_kernel`.
    """
    problem = _Problem(a, b, pose_a, pose_b)
    status = problem.solve(cutoff=math.inf)
    point_a, point_b = problem.world(problem.point_a), problem.world(problem.point_b)
    if status is Status.CONTACT:
        middle = problem.world(0.5 * (problem.point_a + problem.point_b))
        return Separation(status, 0.0, 0.0, middle, middle.copy(), None)
    direction = problem.direction if status is Status.SEPARATED else None
    return Separation(status, problem.upper_bound, problem.lower_bound, point_a, point_b, direction)


class _Problem:
    """Two vertex sets about a common origin, scaled by a power of two to size 1, and what GJK says of them.

    With origin o halfway between the poses' origins, a is mapped to R_a a + h and b to R_b b - h, h = (p_a - p_b)/2:
    the world position cancels before anything is rounded, and swapping the arguments swaps the numbers bit by bit.
    An origin far from the vertices is subtracted only along axes on which that is exact (Sterbenz).
    """

    def __init__(self, a: ArrayLike, b: ArrayLike, pose_a: ArrayLike | None, pose_b: ArrayLike | None) -> None:
        rotation_a, position_a = _pose("pose_a", pose_a)
        rotation_b, position_b = _pose("pose_b", pose_b)
        half = 0.5 * (position_a - position_b)
        self._origin = position_a - half
        points_a = _mapped(rotation_a, _vertices("a", a), half)
        points_b = _mapped(rotation_b, _vertices("b", b), -half)
        shift = _exact_shift(points_a, points_b)
        points_a, points_b = points_a - shift, points_b - shift
        self._origin = self._origin + shift
        largest = max(float(np.abs(points_a).max()), float(np.abs(points_b).max()))
        self._scale = 2.0 ** math.frexp(largest)[1] if largest > 0.0 else 1.0
        self._a = _sets(points_a / self._scale)
        self._b = _sets(points_b / self._scale)
        self._work = gjk_kernel.workspace()

    def solve(self, *, cutoff: float) -> Status:
        size = 2.0 * math.sqrt(3.0)  # every coordinate is below 1
        identity, zero = np.identity(3), np.zeros(3)
        code = gjk_kernel.query(self._a, 0, self._b, 0, identity, zero, size, cutoff, 0.0, self._work)
        return Status(code)

    def world(self, point: Floats) -> Floats:
        return point * self._scale + self._origin

    def _vector(self, begin: int) -> Floats:
        return self._work.result[begin : begin + 3].copy()

    @property
    def upper_bound(self) -> float:
        return float(self._work.result[gjk_exact.DISTANCE]) * self._scale

    @property
    def lower_bound(self) -> float:
        return float(self._work.result[gjk_exact.LOWER]) * self._scale

    @property
    def direction(self) -> Floats:
        vector = self._vector(gjk_exact.DIRECTION)
        return vector / math.sqrt(float(np.sum(vector * vector)))

    @property
    def point_a(self) -> Floats:
        return self._vector(gjk_exact.POINT_A)

    @property
    def point_b(self) -> Floats:
        return self._vector(gjk_exact.POINT_B)


def _sets(vertices: Floats) -> Sets:
    n = len(vertices)
    return make_sets(
        vertices,
        np.array([0, n], dtype=np.int64),
        np.zeros(n + 1, dtype=np.int64),
        np.zeros(0, dtype=np.int64),
    )


def _mapped(rotation: Floats | None, points: Floats, offset: Floats) -> Floats:
    """Return R p + offset without BLAS, whose last digit depends on the machine."""
    if rotation is None:
        return points + offset
    columns = [points[:, 0] * row[0] + points[:, 1] * row[1] + points[:, 2] * row[2] for row in rotation]
    return np.stack(columns, axis=1) + offset


def _exact_shift(a: Floats, b: Floats) -> Floats:
    """Return the origin to subtract: per axis a value for which no subtraction rounds, else 0."""
    low = np.minimum(a.min(axis=0), b.min(axis=0))
    high = np.maximum(a.max(axis=0), b.max(axis=0))
    near, far = np.minimum(np.abs(low), np.abs(high)), np.maximum(np.abs(low), np.abs(high))
    exact = (np.sign(low) == np.sign(high)) & (far <= 2.0 * near)  # x/2 <= y <= 2x: x - y is exact
    return np.where(exact, low, 0.0)


def _vertices(name: str, value: ArrayLike) -> Floats:
    points = as_floats(name, value, (None, 3))
    if len(points) == 0:
        raise InvalidValue(name, "no points", "must have shape (n, 3) with n >= 1")
    _check_finite(name, points)
    return points


def _pose(name: str, value: ArrayLike | None) -> tuple[Floats | None, Floats]:
    """Return (R or None for the identity, p) of a rigid transform."""
    if value is None:
        return None, np.zeros(3)
    pose = as_floats(name, value, (4, 4))
    _check_finite(name, pose)
    rotation, position = pose[:3, :3], pose[:3, 3]
    if pose[3].tolist() != [0.0, 0.0, 0.0, 1.0]:
        raise InvalidValue(f"{name}[3]", pose[3].tolist(), "the last row of a rigid transform is 0 0 0 1")
    if not _is_rotation(rotation):
        rule = f"must be a rotation: |R^T R - I| <= {RIGID_TOLERANCE:g} and det R = +1"
        raise InvalidValue(f"{name}[:3, :3]", rotation.tolist(), rule)
    if (rotation == np.identity(3)).all():
        return None, position
    return rotation, position


def _is_rotation(rotation: Floats) -> bool:
    if float(np.abs(rotation).max()) > 2.0:
        return False
    x, y, z = rotation.T
    gram = np.array([[float(np.sum(u * v)) for u in (x, y, z)] for v in (x, y, z)])
    handed = float(np.sum(np.cross(x, y) * z))
    return bool(float(np.abs(gram - np.identity(3)).max()) <= RIGID_TOLERANCE and handed > 0.0)


def _check_finite(name: str, value: Floats) -> None:
    bad = ~(np.abs(value) <= LARGEST_COORDINATE)
    if bad.any():
        place = tuple(int(k) for k in np.argwhere(bad)[0])
        raise InvalidValue(f"{name}{list(place)}", float(value[place]), "must be finite and below 1e100 m")
