"""Profiles piece by piece: coefficients, what holds outside, and extremes, against NumPy's polynomials."""

import itertools
import math

import numpy as np
import pytest

from replay.kinematics.profiles import (
    Profile,
    Waypoint,
    from_pieces,
    through_samples,
    through_waypoints,
    trapezoid,
    trapezoid_time,
)


def two_pieces(rng):
    """A profile that stands still between two pieces."""
    coefficients = rng.normal(size=(2, 6))
    return Profile(np.array([1.0, 4.0]), np.array([3.0, 5.5]), coefficients, before=-7.0, after=9.0)


def test_a_piece_is_its_polynomial_and_its_end_holds_until_the_next():
    profile = two_pieces(np.random.default_rng(1))
    polynomials = [np.polynomial.Polynomial(c) for c in profile.coefficients]
    for t, piece, tau in ((1.0, 0, 0.0), (1.7, 0, 0.7), (2.9, 0, 1.9), (3.0, 0, 2.0), (4.0, 1, 0.0), (5.25, 1, 1.25)):
        position, velocity = profile.sample(np.array([t]))
        assert position[0] == pytest.approx(polynomials[piece](tau), rel=1e-13)
        assert velocity[0] == pytest.approx(polynomials[piece].deriv()(tau), rel=1e-13)
    position, velocity = profile.sample(np.array([0.0, 0.999, 3.001, 3.999, 5.5, 5.501, 99.0]))
    held = polynomials[0](2.0)
    assert position.tolist() == [-7.0, -7.0, pytest.approx(held), pytest.approx(held), 9.0, 9.0, 9.0]
    assert velocity[[0, 1, 2, 3, 5, 6]].tolist() == [0.0] * 6
    assert velocity[4] == pytest.approx(polynomials[1].deriv()(1.5))


def test_a_profile_without_pieces_stands_where_it_ends():
    still = from_pieces([], 1.0, 2.0)
    position, velocity = still.sample(np.array([-1.0, 0.0, 5.0]))
    assert position.tolist() == [2.0] * 3 and velocity.tolist() == [0.0] * 3
    assert [still.extremes(k) for k in range(3)] == [[(0.0, 2.0)], [(0.0, 0.0)], [(0.0, 0.0)]]


@pytest.mark.parametrize("derivative", [0, 1, 2])
@pytest.mark.parametrize("seed", range(8))
def test_extremes_are_those_of_a_fine_sampling(derivative, seed):
    profile = two_pieces(np.random.default_rng(seed))
    found = profile.extremes(derivative)
    low, high = (pick(value for _, value in found) for pick in (min, max))
    sampled = []
    for c, start, end in zip(profile.coefficients, profile.start, profile.end, strict=True):
        polynomial = np.polynomial.Polynomial(c).deriv(derivative) if derivative else np.polynomial.Polynomial(c)
        tau = np.linspace(0.0, end - start, 20_001)
        sampled.append(polynomial(tau))
        for time, value in found:
            if start < time < end:
                assert value == pytest.approx(polynomial(time - start), rel=1e-12, abs=1e-12)
    every = np.concatenate([*sampled, [-7.0, 9.0] if derivative == 0 else []])
    span = np.ptp(every)
    assert low == pytest.approx(every.min(), abs=1e-6 * span)
    assert high == pytest.approx(every.max(), abs=1e-6 * span)
    assert low <= every.min() and every.max() <= high
    times = [time for time, _ in found]
    assert min(times) >= 1.0 and max(times) <= 5.5


@pytest.mark.parametrize(
    ("derivative", "row"), [(0, [0.0, 1.0, -1.0]), (1, [0.0, 0.0, 1.5, -1.0]), (2, [0.0, 0.0, 0.0, 0.5, -0.5])]
)
def test_a_parabola_has_its_extreme_at_its_vertex(derivative, row):
    profile = from_pieces([[2.0, 3.0, *row, *[0.0] * (6 - len(row))]], 0.0, row[0])
    vertex = {0: (2.5, 0.25), 1: (2.5, 0.75), 2: (2.25, 0.375)}[derivative]
    assert max(profile.extremes(derivative), key=lambda found: found[1]) == pytest.approx(vertex, rel=1e-12)


@pytest.mark.parametrize("seed", range(8))
def test_rising_and_falling_parts_are_the_whole_way(seed):
    profile = two_pieces(np.random.default_rng(seed))
    parts = profile.by_direction()
    spans = sorted((a, b) for part in parts for a, b in zip(part.start.tolist(), part.end.tolist(), strict=True))
    assert [spans[0][0], spans[-1][1]] == [1.0, 5.5]
    assert all(b == c or (b, c) == (3.0, 4.0) for (_, b), (c, _) in itertools.pairwise(spans))
    for part, sign in zip(parts, (1.0, -1.0), strict=True):
        for start, end in zip(part.start, part.end, strict=True):
            times = np.linspace(start, end, 50)[1:-1]
            (position, velocity), (of_all, speed) = part.sample(times), profile.sample(times)
            np.testing.assert_allclose(position, of_all, rtol=1e-12, atol=1e-12)
            np.testing.assert_allclose(velocity, speed, rtol=1e-9, atol=1e-9)
            assert (sign * speed > -1e-12).all()


def test_samples_are_joined_by_straight_lines():
    profile = through_samples(np.array([1.0, 2.0, 4.0]), np.array([0.0, 3.0, -1.0]))
    position, velocity = profile.sample(np.array([0.0, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0]))
    assert position.tolist() == [0.0, 0.0, 1.5, 3.0, 1.0, -1.0, -1.0]
    assert velocity.tolist() == [0.0, 3.0, 3.0, -2.0, -2.0, -2.0, 0.0]
    alone = through_samples(np.array([1.0]), np.array([4.0]))
    assert alone.sample(np.array([0.0, 2.0]))[0].tolist() == [4.0, 4.0]


@pytest.mark.parametrize("order", [0, 1, 2])
def test_a_piece_meets_what_both_of_its_ends_say(order):
    a = Waypoint(0.5, 1.0, *(2.0, -3.0)[:order])
    for b in (Waypoint(2.0, -1.5, *(0.25, 4.0)[:order]), Waypoint(2.0, -1.5, 0.25, 4.0)):
        profile = through_waypoints("j", (a, b))
        polynomial = np.polynomial.Polynomial(profile.coefficients[0])
        assert polynomial(0.0) == 1.0 and polynomial(1.5) == pytest.approx(-1.5, abs=1e-14)
        assert np.count_nonzero(profile.coefficients[0, 2 * order + 2 :]) == 0
        for k in range(1, order + 1):
            slope = polynomial.deriv(k)
            first, last = ((a.velocity, b.velocity), (a.acceleration, b.acceleration))[k - 1]
            assert slope(0.0) == pytest.approx(first) and slope(1.5) == pytest.approx(last, abs=1e-13)
    assert [Waypoint(0, 0).order, Waypoint(0, 0, 1.0).order, Waypoint(0, 0, 1.0, 0.0).order] == [0, 1, 2]
    assert Waypoint(0, 0, None, 1.0).order == 0


@pytest.mark.parametrize(
    ("distance", "velocity", "acceleration"), [(10.0, 2.0, 1.0), (4.0, 2.0, 1.0), (1.0, 2.0, 1.0), (5.0, 0.5, 8.0)]
)
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_trapezoid_is_three_arcs_or_two(distance, velocity, acceleration, sign):
    pieces = trapezoid(3.0, 1.0, 1.0 + sign * distance, velocity, acceleration)
    peak = min(velocity, math.sqrt(distance * acceleration))
    ramp = peak / acceleration
    total = 2.0 * ramp + max(0.0, distance - peak * ramp) / peak
    assert trapezoid_time(distance, velocity, acceleration) == pytest.approx(total, rel=1e-15)
    assert len(pieces) == (3 if peak * ramp < distance else 2)
    assert pieces[0][0] == 3.0 and pieces[-1][1] == pytest.approx(3.0 + total)
    for (begin, end, *c), (start, _, *d) in itertools.pairwise(pieces):
        length = end - begin
        assert start == pytest.approx(end)
        position = np.polynomial.Polynomial(c)
        assert d[0] == pytest.approx(position(length), abs=1e-13)
        assert d[1] == pytest.approx(position.deriv()(length), abs=1e-13)
    start, end, *last = pieces[-1]
    position = np.polynomial.Polynomial(last)
    assert position(end - start) == pytest.approx(1.0 + sign * distance, abs=1e-13)
    assert position.deriv()(end - start) == pytest.approx(0.0, abs=1e-13)
    assert abs(pieces[0][4]) == pytest.approx(0.5 * acceleration) == -sign * pieces[-1][4]
    assert trapezoid(3.0, 1.0, 1.0, velocity, acceleration) == []
