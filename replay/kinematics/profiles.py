"""One joint's motion as a piecewise polynomial in time: through waypoints, or by trapezoidal velocity profiles.

Every kind of scripted motion ends up here, so that sampling and checking limits are written once. A piece holds six
coefficients in its own local time tau = t - start: x = c0 + c1 tau + ... + c5 tau^5.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from replay.errors import InvalidValue
from replay.numerics.arrays import Floats


@dataclass(frozen=True)
class Waypoint:
    """What a joint passes at one time, with the meaning of a point of a ROS JointTrajectory.

    Attributes:
        time: [s] from the scenario's start.
        position: [rad or m].
        velocity: [per s], or None.
        acceleration: [per s^2], or None; needs a velocity.
    """

    time: float
    position: float
    velocity: float | None = None
    acceleration: float | None = None

    @property
    def order(self) -> int:
        """0 with a position alone, 1 with a velocity, 2 with an acceleration as well."""
        return (self.velocity is not None) + (self.velocity is not None and self.acceleration is not None)


@dataclass(frozen=True, eq=False)
class Profile:
    """A joint's position over time; outside its pieces the nearest end's value holds.

    Attributes:
        start, end: (m,) [s], times of the pieces, increasing; between two pieces the earlier one's end value holds.
        coefficients: (m, 6), see the module's text.
        before, after: [rad or m], position before the first and after the last piece.
    """

    start: Floats
    end: Floats
    coefficients: Floats
    before: float
    after: float

    def sample(self, seconds: Floats) -> tuple[Floats, Floats]:
        """Return position (n,) and velocity (n,) at times (n,) [s]."""
        if not len(self.start):
            return np.full(len(seconds), self.after), np.zeros(len(seconds))
        piece = np.searchsorted(self.start, seconds, side="right") - 1
        inside = np.maximum(piece, 0)
        c = self.coefficients[inside]
        tau = np.minimum(seconds, self.end[inside]) - self.start[inside]
        position = c[:, 5]
        velocity = 5.0 * c[:, 5]
        for power in range(4, -1, -1):
            position = position * tau + c[:, power]
            if power:
                velocity = velocity * tau + power * c[:, power]
        resting = (piece < 0) | (seconds > self.end[inside])
        position = np.where(piece < 0, self.before, np.where(seconds >= self.end[-1], self.after, position))
        return position, np.where(resting, 0.0, velocity)

    def scaled(self, multiplier: float, offset: float) -> Profile:
        """Return the profile of a joint that follows this one: multiplier * position + offset."""
        coefficients = multiplier * self.coefficients
        coefficients[:, 0] += offset
        before, after = multiplier * self.before + offset, multiplier * self.after + offset
        return Profile(self.start, self.end, coefficients, before, after)

    def by_direction(self) -> tuple[Profile, Profile]:
        """Return the parts in which the position rises and those in which it falls, each as a profile.

        Pieces are cut where the velocity changes its sign; where it is zero all along there is neither.
        """
        rising: list[list[float]] = []
        falling: list[list[float]] = []
        for start, end, row in zip(self.start.tolist(), self.end.tolist(), self.coefficients.tolist(), strict=True):
            position = np.polynomial.Polynomial(row)
            velocity = position.deriv()
            roots = map(complex, velocity.trim().roots())
            inner = (root.real for root in roots if abs(root.imag) <= 1e-9 * (1.0 + abs(root.real)))
            cuts = [0.0, *sorted(tau for tau in inner if 0.0 < tau < end - start), end - start]
            for a, b in itertools.pairwise(cuts):
                moving = float(velocity(0.5 * (a + b)))
                if moving != 0.0:
                    shifted = position(np.polynomial.Polynomial([a, 1.0])).coef.tolist()
                    coefficients = (shifted + [0.0] * 6)[:6]
                    (rising if moving > 0.0 else falling).append([start + a, start + b, *coefficients])
        return from_pieces(rising, self.before, self.after), from_pieces(falling, self.before, self.after)

    def fastest(self, begin: float, end: float) -> float:
        """Return the largest absolute velocity on [begin, end] [s]: at jumps and ends both one-sided values count."""
        found = 0.0
        first, last = np.searchsorted(self.end, begin, side="left"), np.searchsorted(self.start, end, side="right")
        for k in range(int(first), int(last)):
            start = float(self.start[k])
            a, b = max(begin, start) - start, min(end, float(self.end[k])) - start
            c = self.coefficients[k].tolist()
            taus = [a, b]
            if any(c[3:]):  # a velocity that is no line may be largest in between
                turns = np.roots([20.0 * c[5], 12.0 * c[4], 6.0 * c[3], 2.0 * c[2]])
                real = np.abs(turns.imag) <= 1e-9 * (1.0 + np.abs(turns.real))
                taus += [tau for tau in turns.real[real].tolist() if a < tau < b]
            for tau in taus:
                velocity = c[1] + tau * (2.0 * c[2] + tau * (3.0 * c[3] + tau * (4.0 * c[4] + tau * 5.0 * c[5])))
                found = max(found, abs(velocity))
        return found

    def length(self, begin: float, end: float) -> float:
        """Return how far the joint goes on [begin, end] [s], there and back added up."""
        times = {begin, end}
        for k in np.flatnonzero((self.end > begin) & (self.start < end)).tolist():
            start = float(self.start[k])
            velocity = np.polynomial.Polynomial(self.coefficients[k]).deriv().trim()
            turns = map(complex, velocity.roots()) if len(velocity.coef) > 1 else ()
            inner = (root.real for root in turns if abs(root.imag) <= 1e-9 * (1.0 + abs(root.real)))
            times |= {start, float(self.end[k]), *(start + tau for tau in inner)}
        positions, _ = self.sample(np.array(sorted(time for time in times if begin <= time <= end)))
        return float(np.sum(np.abs(np.diff(positions))))

    def extremes(self, derivative: int) -> list[tuple[float, float]]:
        """Return candidates (time, value) for the extremes of a derivative: piece ends and inner stationary points."""
        if not len(self.start):
            return [(0.0, self.after if derivative == 0 else 0.0)]
        found = [(float(self.start[0]), self.before), (float(self.end[-1]), self.after)] if derivative == 0 else []
        c = self.coefficients
        for _ in range(derivative):
            c = c[:, 1:] * np.arange(1.0, c.shape[1])
        length = self.end - self.start
        at_end = np.zeros(len(c))
        for power in range(c.shape[1] - 1, -1, -1):
            at_end = at_end * length + c[:, power]
        for times, values in ((self.start, c[:, 0]), (self.end, at_end)):
            found.extend((float(times[k]), float(values[k])) for k in (values.argmin(), values.argmax()))
        for k in np.flatnonzero((c[:, 2:] != 0.0).any(axis=1)):  # a line has its extremes at its ends
            polynomial = np.polynomial.Polynomial(c[k])
            roots = map(complex, polynomial.deriv().trim().roots())
            inner = [root.real for root in roots if abs(root.imag) <= 1e-9 * (1.0 + abs(root.real))]
            found.extend((float(self.start[k]) + t, float(polynomial(t))) for t in inner if 0.0 < t < length[k])
        return found


def through_waypoints(name: str, waypoints: Sequence[Waypoint]) -> Profile:
    """Return the profile through waypoints: linear, cubic or quintic in each interval.

    An interval takes the highest order that both its ends offer: positions alone give a line, velocities the cubic
    Hermite polynomial, accelerations as well the quintic one (as ROS's joint_trajectory_controller does).

    Raises:
        InvalidValue: there are no waypoints, or their times do not strictly increase.
    """
    if not waypoints:
        raise InvalidValue(f"motion.points.{name}", "[]", "must have at least one point")
    times = [point.time for point in waypoints]
    for k, (earlier, later) in enumerate(itertools.pairwise(times)):
        if not later > earlier:
            raise InvalidValue(
                f"motion.points.{name}[{k + 1}].time", later, f"must be above the one before, {earlier} s"
            )
    pieces = [_hermite(a, b) for a, b in itertools.pairwise(waypoints)]
    return Profile(
        start=np.array(times[:-1]),
        end=np.array(times[1:]),
        coefficients=np.array(pieces).reshape(-1, 6),
        before=waypoints[0].position,
        after=waypoints[-1].position,
    )


def through_samples(seconds: Floats, positions: Floats) -> Profile:
    """Return the profile that joins samples by straight lines.

    Args:
        seconds: (n,) strictly increasing times [s], n >= 1.
        positions: (n,) [rad or m].
    """
    coefficients = np.zeros((len(seconds) - 1, 6))
    coefficients[:, 0] = positions[:-1]
    coefficients[:, 1] = np.diff(positions) / np.diff(seconds)
    return Profile(seconds[:-1], seconds[1:], coefficients, before=float(positions[0]), after=float(positions[-1]))


def _hermite(a: Waypoint, b: Waypoint) -> list[float]:
    """Coefficients between two waypoints, in local time; h is the interval, d the change of position."""
    h = b.time - a.time
    d = b.position - a.position
    order = min(a.order, b.order)
    if order == 0:
        return [a.position, d / h, 0.0, 0.0, 0.0, 0.0]
    assert a.velocity is not None and b.velocity is not None
    v, w = a.velocity * h, b.velocity * h
    if order == 1:
        return [a.position, a.velocity, (3.0 * d - 2.0 * v - w) / h**2, (v + w - 2.0 * d) / h**3, 0.0, 0.0]
    assert a.acceleration is not None and b.acceleration is not None
    p, q = a.acceleration * h * h, b.acceleration * h * h
    return [
        a.position,
        a.velocity,
        0.5 * a.acceleration,
        (10.0 * d - 6.0 * v - 4.0 * w - 1.5 * p + 0.5 * q) / h**3,
        (-15.0 * d + 8.0 * v + 7.0 * w + 1.5 * p - q) / h**4,
        (6.0 * d - 3.0 * v - 3.0 * w - 0.5 * p + 0.5 * q) / h**5,
    ]


def trapezoid_time(distance: float, velocity: float, acceleration: float, deceleration: float | None = None) -> float:
    """Return the time [s] that a trapezoidal (short ways: triangular) velocity profile takes for a distance >= 0.

    With the harmonic mean h of acceleration and deceleration, which is the acceleration itself if both are equal, the
    top velocity is reached on ways above v^2 / h; these take d / v + v / h, shorter ones 2 sqrt(d / h).
    """
    mean = acceleration
    if deceleration is not None and deceleration != acceleration:
        mean = 2.0 / (1.0 / acceleration + 1.0 / deceleration)
    if distance * mean <= velocity * velocity:
        return 2.0 * math.sqrt(distance / mean)
    return distance / velocity + velocity / mean


def trapezoid(
    start: float,
    origin: float,
    target: float,
    velocity: float,
    acceleration: float,
    deceleration: float | None = None,
) -> list[list[float]]:
    """Return the pieces [start, end, c0..c5] of one move from rest to rest under its limits.

    Args:
        start: [s], when the move begins.
        origin, target: [rad or m].
        velocity, acceleration: limits, both > 0.
        deceleration: limit while it slows down, > 0; `acceleration` when None.
    """
    distance = abs(target - origin)
    if distance == 0.0:
        return []
    braking = acceleration if deceleration is None else deceleration
    sign = math.copysign(1.0, target - origin)
    total = trapezoid_time(distance, velocity, acceleration, braking)
    speeding_up = braking / (acceleration + braking)  # share of the time, if the top velocity is not reached
    ramp = min(velocity / acceleration, speeding_up * total)
    brake = min(velocity / braking, (1.0 - speeding_up) * total)
    rise, fall = 0.5 * acceleration * ramp * ramp, 0.5 * braking * brake * brake
    a, d = sign * acceleration, sign * braking
    pieces = [[start, start + ramp, origin, 0.0, 0.5 * a, 0.0, 0.0, 0.0]]
    cruise = total - (ramp + brake)
    if cruise > 0.0:
        v = sign * acceleration * ramp
        pieces.append([start + ramp, start + ramp + cruise, origin + sign * rise, v, 0.0, 0.0, 0.0, 0.0])
    pieces.append([start + total - brake, start + total, target - sign * fall, d * brake, -0.5 * d, 0.0, 0.0, 0.0])
    return pieces


def from_pieces(pieces: Sequence[Sequence[float]], before: float, after: float) -> Profile:
    """Return the profile made of pieces [start, end, c0..c5] in order of time."""
    table = np.array(pieces, dtype=np.float64).reshape(-1, 8)
    return Profile(start=table[:, 0], end=table[:, 1], coefficients=table[:, 2:], before=before, after=after)
