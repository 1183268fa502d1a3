"""Who is in a cone, and what touches its apex, decided in 40 digits."""

import math

import mpmath as mp
import numpy as np
import pytest

from replay.sensing.distance.cone import EPSILON, TOUCH, Cone, half_angle, in_cone, touches
from tests.amounts import cases

HALF_ANGLES = (1e-12, 1e-6, 0.01, 0.3, 1.0, 0.5 * math.pi, 2.0, 3.0, math.pi)


def outside(x, cone):
    """|v × x| cos h - (v · x) sin h over |x|: the sine of the angle beyond the border, of the numbers as they are."""
    with mp.workdps(40):
        v, x = [mp.mpf(c) for c in (cone.vx, cone.vy, cone.vz)], [mp.mpf(float(c)) for c in x]
        across = [v[i] * x[j] - v[j] * x[i] for i, j in ((1, 2), (2, 0), (0, 1))]
        along = sum(a * b for a, b in zip(v, x, strict=True))
        beyond = mp.sqrt(sum(c * c for c in across)) * mp.mpf(cone.cos_half) - along * mp.mpf(cone.sin_half)
        return float(beyond / mp.sqrt(sum(c * c for c in x)))


def on_border(rng, half, beyond):
    """A cone, and a point that was to be `beyond` its border [rad] and is so up to rounding."""
    v = rng.normal(size=3)
    v /= np.linalg.norm(v)
    u = np.cross(v, rng.normal(size=3))
    u /= np.linalg.norm(u)
    angle = half + beyond
    return Cone(*v, *half_angle(2.0 * half), 0.0), 10.0 ** rng.uniform(-6, 6) * (
        math.cos(angle) * v + math.sin(angle) * u
    )


@pytest.mark.parametrize("half", HALF_ANGLES)
def test_a_direction_is_in_the_cone_when_rounding_may_have_taken_it_out(half):
    rng = np.random.default_rng(5)
    found = []
    for beyond in np.repeat([0.0, 1e-16, 4e-16, 1e-15, 3e-15, 1e-12, -1e-12], cases(1500) // 30 + 4):
        cone, x = on_border(rng, half, beyond if half < math.pi else 0.0)
        exact = outside(x, cone)
        inside = in_cone(tuple(x), cone)
        if exact <= 2.5 * EPSILON:
            assert inside, (exact, half)
        elif exact >= 5.5 * EPSILON:
            assert not inside, (exact, half)
        found.append((exact > 0.0 and inside, not inside))
    rescued, refused = np.sum(found, axis=0)
    assert rescued > 0 or half == math.pi, "some must be in it by the slack alone"
    assert refused > 0 or half == math.pi


def test_the_half_space_and_the_full_sphere_are_exact():
    assert half_angle(math.pi) == (0.0, 1.0)
    assert half_angle(2.0 * math.pi) == half_angle(7.0) == (-1.0, 0.0)
    assert half_angle(1.0) == (math.cos(0.5), math.sin(0.5))
    assert half_angle(math.nextafter(math.pi, 4.0)) != (0.0, 1.0)


@pytest.mark.parametrize(
    ("q", "size", "apex", "expected"),
    [
        ((0.0, 0.0, 1e-9), (1.0, 1.0, 1.0), 1e-9, True),  # the apex's own rounding
        ((0.0, 0.0, 1e-9), (1.0, 1.0, 1.0), 0.9e-9, False),
        ((0.0, 0.0, 0.9 * TOUCH), (0.0, 0.0, 1.0), 0.0, True),
        ((0.0, 0.0, 1.1 * TOUCH), (0.0, 0.0, 1.0), 0.0, False),
        ((0.0, 0.0, 0.9 * TOUCH), (1.0, 1.0, 0.0), 0.0, False),  # rounding across q does not bring it nearer
        ((0.0, 0.9 * TOUCH, 0.0), (0.0, 1.0, 0.0), 0.0, True),
        ((-0.9 * TOUCH, 0.0, 0.0), (1.0, 0.0, 0.0), 0.0, True),
        ((0.0, -0.9 * TOUCH, 0.0), (0.0, 1.0, 0.0), 0.0, True),
        ((0.0, 0.0, -0.9 * TOUCH), (0.0, 0.0, 1.0), 0.0, True),
        ((0.6 * TOUCH, 0.0, 0.8 * TOUCH), (0.5, 0.0, 1.0), 0.0, True),  # 0.6 0.5 + 0.8 = 1.1
        ((0.6 * TOUCH, 0.0, 0.8 * TOUCH), (0.5, 0.0, 0.8), 0.0, False),  # 0.3 + 0.64 = 0.94
    ],
)
def test_a_point_touches_the_apex_when_rounding_could_have_put_it_there(q, size, apex, expected):
    assert touches(q, math.sqrt(sum(c * c for c in q)), size, apex) == expected
