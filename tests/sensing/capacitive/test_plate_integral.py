"""The plate integral: high-precision references, invariances, continuity, contact, convergence."""

import json
from pathlib import Path

import mpmath as mp
import numpy as np
import pytest

from replay.errors import InvalidValue
from replay.sensing.capacitive import plate_integral
from tests.sensing.capacitive import plate_cases, plate_reference

_HARD_CASES = Path(__file__).parents[2] / "data" / "plate_integral.json"


def test_hard_cases():
    cases = json.loads(_HARD_CASES.read_text())["cases"]
    with mp.workdps(30):
        for case in cases:
            value = plate_integral([case["triangle"]], case["half_size"], side=case["side"])[0]
            assert plate_reference.error(value, mp.mpf(case["integral"])) <= 1e-14, case


@pytest.mark.parametrize("family", plate_cases.FAMILIES)
def test_random_families_agree_with_60_digits(family):
    rng = np.random.default_rng(3)
    for _ in range(12):
        triangle, half_size, side = plate_cases.case(family, rng)
        value = plate_integral([triangle], half_size, side=side)[0]
        expected = plate_reference.plate_integral(triangle.tolist(), half_size.tolist(), side)
        assert plate_reference.error(value, expected) <= plate_reference.TOLERANCE, (
            triangle.tolist(),
            half_size.tolist(),
            side,
        )


def _cases(count: int, seed: int, families=("random", "spans_all", "crosses_plane", "close", "on_border")):
    rng = np.random.default_rng(seed)
    for k in range(count):
        yield plate_cases.case(families[k % len(families)], rng), rng


def test_mirrored_swapped_and_permuted_triangles_have_the_same_integral():
    for (triangle, half, side), rng in _cases(200, 5):
        value = plate_integral([triangle], half, side=side)[0]
        mirrored = triangle * [-1, 1, 1]
        swapped = triangle[:, [1, 0, 2]]
        permuted = triangle[rng.permutation(3)]
        same = [
            plate_integral([mirrored], half, side=side)[0],
            plate_integral([swapped], half[::-1], side=side)[0],
            plate_integral([permuted], half, side=side)[0],
        ]
        if side == "both":
            same.append(plate_integral([triangle * [1, 1, -1]], half, side=side)[0])
        np.testing.assert_allclose(same, value, rtol=3e-14)


def test_the_integral_scales_like_a_length():
    for (triangle, half, side), _ in _cases(100, 6):
        value = plate_integral([triangle], half, side=side)[0]
        assert plate_integral([triangle * 1024.0], half * 1024.0, side=side)[0] == 1024.0 * value
        assert plate_integral([triangle * 1e-3], half * 1e-3, side=side)[0] == pytest.approx(1e-3 * value, rel=1e-12)


def test_pieces_of_a_triangle_add_up_to_it():
    for (triangle, half, side), rng in _cases(200, 7, ("random", "spans_all", "crosses_plane")):
        a, b, c = triangle
        s, t, r = rng.uniform(0.05, 0.95, 3)
        d, e, f = a + s * (b - a), b + t * (c - b), c + r * (a - c)
        pieces = [[a, d, f], [d, b, e], [f, e, c], [d, e, f]]
        value = plate_integral([triangle], half, side=side)[0]
        assert plate_integral(pieces, half, side=side).sum() == pytest.approx(value, rel=1e-12)


def test_no_jump_across_a_border_of_the_regions():
    half = np.array([0.05, 0.03])
    triangle = np.array([[-0.02, -0.01, 0.04], [0.03, 0.0, 0.06], [0.0, 0.02, 0.05]])
    size = np.abs(triangle).max()
    for axis in range(2):
        for corner in range(3):
            start = triangle.copy()
            start[:, axis] += half[axis] - triangle[corner, axis]
            steps = np.arange(-20, 21)[:, None, None] * 1e-9 * np.eye(3)[axis]
            values = plate_integral(start + steps, half)
            assert (np.abs(np.diff(values)) <= values.max() * 1e-9 / (0.04 - 1e-7) + 1e-15 * size).all()
            assert np.abs(np.diff(values, 3)).max() <= 1e-13 * values.max()


def test_readings_grow_steadily_towards_contact_and_are_finite_until_then():
    half = np.array([0.05, 0.03])
    flat = np.array([[-0.2, -0.2, 0.0], [0.2, -0.2, 0.0], [0.0, 0.3, 0.0]])
    tilted = flat + np.array([[0, 0, 0.0], [0, 0, 0.1], [0, 0, 0.2]])
    beside = np.array([[0.05, -0.02, 0.0], [0.05, 0.02, 0.0], [0.2, 0.0, 0.1]])
    heights = 10.0 ** np.arange(-1, -13, -1.0)
    for triangle, step in ((flat, [0, 0, 1]), (tilted, [0, 0, 1]), (beside, [1, 0, 0])):
        for side in ("front", "both"):
            values = plate_integral(triangle + heights[:, None, None] * step, half, side=side)
            assert np.isfinite(values).all()
            assert (np.diff(values) > 0).all()
            assert (values > 0).all()


def test_a_triangle_ten_thousand_million_times_the_plate_s_width():
    triangle = [
        [3866.28363973647, -813.208289399121, 3.612673137612748e-08],
        [-2797.2694129260103, 1513.738078166924, 3.612673137612748e-08],
        [-4423.742545741093, -2125.132694310842, 3.612673137612748e-08],
    ]
    value = plate_integral([triangle], [9.42971301038413e-07, 0.00955917212993031])[0]
    assert value == pytest.approx(11179.709433044732101, rel=1e-14)


def test_midpoint_converges_to_exact_with_second_order():
    rng = np.random.default_rng(2)
    triangles, halves = zip(*[plate_cases.case("random", rng)[:2] for _ in range(20)], strict=True)
    errors = []
    for splits in range(2, 7):
        pairs = [
            (plate_integral([t], h, method="midpoint", splits=splits)[0], plate_integral([t], h)[0])
            for t, h in zip(triangles, halves, strict=True)
        ]
        errors.append(np.median([abs(m - e) / e for m, e in pairs]))
    orders = -np.diff(np.log2(errors))
    assert ((orders > 1.5) & (orders < 2.5)).all()


def test_midpoint_takes_region_and_side_at_the_centroid():
    triangle = np.array([[0.0, 0.0, -0.1], [0.3, 0.0, 0.2], [0.0, 0.3, 0.2]])
    centroid, area = triangle.mean(axis=0), 0.5 * np.linalg.norm(np.cross(*(triangle[1:] - triangle[0])))
    distance = np.linalg.norm([centroid[0] - 0.01, centroid[1] - 0.02, centroid[2]])
    shifted = plate_integral([triangle], [0.01, 0.02], method="midpoint", splits=0)
    assert shifted[0] == pytest.approx(area / distance, rel=1e-14)
    assert plate_integral([triangle - [0, 0, 0.15]], [0.01, 0.02], method="midpoint", splits=0)[0] == 0.0


@pytest.mark.parametrize(
    ("changes", "name"),
    [
        ({"triangles": np.zeros((3, 3))}, "triangles"),
        ({"triangles": np.full((1, 3, 3), np.nan)}, "triangles"),
        ({"half_size": [0.1]}, "half_size"),
        ({"half_size": [0.1, 0.0]}, "half_size"),
        ({"half_size": [0.1, np.inf]}, "half_size"),
        ({"side": "back"}, "side"),
        ({"method": "tree"}, "method"),
        ({"method": "midpoint", "splits": 13}, "splits"),
        ({"method": "midpoint", "splits": 1.5}, "splits"),
        ({"splits": -3}, "splits"),
        ({"splits": None}, "splits"),
        ({"triangles": "abc"}, "triangles"),
        ({"triangles": None}, "triangles"),
        ({"triangles": {}}, "triangles"),
        ({"triangles": [[[1.0, 2.0], [3.0]]]}, "triangles"),
        ({"triangles": np.eye(3)[None] * 1j}, "triangles"),
        ({"half_size": "ab"}, "half_size"),
        ({"half_size": None}, "half_size"),
        ({"half_size": [[1.0], [1.0, 2.0]]}, "half_size"),
        ({"half_size": np.ones(2) * 1j}, "half_size"),
        ({"side": []}, "side"),
        ({"side": np.array(["front", "both"])}, "side"),
        ({"method": None}, "method"),
    ],
)
def test_bad_arguments_are_named(changes, name):
    arguments = {"triangles": np.eye(3)[None], "half_size": [0.1, 0.1], **changes}
    with pytest.raises(InvalidValue) as error:
        plate_integral(arguments.pop("triangles"), arguments.pop("half_size"), **arguments)
    assert error.value.name == name


def test_no_triangles_give_no_integrals():
    assert plate_integral(np.empty((0, 3, 3)), [0.1, 0.1]).shape == (0,)
    assert plate_integral([], [0.1, 0.1]).shape == (0,)


def test_the_smallest_numbers_give_an_integral_all_the_same():
    triangle = [[-0.1, -0.05, 0.1], [0.05, -0.02, 1e-310], [0.02, 0.2, 0.0]]
    for z, expected in ((1e-310, 288.32912520191394), (1e-307, 285.5298133067497)):
        triangle[1][2] = z
        for side in ("front", "both"):
            assert plate_integral([triangle], [0.5, 0.5], side=side)[0] == pytest.approx(expected, rel=1e-14)
    triangle[1][2] = 5e-324
    assert 288.4 < plate_integral([triangle], [0.5, 0.5])[0] < 310.0


def test_scaling_by_any_power_of_two_scales_the_integral():
    for (triangle, half, side), _ in _cases(60, 9):
        value = plate_integral([triangle], half, side=side)[0]
        for exponent in (-900, -530, -60, 60, 200):
            factor = 2.0**exponent
            if (np.abs(triangle[triangle != 0.0]) * factor > 1e-290).all():
                assert plate_integral([triangle * factor], half * factor, side=side)[0] == factor * value
                midpoint = plate_integral([triangle], half, side=side, method="midpoint")[0]
                scaled = plate_integral([triangle * factor], half * factor, side=side, method="midpoint")[0]
                assert scaled == factor * midpoint
