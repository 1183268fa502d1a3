"""What a joint's script and its clock make of its acceleration together, where something acts on the clock."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.polynomial import Polynomial

from replay.kinematics.clock import Clock
from replay.kinematics.linkage import Joint
from replay.kinematics.motion import LIMIT_SLACK
from replay.kinematics.profiles import Profile


@dataclass(frozen=True)
class Excess:
    """A stretch of time in which a joint's acceleration is beyond its limit.

    Attributes:
        begin, end: [s].
        time: [s], of the largest acceleration; `acceleration` that one, and `limit` what it is beyond [per s^2].
    """

    begin: float
    end: float
    time: float
    acceleration: float
    limit: float


@dataclass(frozen=True)
class _Stretch:
    """A part of time on which velocity and acceleration are polynomials of u = t - begin."""

    begin: float
    end: float
    velocity: Polynomial
    acceleration: Polynomial


def excesses(joint: Joint, profile: Profile, clock: Clock, begin: float, end: float) -> list[Excess]:
    """Return where the acceleration q'' r^2 + q' r' is beyond the joint's limit, on [begin, end] [s].

    Only where the clock is not the time itself; at knots of straight lines there is no acceleration. Against the
    velocity the limit is that of the deceleration.
    """
    if math.isinf(joint.acceleration) and math.isinf(joint.braking):
        return []
    found: list[Excess] = []
    for stretch in _stretches(profile, clock, begin, end):
        for part in _beyond(joint, stretch):
            if found and part.begin <= found[-1].end:
                last = found.pop()
                worse = max(last, part, key=lambda item: item.acceleration / item.limit)
                part = Excess(last.begin, part.end, worse.time, worse.acceleration, worse.limit)
            found.append(part)
    return found


def peak(profile: Profile, clock: Clock, begin: float, end: float) -> tuple[float, float]:
    """Return the time [s] and the size [per s^2] of the largest acceleration on [begin, end]; 0 where nothing acts."""
    found = [(begin, 0.0)]
    for stretch in _stretches(profile, clock, begin, end):
        length = stretch.end - stretch.begin
        times = [0.0, length, *_roots(stretch.acceleration.deriv(), length)]
        found.extend((stretch.begin + u, abs(float(stretch.acceleration(u)))) for u in times)
    return max(found, key=lambda item: item[1])


def _stretches(profile: Profile, clock: Clock, begin: float, end: float) -> Iterator[_Stretch]:
    ends = np.append(clock.start[1:], math.inf)[: len(clock.start)]
    clocks = zip(clock.start, ends, clock.script, clock.rate, clock.ramp, strict=True)
    for start, stop, script, rate, ramp in ((float(v) for v in row) for row in clocks):
        a, b = max(begin, start), min(end, stop)
        if not a < b or (rate, ramp) == (1.0, 0.0) or (rate, ramp) == (0.0, 0.0):
            continue
        s = Polynomial([script, rate, 0.5 * ramp])
        passed = (float(s(a - start)), math.inf if math.isinf(b) else float(s(b - start)))
        pieces = slice(np.searchsorted(profile.end, passed[0]), np.searchsorted(profile.start, passed[1], side="right"))
        rows = zip(profile.start[pieces], profile.end[pieces], profile.coefficients[pieces], strict=True)
        for first, last, row in rows:
            low, high = (
                max(_when(s, float(first), b - start), a - start),
                min(_when(s, float(last), b - start), b - start),
            )
            if not low < high:
                continue
            local = Polynomial([low, 1.0])
            q, place = Polynomial(row), s(local) - float(first)
            velocity, rising = q.deriv()(place), s.deriv()(local)
            acceleration = q.deriv(2)(place) * rising**2 + velocity * ramp
            yield _Stretch(start + low, start + high, velocity * rising, acceleration)


def _when(s: Polynomial, value: float, most: float) -> float:
    """Return when a clock that does not fall shows a value [s], within its piece; inf if it never does."""
    script, rate, half = (float(c) for c in np.pad(s.coef, (0, 3 - len(s.coef))))
    ahead = value - script
    if ahead <= 0.0:
        return 0.0
    square = rate * rate + 4.0 * half * ahead
    bottom = rate + math.sqrt(max(square, 0.0))
    return math.inf if square < 0.0 or bottom <= 0.0 else 2.0 * ahead / bottom


def _beyond(joint: Joint, stretch: _Stretch) -> Iterator[Excess]:
    length = stretch.end - stretch.begin
    a, v = stretch.acceleration, stretch.velocity
    limits = {limit for limit in (joint.acceleration, joint.braking) if math.isfinite(limit)}
    bounds = [sign * limit * (1.0 + LIMIT_SLACK) for limit in limits for sign in (-1.0, 1.0)]
    inner = [u for polynomial in (v, *(a - bound for bound in bounds)) for u in _roots(polynomial, length)]
    for low, high in itertools.pairwise(sorted({0.0, length, *inner})):
        middle = 0.5 * (low + high)
        limit = joint.braking if float(a(middle)) * float(v(middle)) < 0.0 else joint.acceleration
        if abs(float(a(middle))) > limit * (1.0 + LIMIT_SLACK):
            times = [low, high, *(u for u in _roots(a.deriv(), length) if low < u < high)]
            worst = max(times, key=lambda u: abs(float(a(u))))
            place = stretch.begin + worst
            yield Excess(stretch.begin + low, stretch.begin + high, place, abs(float(a(worst))), limit)


def _roots(polynomial: Polynomial, length: float) -> list[float]:
    trimmed = polynomial.trim()
    if len(trimmed.coef) < 2:
        return []
    roots = map(complex, trimmed.roots())
    return [root.real for root in roots if abs(root.imag) <= 1e-9 * (1.0 + abs(root.real)) and 0.0 < root.real < length]
