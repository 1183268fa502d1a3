"""Do two convex sets meet, and how far apart are they: the public face of GJK."""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass
from functools import cached_property
from typing import NoReturn

import numpy as np
from numpy.typing import ArrayLike

from replay.collision import gjk_exact, gjk_pair
from replay.collision.gjk_exact import DIRECTION, DISTANCE, LOWER, POINT_A, POINT_B, precise_points, workspace
from replay.collision.gjk_pair import LARGEST_COORDINATE, MIDDLE, RIGID_TOLERANCE
from replay.collision.support import Sets, make_sets
from replay.errors import InvalidValue
from replay.numerics.arguments import as_floats
from replay.numerics.arrays import Bytes, Floats


class Status(enum.Enum):
    """The three answers about a pair of convex sets."""

    SEPARATED = gjk_exact.SEPARATED
    CONTACT = gjk_exact.CONTACT
    UNDECIDED = gjk_exact.UNDECIDED


_STATUSES = tuple(Status)  # by their values, 0, 1, 2


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


class Convex:
    """The convex hull of vertices that are asked about often: checked and prepared once.

    Args:
        vertices: (n, 3) [m], n >= 1, in any order; duplicate, collinear, coplanar and inner points are allowed.

    Raises:
        InvalidValue: wrong shape, not finite, or beyond 1e100 m.
    """

    def __init__(self, vertices: ArrayLike) -> None:
        self.vertices = _vertices("vertices", vertices).copy()
        self.vertices.flags.writeable = False
        _check_finite("vertices", self.vertices)

    @cached_property
    def sets(self) -> Sets:
        """The hull as kernels read it."""
        return make_sets(self.vertices, np.array([0, len(self.vertices)], dtype=np.int64))

    @cached_property
    def reach(self) -> float:
        """The largest distance of a vertex from the origin [m]."""
        return math.sqrt(float(np.max(np.sum(self.vertices**2, axis=1))))


def intersect(
    a: ArrayLike | Convex,
    b: ArrayLike | Convex,
    *,
    pose_a: ArrayLike | None = None,
    pose_b: ArrayLike | None = None,
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
    status, answer = _ask(a, b, pose_a, pose_b, 0.0)
    if status is Status.CONTACT:
        return Verdict(status, None, 0.0, answer[MIDDLE : MIDDLE + 3])
    if status is Status.UNDECIDED:
        return Verdict(status, None, 0.0, None)
    return Verdict(status, answer[DIRECTION : DIRECTION + 3], float(answer[LOWER]), None)


def distance(
    a: ArrayLike | Convex,
    b: ArrayLike | Convex,
    *,
    pose_a: ArrayLike | None = None,
    pose_b: ArrayLike | None = None,
) -> Separation:
    """Return the distance of the convex hulls of two vertex sets, with witness points; 0 where they meet or touch.

    Args and Raises: as `intersect`.

    Accuracy:
        For the vertices rounded to doubles about a common origin: relative 1e-12, plus 2^-70 of the scene's size
        (bodies and their offset), proven by `lower_bound`, which may stay behind by 1e-16 of the size where bodies all
        but touch along an edge or a face. That rounding is below 3e-15 of the scene's size
        (tests/collision/test_hard_cases.py). Swapping a and b gives the same status, and the same distance within that.

    Source: Gilbert, Johnson, Keerthi 1988; see `gjk_kernel`.
    """
    status, answer = _ask(a, b, pose_a, pose_b, math.inf)
    if status is Status.CONTACT:
        middle = answer[MIDDLE : MIDDLE + 3]
        return Separation(status, 0.0, 0.0, middle, middle.copy(), None)
    direction = answer[DIRECTION : DIRECTION + 3] if status is Status.SEPARATED else None
    point_a, point_b = answer[POINT_A : POINT_A + 3], answer[POINT_B : POINT_B + 3]
    return Separation(status, float(answer[DISTANCE]), float(answer[LOWER]), point_a, point_b, direction)


def intersects(a: Convex, b: Convex, T_a_b: ArrayLike) -> Bytes:
    """Return the `Status` values (n,) of b at the poses T_a_b (n, 4, 4) in a's frame, an order faster than one by one.

    Raises:
        InvalidValue: as `intersect`.

    Accuracy: as `collision.pipeline`: the vertices of b are rounded in a's frame.
    """
    return _ask_all(a, b, T_a_b, 0.0)[0]


def distances(a: Convex, b: Convex, T_a_b: ArrayLike) -> tuple[Bytes, Floats]:
    """Return `Status` values (n,) and distances (n,) [m], 0 unless separated; see `intersects`.

    Accuracy: relative 1e-12, plus 3e-15 of the bodies' reach and offset (tests/collision/test_gjk.py).
    """
    return _ask_all(a, b, T_a_b, math.inf)


def _ask_all(a: Convex, b: Convex, T_a_b: ArrayLike, cutoff: float) -> tuple[Bytes, Floats]:
    poses = as_floats("T_a_b", T_a_b, (None, 4, 4))
    faulty = gjk_pair.first_not_rigid(poses)
    if faulty >= 0:
        _refuse_pose(f"T_a_b[{faulty}]", poses[faulty])
    status, found = np.empty(len(poses), dtype=np.uint8), np.empty(len(poses))
    gjk_pair.ask_all(a.sets, b.sets, poses, a.reach + b.reach, cutoff, workspace(), precise_points(), status, found)
    return status, found


_HERE = np.identity(4)


def _ask(
    a: ArrayLike | Convex, b: ArrayLike | Convex, pose_a: ArrayLike | None, pose_b: ArrayLike | None, cutoff: float
) -> tuple[Status, Floats]:
    """Return the status and `gjk_pair.ask`'s answer."""
    points_a = a.vertices if isinstance(a, Convex) else _vertices("a", a)
    points_b = b.vertices if isinstance(b, Convex) else _vertices("b", b)
    here = _HERE if pose_a is None else as_floats("pose_a", pose_a, (4, 4))
    there = _HERE if pose_b is None else as_floats("pose_b", pose_b, (4, 4))
    answer = np.empty(16)
    code = gjk_pair.ask(points_a, points_b, here, there, cutoff, answer)
    if code >= 0:
        return _STATUSES[code], answer
    if code == gjk_pair.FAULT_A:
        _check_finite("a", points_a)
    elif code == gjk_pair.FAULT_B:
        _check_finite("b", points_b)
    elif code == gjk_pair.FAULT_POSE_A:
        _refuse_pose("pose_a", here)
    _refuse_pose("pose_b", there)


def _vertices(name: str, value: ArrayLike) -> Floats:
    points = as_floats(name, value, (None, 3))
    if len(points) == 0:
        raise InvalidValue(name, "no points", "must have shape (n, 3) with n >= 1")
    return points


def _refuse_pose(name: str, pose: Floats) -> NoReturn:
    """Raise what is wrong with a pose that is not rigid."""
    _check_finite(name, pose)
    if pose[3].tolist() != [0.0, 0.0, 0.0, 1.0]:
        raise InvalidValue(f"{name}[3]", pose[3].tolist(), "the last row of a rigid transform is 0 0 0 1")
    rule = f"must be a rotation: |R^T R - I| <= {RIGID_TOLERANCE:g} and det R = +1"
    raise InvalidValue(f"{name}[:3, :3]", pose[:3, :3].tolist(), rule)


def _check_finite(name: str, value: Floats) -> None:
    bad = ~(np.abs(value) <= LARGEST_COORDINATE)
    if bad.any():
        place = tuple(int(k) for k in np.argwhere(bad)[0])
        raise InvalidValue(f"{name}{list(place)}", float(value[place]), "must be finite and below 1e100 m")
