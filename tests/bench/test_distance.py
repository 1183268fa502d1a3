"""The distance benchmark, small."""

import importlib.util
import math

import numpy as np
import pytest

from replay.bench import distance
from replay.bench.cone_truth import SAMPLES, nearest_in_cone
from replay.bench.inputs import box_surface, torus
from replay.geometry.solid import signed_volume

pytestmark = pytest.mark.compiled  # it measures them


def test_every_method_on_a_small_torus():
    rows = distance.on_mesh("torus", torus(400), queries=6, counts=(1, 61), rounds=1)
    found = {row.method: row for row in rows}
    assert set(found) == {"exact", "thesis", "own, 1 rays", "own, 61 rays", "embree, 1 rays", "embree, 61 rays"}
    exact = found["exact"]
    assert exact.wrong == 0
    assert exact.worst_error <= 1e-13
    assert found["own, 61 rays"].worst_error > 1e-6
    assert found["own, 61 rays"].wrong == 0


def test_too_near_is_wrong_and_not_seen_is_missed():
    truth = np.array([1.0, 1.0, 1.0])
    rays = distance.judge(np.array([1.1, math.inf, 0.9]), truth, exact=False)
    assert (rays.wrong, rays.missed) == (1, 1)
    exact = distance.judge(np.array([1.0, math.inf, 1.0 + 1e-6]), truth, exact=True)
    assert exact.wrong == 2
    assert distance.judge(np.array([math.nan]), truth[:1], exact=False).failed


def test_the_reference_knows_a_plane_a_border_and_an_edge():
    up = np.array([0.0, 0.0, 1.0])
    half = math.radians(15.0)
    square = np.array([[[-9.0, -9.0, 2.0], [9.0, -9.0, 2.0], [0.0, 9.0, 2.0]]])
    assert nearest_in_cone(square, np.zeros(3), up, 2.0 * half) == 2.0
    slope = np.array([[[-50.0, -50.0, -48.0], [50.0, -50.0, -48.0], [0.0, 50.0, 52.0]]])  # z = 2 + y
    border = 2.0 / (math.cos(half) + math.sin(half))
    assert nearest_in_cone(slope, np.zeros(3), up, 2.0 * half) == pytest.approx(border, rel=1e-15)
    half_turn, sample = math.pi, 2.0 * math.pi / SAMPLES
    for turn in (0.3, *(half_turn + share * sample for share in (-0.7, -0.5, -0.3, 0.3, 0.5, 0.7))):
        c, s = math.cos(turn), math.sin(turn)
        turned = slope @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        assert nearest_in_cone(turned, np.zeros(3), up, 2.0 * half) == pytest.approx(border, rel=1e-14)
    aside = square + np.array([100.0, 0.0, 0.0])
    assert nearest_in_cone(aside, np.zeros(3), up, 2.0 * half) == math.inf


def test_a_missing_phantom_is_said(monkeypatch):
    monkeypatch.setattr(importlib.util, "find_spec", lambda _: None)
    report = distance.run(quick=True, rounds=1, meshes=("phantom, 26 756 triangles",))
    (row,) = report.tables["phantom, 26 756 triangles"]
    assert "pyskindose" in row.note
    assert [(goal.key, goal.verdict) for goal in report.goals] == [
        ("cone.speed", "not measured"),
        ("cone.error", "not measured"),
    ]


def test_bodies_are_closed_and_outside_out():
    assert signed_volume(box_surface((0.6, 0.5, 0.4))) == pytest.approx(0.12)
    assert signed_volume(torus(20_000)) == pytest.approx(2.0 * math.pi**2 * 0.5 * 0.2**2, rel=1e-2)
