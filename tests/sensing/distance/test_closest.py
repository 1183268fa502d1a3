"""The public exact reading: hard cases, closed forms, invariances and refusals."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from replay.errors import InvalidValue
from replay.numerics import transforms
from replay.sensing.distance import closest_in_cone
from tests.amounts import cases
from tests.sensing.distance.cone_families import FAMILIES
from tests.sensing.distance.meshes import torus

CASES = json.loads((Path(__file__).parents[2] / "data" / "cone.json").read_text())["cases"]
CASE_NUMBERS = {"conic": 2}
DEG = math.pi / 180.0
SQUARE = [[[-1.0, -1.0, 2.0], [1.0, -1.0, 2.0], [0.0, 2.0, 2.0]]]


@pytest.mark.parametrize("case", CASES, ids=[f"{k}-{case.get('id', case['family'])}" for k, case in enumerate(CASES)])
def test_hard_case(case):
    hit = closest_in_cone(
        [case["triangle"]], case["apex"], case["axis"], case["aperture"], range=case.get("range", math.inf)
    )
    expect = case["expect"]
    if "distance" in expect and expect["distance"] is None:
        assert not hit.detected
    elif "distance" in expect:
        scale = np.max(np.abs(np.array(case["triangle"]) - case["apex"]))
        tolerance = 1e-11 * scale
        assert hit.detected
        assert hit.distance == pytest.approx(expect["distance"], rel=0, abs=tolerance)
        if "point" in expect:
            np.testing.assert_allclose(hit.point, expect["point"], rtol=0, atol=tolerance)
        if "case" in expect:
            assert hit.case == CASE_NUMBERS[expect["case"]]


def test_each_case_by_its_closed_form():
    wide = 60.0 * DEG
    z = [0.0, 0.0, 1.0]
    foot = closest_in_cone(SQUARE, [0, 0, 0], z, wide)
    assert (foot.case, foot.distance) == (1, 2.0)

    slope = [[[-50.0, -50.0, -48.0], [50.0, -50.0, -48.0], [0.0, 50.0, 52.0]]]  # z = y + 2, its foot is 45 deg off
    border = closest_in_cone(slope, [0, 0, 0], z, 30.0 * DEG)
    t = 2.0 / (math.cos(15 * DEG) + math.sin(15 * DEG))
    assert border.case == 2
    np.testing.assert_allclose(border.point, [0.0, -t * math.sin(15 * DEG), t * math.cos(15 * DEG)], atol=1e-15)

    shelf = [[[-9.0, 0.5, 1.0], [9.0, 0.5, 1.0], [0.0, 9.0, 1.0]]]  # its edge y = 0.5 is 26.6 deg off the axis
    edge_foot = closest_in_cone(shelf, [0, 0, 0], z, wide)
    assert edge_foot.case == 4
    np.testing.assert_allclose(edge_foot.point, [0.0, 0.5, 1.0], atol=1e-15)

    turned = [[[-9.0, 0.5, 1.0], [0.1, 0.5, 1.0], [0.2, 9.0, 1.0]]]
    ends = closest_in_cone([[[0.2, 0.5, 1.0], [9.0, 0.5, 1.0], [3.0, 9.0, 1.0]]], [0, 0, 0], z, wide)
    assert ends.case == 5
    np.testing.assert_allclose(ends.point, [0.2, 0.5, 1.0], atol=1e-15)
    assert closest_in_cone(turned, [0, 0, 0], z, wide).case == 4

    rod = [[[0.0, -9.0, 1.0], [0.0, 9.0, 3.0], [5.0, 9.0, 8.0]]]  # rises with x; z = 2 + y / 9 on its edge
    meets = closest_in_cone(rod, [0, 0, 0], z, 10.0 * DEG)
    tan = math.tan(5.0 * DEG)
    y = -2.0 * tan / (1.0 + tan / 9.0)
    assert meets.case == 3
    np.testing.assert_allclose(meets.point, [0.0, y, 2.0 + y / 9.0], atol=1e-15)


def test_nothing_is_said_in_one_way():
    for hit in (
        closest_in_cone(SQUARE, [0, 0, 0], [0, 0, -1], 1.0),
        closest_in_cone(SQUARE, [0, 0, 0], [0, 0, 1], 1.0, range=1.999),
        closest_in_cone(np.empty((0, 3, 3)), [0, 0, 0], [0, 0, 1], 1.0),
    ):
        assert (hit.detected, hit.triangle, hit.case) == (False, -1, 0)
        assert math.isnan(hit.distance)
        assert np.isnan(hit.point).all()
    assert closest_in_cone(SQUARE, [0, 0, 0], [0, 0, 1], 1.0, range=2.0).detected


def test_lowest_triangle_wins_among_equals():
    far = [[[-1.0, -1.0, 3.0], [1.0, -1.0, 3.0], [0.0, 2.0, 3.0]]]
    assert closest_in_cone(far + SQUARE + SQUARE, [0, 0, 0], [0, 0, 1], 1.0).triangle == 1


def test_full_sphere_senses_everything():
    rng = np.random.default_rng(1)
    for direction in np.vstack([rng.normal(size=(20, 3)), [[0, 0, -3.0]], [[0, 0, 2.0]]]):
        hit = closest_in_cone([[direction] * 3], [0, 0, 0], [0, 0, 1], 2.0 * math.pi)
        assert hit.distance == pytest.approx(np.linalg.norm(direction), rel=1e-15)
        rod = [[direction, 2.0 * direction, direction]]
        assert closest_in_cone(rod, [0, 0, 0], [0, 0, 1], 2.0 * math.pi).detected


def test_a_body_entirely_inside_the_cone_reads_as_without_a_cone():
    body = torus(24, 12)
    inside = closest_in_cone(body, [0.3, 0.2, -4.0], [0, 0, 1], 1.2)
    everywhere = closest_in_cone(body, [0.3, 0.2, -4.0], [0, 0, 1], 2.0 * math.pi)
    assert (inside.distance, inside.triangle) == (everywhere.distance, everywhere.triangle)


def test_half_space_is_closed():
    rod = [[[1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [2.0, 0.0, 0.0]]]
    hit = closest_in_cone(rod, [0, 0, 0], [0, 0, 1], math.pi)
    assert hit.distance == 1.0


@pytest.mark.parametrize(
    ("gap", "reading"), [(0.0, 0.0), (1e-17, 0.0), (-1e-17, 0.0), (-4e-16, 0.0), (1e-14, 1e-14), (-1e-14, None)]
)
def test_apex_on_or_just_off_a_surface(gap, reading):
    floor = np.array([[[-3.0, -3.0, gap], [3.0, -3.0, gap], [0.0, 3.0, gap]]])
    ahead = closest_in_cone(floor, [0, 0, 0], [0, 0, 1], 1.0)
    assert (ahead.distance if ahead.detected else None) == reading


def test_apex_rounded_onto_a_small_triangle_reads_zero_whichever_way_it_faces():
    rng = np.random.default_rng(8)
    for axis in rng.normal(size=(200, 3)):
        corners = 4.0 * rng.normal(size=3) + 0.3 * rng.normal(size=(3, 3))
        apex = rng.dirichlet((1.0, 1.0, 1.0)) @ corners
        assert closest_in_cone([corners], apex, axis, 0.5).distance == 0.0


def test_distance_never_grows_with_the_aperture():
    for name in ("random", "parallel", "sliver", "coplanar_apex", "corner_border", "reflex"):
        triangles, axes, _ = FAMILIES[name](np.random.default_rng(7), 25)
        for triangle, axis in zip(triangles, axes, strict=True):
            last = math.inf
            for aperture in [*np.geomspace(1e-10, 1.0, 12), *np.linspace(1.1, 2.0 * math.pi, 12)]:
                hit = closest_in_cone([triangle], [0, 0, 0], axis, aperture)
                assert hit.detected or last == math.inf
                if hit.detected:
                    assert hit.distance <= last + 1e-14 * np.max(np.abs(triangle))
                    last = hit.distance


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=cases(60), deadline=None, derandomize=True)
def test_rigid_motion_scaling_and_corner_order_change_nothing(seed):
    rng = np.random.default_rng(seed)
    triangles, axes, apertures = FAMILIES["random"](rng, 1)
    axis, aperture = axes[0], apertures[0]
    plain = closest_in_cone(triangles, [0, 0, 0], axis, aperture)

    turn = transforms.from_axis_angle(FAMILIES["random"](rng, 1)[1][0], np.array([rng.uniform(0, 6.0)]))[0]
    shift = rng.normal(size=3)
    moved = closest_in_cone(transforms.apply(turn, triangles) + shift, shift, 3.7 * (turn[:3, :3] @ axis), aperture)
    scale = math.ldexp(1.0, int(rng.integers(-900, 900)))
    scaled = closest_in_cone(triangles * scale, [0, 0, 0], axis, aperture)
    order = rng.permutation(3)
    shuffled = closest_in_cone(triangles[:, order], [0, 0, 0], axis, aperture)
    assert plain.detected == moved.detected == scaled.detected == shuffled.detected
    if plain.detected:
        extent = np.max(np.abs(triangles))
        assert moved.distance == pytest.approx(plain.distance, abs=1e-12 * extent)
        assert scaled.distance == plain.distance * scale
        np.testing.assert_array_equal(scaled.point, plain.point * scale)
        assert shuffled.distance == pytest.approx(plain.distance, abs=1e-12 * extent)
        assert moved.case == plain.case


def test_a_machine_a_thousand_kilometres_out_reads_what_its_rounded_corners_say():
    rng = np.random.default_rng(3)
    origin = np.array([1e6, -1e6, 1e6])
    for _ in range(50):
        triangle = origin + rng.normal(size=(1, 3, 3)) + [0, 0, 2.0]
        there = closest_in_cone(triangle, origin, [0, 0, 1], 0.8)
        here = closest_in_cone(triangle - origin, [0, 0, 0], [0, 0, 1], 0.8)
        assert there.detected == here.detected
        if here.detected:
            assert there.distance == here.distance


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("triangles", {"triangles": [[0.0, 0.0, 0.0]]}),
        ("triangles", {"triangles": [[[0.0, 0.0, math.nan]] * 3]}),
        ("triangles", {"triangles": "mesh"}),
        ("triangles", {"triangles": [[[1.7e308, 0.0, 0.0]] * 3], "apex": [-1.7e308, 0.0, 0.0]}),
        ("apex", {"apex": [0.0, math.inf, 0.0]}),
        ("axis", {"axis": [0.0, 0.0, 0.0]}),
        ("axis", {"axis": [0.0, 1.0]}),
        ("aperture", {"aperture": 0.0}),
        ("aperture", {"aperture": 6.3}),
        ("aperture", {"aperture": math.nan}),
        ("range", {"range": -1.0}),
        ("range", {"range": math.nan}),
    ],
)
def test_bad_input_is_refused_by_name(name, change):
    arguments = {"triangles": SQUARE, "apex": [0, 0, 0], "axis": [0, 0, 1], "aperture": 1.0, "range": 5.0} | change
    with pytest.raises(InvalidValue) as error:
        closest_in_cone(
            arguments["triangles"],
            arguments["apex"],
            arguments["axis"],
            arguments["aperture"],
            range=arguments["range"],
        )
    assert error.value.name == name
