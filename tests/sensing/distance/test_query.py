"""The tree, its bounds and the starting bound change no bit of any answer."""

import math

import numpy as np
import pytest

from replay.geometry.tree import triangle_tree
from replay.geometry.wide_tree import LANES, MAX_WAITING, widen
from replay.numerics.jit import kernel
from replay.sensing.distance.cone import Cone, half_angle
from replay.sensing.distance.query import COUNTS, closest_in_tree, closest_of_all
from tests.sensing.distance.meshes import grid_of_cubes, torus


@kernel
def all_answers(triangles, tree, apexes, axes, half_angles, reaches, starts, walk, rounding):
    stack, waiting, bounds = np.empty(MAX_WAITING, dtype=np.int64), np.empty(MAX_WAITING), np.empty(LANES)
    answers, counts = np.empty((len(apexes), 6)), np.zeros(COUNTS, dtype=np.int64)
    for i in range(len(apexes)):
        cone = Cone(axes[i, 0], axes[i, 1], axes[i, 2], half_angles[i, 0], half_angles[i, 1], rounding)
        apex = (apexes[i, 0], apexes[i, 1], apexes[i, 2])
        if walk:
            distance, x, triangle, case = closest_in_tree(
                triangles, tree, apex, cone, reaches[i], starts[i], stack, waiting, bounds, counts
            )
        else:
            distance, x, triangle, case = closest_of_all(triangles, apex, cone, reaches[i])
        answers[i, 0], answers[i, 1], answers[i, 2] = distance, triangle, case
        for k in range(3):
            answers[i, 3 + k] = x[k]
    return answers


def soup(rng):
    triangles = rng.normal(size=(700, 3, 3)) * np.exp(rng.uniform(-4.0, 0.0, size=(700, 1, 1)))
    triangles += rng.normal(size=(700, 1, 3)) * 2.0
    triangles[::50, 2] = triangles[::50, 1]  # segments
    triangles[1::50] = triangles[1::50, :1]  # points
    return triangles


MESHES = {
    "torus": lambda rng: torus(40, 20),
    "cubes": lambda rng: grid_of_cubes(4),
    "soup": soup,
    "far": lambda rng: torus(20, 12) * 0.1 + [1e6, -2e5, 3e5],
    "fine": lambda rng: torus(120, 50),
    "one": lambda rng: rng.normal(size=(1, 3, 3)),
    "two": lambda rng: rng.normal(size=(2, 3, 3)),
    "a leaf": lambda rng: rng.normal(size=(LANES, 3, 3)),
    "a leaf and one": lambda rng: rng.normal(size=(LANES + 1, 3, 3)),
}


@pytest.mark.parametrize("rounding", [0.0, 0.02])
@pytest.mark.parametrize("name", MESHES)
def test_walk_equals_scan_bit_for_bit(name, rounding):
    rng = np.random.default_rng(20152)
    triangles = np.ascontiguousarray(MESHES[name](rng))
    tree = widen(triangle_tree(triangles), triangles)
    n = 400
    centre, size = triangles.mean(axis=(0, 1)), np.ptp(triangles, axis=(0, 1)).max()
    apexes = centre + size * rng.normal(size=(n, 3))
    apexes[::4] = np.round(apexes[::4] * 2.0) / 2.0  # on corners, edges and faces of the cubes
    apexes[1::20] = triangles[rng.integers(len(triangles), size=len(apexes[1::20])), 0]
    axes = centre + 0.5 * size * rng.normal(size=(n, 3)) - apexes
    axes[::8] = np.eye(3)[rng.integers(3, size=len(axes[::8]))]
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    apertures = np.where(rng.uniform(size=n) < 0.2, rng.uniform(3.0, 2 * math.pi, n), rng.uniform(0.01, 2.0, n))
    half_angles = np.array([half_angle(aperture) for aperture in apertures])
    reaches = np.where(rng.uniform(size=n) < 0.3, size * rng.uniform(0.0, 2.0, n), np.inf)
    nobody = np.full(n, -1)

    scan = all_answers(triangles, tree, apexes, axes, half_angles, reaches, nobody, False, rounding)
    walk = all_answers(triangles, tree, apexes, axes, half_angles, reaches, nobody, True, rounding)
    np.testing.assert_array_equal(walk, scan)
    assert 0.2 < np.mean(scan[:, 1] >= 0) < 0.999

    anywhere = rng.integers(len(triangles), size=n)
    np.testing.assert_array_equal(
        all_answers(triangles, tree, apexes, axes, half_angles, reaches, anywhere, True, rounding), scan
    )
    answer = scan[:, 1].astype(np.int64)
    np.testing.assert_array_equal(
        all_answers(triangles, tree, apexes, axes, half_angles, reaches, answer, True, rounding), scan
    )

    # Range is inclusive: a reach of exactly the answer finds it again, one unit less in the last place does not
    found = scan[:, 1] >= 0
    exactly = np.where(found, scan[:, 0], 0.0)
    again = all_answers(triangles, tree, apexes, axes, half_angles, exactly, nobody, True, rounding)
    np.testing.assert_array_equal(again[found], scan[found])
    less = np.where(found & (exactly > 0), np.nextafter(exactly, -1.0), 0.0)
    none = all_answers(triangles, tree, apexes, axes, half_angles, less, nobody, True, rounding)
    assert (none[found & (exactly > 0), 1] == -1).all()
