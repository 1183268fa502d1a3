"""Bounding volumes that meet: never apart when they touch, apart when a gap beyond rounding lies between them."""

import itertools

import numpy as np
import pytest

from replay.geometry.bounds import Aabb, Obb, Sphere, aabbs_meet, fit_aabb, fit_obb, fit_sphere, obbs_meet, spheres_meet
from replay.numerics import transforms
from tests.amounts import cases

SIGNS = np.array(list(itertools.product([-1.0, 1.0], repeat=3)))


def rigid(rng: np.random.Generator, far: float) -> np.ndarray:
    """A random pose; one in four has axes nearly or exactly parallel to the reference."""
    kind = rng.integers(8)
    if kind == 0:
        T = transforms.identity()
    elif kind == 1:
        T = transforms.from_rpy(rng.normal(size=3) * 10.0 ** rng.uniform(-17, -5))
    else:
        T = transforms.from_quaternion(rng.normal(size=4))
    T[:3, 3] = far * rng.uniform(-1, 1, size=3)
    return T


def random_box(rng: np.random.Generator, far: float) -> Obb:
    widths = 10.0 ** rng.uniform(-3, 0, size=3) * (rng.uniform(size=3) > 0.1)  # some are flat
    T = rigid(rng, far)
    return Obb(T[:3, 3].copy(), widths, np.ascontiguousarray(T[:3, :3].T))


def place(T: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """T with its origin such that b (in link b) comes to a (in link a)."""
    T = T.copy()
    T[:3, 3] = a - (transforms.apply(T, b) - T[:3, 3])
    return T


def meet_obb(a: Obb, b: Obb, T: np.ndarray) -> bool:
    return obbs_meet(a.center, a.half_widths, a.axes, b.center, b.half_widths, b.axes, T)


def gap(a: Obb, b: Obb, T: np.ndarray) -> float:
    """The largest gap along the 15 axes, in extended precision; negative: the least overlap."""
    L = np.longdouble
    R = T[:3, :3].astype(L)
    axes_b = (R @ b.axes.astype(L).T).T
    offset = R @ b.center.astype(L) + T[:3, 3].astype(L) - a.center.astype(L)
    axes = [*a.axes.astype(L), *axes_b]
    axes += [np.cross(u, v) for u in axes[:3] for v in axes[3:]]
    best = -np.inf
    for axis in axes:
        length = np.sqrt(np.sum(axis**2))
        if length > 1e-6:
            axis = axis / length
            reach = np.abs(a.axes @ axis) @ a.half_widths + np.abs(axes_b @ axis) @ b.half_widths
            best = max(best, float(abs(offset @ axis) - reach))
    return best


@pytest.mark.parametrize("far", [0.0, 1.0, 1e6])
def test_touching_boxes_meet(far: float) -> None:
    """Corner on corner, corner on face, edge on edge: the common point is rounded, and the boxes still meet."""
    rng = np.random.default_rng(1)
    for _ in range(cases(3000)):
        a, b = random_box(rng, far), random_box(rng, far)
        kinds = rng.integers(-1, 2, size=(2, 3)).astype(float)  # corner, edge or face of each
        kinds = np.where(kinds == 0, rng.uniform(-1, 1, size=(2, 3)), kinds)
        on_a = a.center + (kinds[0] * a.half_widths) @ a.axes
        on_b = b.center + (kinds[1] * b.half_widths) @ b.axes
        T = place(rigid(rng, 0.0), on_a, on_b)
        assert meet_obb(a, b, T)
        around_a = fit_aabb(a.center + (SIGNS * a.half_widths) @ a.axes)
        around_b = fit_aabb(b.center + (SIGNS * b.half_widths) @ b.axes)
        assert aabbs_meet(around_a.center, around_a.half_widths, around_b.center, around_b.half_widths, T)


@pytest.mark.parametrize("far", [0.0, 1e3])
def test_gaps_are_seen(far: float) -> None:
    """Pairs near contact, against the 15 axes in extended precision: no answer wrong beyond rounding."""
    rng = np.random.default_rng(2)
    met = []
    for _ in range(cases(2000)):
        a, b = random_box(rng, far), random_box(rng, far)
        T = rigid(rng, 0.0)
        direction = rng.normal(size=3)
        reach = np.linalg.norm(a.half_widths) + np.linalg.norm(b.half_widths)
        T = place(T, a.center + rng.uniform(0, 0.6) * reach * direction / np.linalg.norm(direction), b.center)
        truth = gap(a, b, T)
        found = meet_obb(a, b, T)
        met.append(found)
        if truth <= 0.0:
            assert found
        elif truth > 1e-12 * (1.0 + far):
            assert not found
        swapped = meet_obb(b, a, transforms.invert(T))
        assert swapped == found or abs(truth) <= 1e-12 * (1.0 + far)
    assert 0.3 < np.mean(met) < 0.7


@pytest.mark.parametrize("step", [1e-3, 1e-6, 1e-9, 1e-12])
def test_ladder(step: float) -> None:
    """Just missing and just reaching, for faces, and for edges that cross."""
    unit = Obb(np.zeros(3), np.ones(3), np.eye(3))
    face = transforms.from_translation(np.array([2.0, 0.3, 0.1]))
    about_z, about_y = (transforms.from_rpy(np.array(rpy))[:3, :3] for rpy in ([0, 0, np.pi / 4], [0, np.pi / 4, 0]))
    upright = Obb(np.zeros(3), np.ones(3), np.ascontiguousarray(about_z.T))  # its foremost edge is along z
    lying = Obb(np.zeros(3), np.ones(3), np.ascontiguousarray(about_y.T))  # its hindmost edge is along y
    edge = transforms.from_translation(np.array([8.0**0.5, 0.0, 0.0]))
    ball = Sphere(np.zeros(3), 1.0)
    box = Aabb(np.zeros(3), np.ones(3))
    for a, b, T in ((unit, unit, face), (upright, lying, edge)):
        T = T.copy()
        T[0, 3] += step
        assert not meet_obb(a, b, T)
        T[0, 3] -= 2 * step
        assert meet_obb(a, b, T)
    apart, near = (transforms.from_translation(np.array([2.0 + s, 0, 0])) for s in (step, 0.0))
    assert not spheres_meet(ball.center, ball.radius, ball.center, ball.radius, apart)
    assert spheres_meet(ball.center, ball.radius, ball.center, ball.radius, near)
    assert not aabbs_meet(box.center, box.half_widths, box.center, box.half_widths, apart)
    assert aabbs_meet(box.center, box.half_widths, box.center, box.half_widths, near)


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("far", [0.0, 1e3])
def test_no_contact_is_lost(scale: float, far: float) -> None:
    """Bodies that share a point: their volumes meet, whatever kind they are of."""
    rng = np.random.default_rng(3)
    for _ in range(cases(100)):
        clouds = [
            scale * (rng.normal(size=(rng.integers(1, 12), 3)) * 10.0 ** rng.uniform(-6, 0, size=3))
            + scale * far * rng.uniform(-1, 1, size=3)
            for _ in range(2)
        ]
        T = place(rigid(rng, 0.0), clouds[0][0], clouds[1][0])
        a, b = (fit_obb(cloud) for cloud in clouds)
        assert meet_obb(a, b, T)
        a, b = (fit_sphere(cloud) for cloud in clouds)
        assert spheres_meet(a.center, a.radius, b.center, b.radius, T)
        a, b = (fit_aabb(cloud) for cloud in clouds)
        assert aabbs_meet(a.center, a.half_widths, b.center, b.half_widths, T)
