"""Rigid transforms against scipy's rotations and against each other."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.transform import Rotation

from replay.numerics import transforms
from tests.amounts import cases

ANGLES = st.one_of(st.floats(-7, 7), st.sampled_from([0.0, 1e-9, np.pi, -np.pi, np.pi - 1e-9, np.pi / 2]))
EPS = 4e-15  # a dozen roundings of numbers near 1


@given(arrays(float, 3, elements=ANGLES))
@settings(max_examples=cases(100), deadline=None)
def test_rpy_matches_scipy(rpy):
    np.testing.assert_allclose(transforms.from_rpy(rpy)[:3, :3], Rotation.from_euler("xyz", rpy).as_matrix(), atol=EPS)


@given(arrays(float, 4, elements=st.floats(-1, 1)).filter(lambda q: np.linalg.norm(q) > 1e-3))
@settings(max_examples=cases(200), deadline=None)
def test_quaternion_round_trip_is_xyzw_with_w_not_negative(quat):
    unit = quat / np.linalg.norm(quat)
    back = transforms.to_quaternion(transforms.from_quaternion(quat))
    assert back[3] >= 0.0
    assert min(np.abs(back - unit).max(), np.abs(back + unit).max()) <= EPS
    np.testing.assert_allclose(transforms.from_quaternion(quat)[:3, :3], Rotation.from_quat(quat).as_matrix(), atol=EPS)


def test_order_of_quaternion_components():
    half = np.sqrt(0.5)
    turned = transforms.apply(transforms.from_quaternion(np.array([0.0, 0.0, half, half])), np.array([1.0, 0.0, 0.0]))
    np.testing.assert_allclose(turned, [0.0, 1.0, 0.0], atol=EPS)  # 90 deg about z: x goes to y


def test_compose_invert_and_apply_agree_with_matrix_algebra():
    rng = np.random.default_rng(2)
    a, b = (transforms.from_quaternion(rng.normal(size=(50, 4))) for _ in range(2))
    a[:, :3, 3], b[:, :3, 3] = rng.normal(size=(2, 50, 3))
    np.testing.assert_allclose(transforms.compose(a, b), a @ b, atol=EPS)
    np.testing.assert_allclose(
        transforms.compose(transforms.invert(a), a), np.broadcast_to(np.eye(4), a.shape), atol=EPS
    )
    points = rng.normal(size=(50, 3))
    expected = np.einsum("nij,nj->ni", a[:, :3, :3], points) + a[:, :3, 3]
    np.testing.assert_allclose(transforms.apply(a, points), expected, atol=EPS)


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-7, 0.3, 2.0, 3.1, np.pi - 1e-9])
def test_slerp_turns_evenly_on_the_shortest_arc(angle):
    start = np.array([0.0, 0.0, 0.0, 1.0])
    end = -np.array([0.0, np.sin(angle / 2), 0.0, np.cos(angle / 2)])  # the far representative of the same rotation
    fraction = np.linspace(0.0, 1.0, 11)
    turned = transforms.slerp(np.tile(start, (11, 1)), np.tile(end, (11, 1)), fraction)
    expected = Rotation.from_rotvec(np.outer(fraction * angle, [0.0, 1.0, 0.0])).as_matrix()
    np.testing.assert_allclose(transforms.from_quaternion(turned)[:, :3, :3], expected, atol=EPS)


@pytest.mark.parametrize("excess", [0.0, 1e-9, -1e-9])
def test_slerp_gives_unit_quaternions_although_its_ends_are_rounded(excess):
    rng = np.random.default_rng(5)
    ends = rng.normal(size=(2, cases(5000), 4))
    start, end = ends / np.linalg.norm(ends, axis=-1)[..., None] * (1.0 + excess)
    found = transforms.slerp(start, end, rng.uniform(size=len(start)))
    lengths = np.sqrt(np.sum(found.astype(np.longdouble) ** 2, axis=1))
    np.testing.assert_allclose(lengths.astype(float), 1.0, rtol=0, atol=4e-16)
