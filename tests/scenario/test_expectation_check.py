"""Expectations followed over blocks of results."""

import numpy as np
import pytest

from replay.collision.columns import CollisionColumns, Level
from replay.scenario.expectation_check import ExpectationCheck, matching_pairs
from replay.scenario.layout import Layout
from replay.scenario.load import load_sources
from replay.sensing.capacitive.columns import CapacitiveColumns
from replay.sensing.distance.columns import Detection, DistanceColumns

PAIRS = ("arm/bar|body/skin", "arm/hand|body/skin", "arm/hand|table/top")
LAYOUT = Layout(links=("arm", "body", "table"), pairs=PAIRS, sensors={"distance": ("eye",), "capacitive": ("guard",)})
SCENARIO = """version: 1
name: a
rate: 10
duration: 1
links:
  arm: {{shapes: {{bar: {{type: cube, size: 1}}, hand: {{type: cube, size: 1}}}}}}
  body: {{shapes: {{skin: {{type: cube, size: 1}}}}}}
  table: {{shapes: {{top: {{type: cube, size: 1}}}}}}
sensors:
  distance: {{eye: {{link: arm, aperture: 1}}}}
  capacitive: {{guard: {{link: arm, plates: {{p: {{size: [1, 1]}}}}, coupling: 1 pF}}}}
expect: [{}]
"""
TIMES = np.arange(10) * 100_000_000
C, B, X = Level.CLEAR, Level.BOUNDS, Level.CONTACT
LEVELS = np.array(
    [[C, C, C, B, B, X, X, B, C, C], [C, C, C, C, C, C, B, B, C, C], [B] * 10],
    dtype=np.uint8,
).T
CLEARANCE = np.array([[np.nan, np.nan, 0.04, 0.03, 0.01, 0, 0, 0.02, 0.04, np.nan], [np.nan] * 10, [0.02] * 10]).T


def outcomes(expectation, *, block=10, clearance="near", margin=0.05):
    scenario = load_sources("f.yaml", {"f.yaml": SCENARIO.format(expectation).encode()})
    check = ExpectationCheck(
        scenario.expect, LAYOUT, clearance=clearance, margin=margin, provenance=scenario.provenance
    )
    distance = np.array([np.nan, np.nan, 0.9, 0.5, 0.3, 0.2, 0.2, 0.4, 0.8, np.nan])[:, None]
    status = np.where(np.isnan(distance), Detection.NOTHING, Detection.DETECTED).astype(np.uint8)
    status[5:7] = Detection.TOO_CLOSE
    output = np.array([2.4, 2.4, 2.3, 2.0, 1.5, 0.0, 0.0, 1.0, 2.0, 2.4])[:, None]
    never = np.zeros((10, 3), dtype=bool)
    none = np.full((10, 1), np.nan)
    for begin in range(0, 10, block):
        part = slice(begin, begin + block)
        check.update(
            TIMES[part],
            CollisionColumns(LEVELS[part], CLEARANCE[part], ~np.isnan(CLEARANCE[part]), never[part]),
            {
                "distance": DistanceColumns(status[part], distance[part], none, none, none, none, none, none),
                "capacitive": CapacitiveColumns(none, output[part], none, output[part] == 0.0, none, none),
            },
        )
    return check.finish()


@pytest.mark.parametrize("block", [1, 3, 10])
@pytest.mark.parametrize(
    ("expectation", "passed", "detail"),
    [
        ("{pair: [arm, body], contact: never}", False, "contact in 2 of 10 frames, @ first at 0.5 s"),
        ("{pair: [body, arm/hand], contact: never}", True, "contact in 0 of 10 frames"),
        ("{pair: ['b*', 'a*'], contact: sometimes}", True, "contact in 2 of 10 frames, @ first at 0.5 s"),
        ("{pair: [arm, body], contact: always}", False, "contact in 2 of 10 frames, first not at 0 s"),
        ("{pair: [arm, table], contact: sometimes}", False, "contact in 0 of 10 frames"),
        ("{pair: [arm, body], contact: {between: [0.5 s, 0.7 s]}}", True, "contact of @ begins at 0.5 s"),
        ("{pair: [arm, body], contact: {between: [0.6 s, 0.7 s]}}", False, "contact of @ begins at 0.5 s"),
        ("{pair: [arm, body], contact: {between: [0.3 s, 0.5 s]}}", True, "contact of @ begins at 0.5 s"),
        ("{pair: [arm, body], contact: {between: [0.5 s, 0.5 s]}}", True, "contact of @ begins at 0.5 s"),
        ("{pair: [arm, body], contact: {between: [0.3 s, 0.499999999 s]}}", False, "contact of @ begins at 0.5 s"),
        ("{pair: [arm, body], contact: {between: [0.500000001 s, 1 s]}}", False, "contact of @ begins at 0.5 s"),
        ("{pair: [arm, body], contact: {between: [0, 0.4]}}", False, "contact of @ begins at 0.5 s"),
        ("{pair: [arm, table], contact: {between: [0, 1]}}", False, "contact in no frame"),
        ("{pair: [arm, table], bounds: always}", True, "bounds meet in 10 of 10 frames"),
        ("{pair: [arm, body], bounds: never}", False, "bounds meet in 5 of 10 frames, @ first at 0.3 s"),
        ("{pair: [arm, body], clearance: {min: 1 cm}}", False, "smallest clearance 0 m of @ at 0.5 s"),
        ("{pair: [arm, table], clearance: {min: 2 cm}}", True, "smallest clearance 0.02 m of # at 0 s"),
        ("{pair: [arm/hand, body], clearance: {min: 5 cm}}", True, "no clearance"),
        ("{distance: eye, min: 20 cm}", True, "smallest distance 0.2 m at 0.5 s"),
        ("{distance: eye, min: 21 cm}", False, "smallest distance 0.2 m at 0.5 s"),
        ("{distance: eye, max: 80 cm}", False, "largest distance 0.9 m at 0.2 s"),
        ("{distance: eye, detected: always}", False, "detected in 7 of 10 frames, first not at 0 s"),
        ("{capacitive: guard, output: {min: 0.5 V}}", False, "smallest output 0 V at 0.5 s"),
        ("{capacitive: guard, output: {max: 2.5 V}}", True, "largest output 2.4 V at 0 s"),
        ("{capacitive: guard, saturated: never}", False, "saturated in 2 of 10 frames, first at 0.5 s"),
    ],
)  # fmt: skip
def test_an_expectation_is_judged_by_values_and_times_whatever_the_blocks(block, expectation, passed, detail):
    (outcome,) = outcomes(expectation, block=block)
    assert (outcome.passed, outcome.detail) == (
        passed,
        detail.replace("@", "arm/bar | body/skin").replace("#", "arm/hand | table/top"),
    )
    assert str(outcome.place).startswith("f.yaml:12:")


def test_each_line_of_an_expectation_has_its_own_outcome():
    found = outcomes("{pair: [arm, body], contact: sometimes, bounds: never, clearance: {min: 1 cm}}")
    assert [(outcome.expectation, outcome.passed) for outcome in found] == [
        ("arm | body: contact sometimes", True),
        ("arm | body: bounds never", False),
        ("arm | body: clearance >= 0.01 m", False),
    ]


def test_a_clearance_that_was_not_computed_holds_nothing():
    text = "{pair: [arm/hand, body], clearance: {min: 1 cm}}"
    (outcome,) = outcomes(text, clearance="never")
    assert not outcome.passed
    assert outcome.detail == "no clearance, clearance not computed in 10 frames (model.collision.clearance)"
    (outcome,) = outcomes("{pair: [arm, body], clearance: {min: 5 cm}}", margin=0.01)
    assert not outcome.passed and "smallest clearance 0 m of arm/bar | body/skin at 0.5 s" in outcome.detail


def test_patterns_match_the_two_sides_of_a_pair_either_way_round():
    assert matching_pairs(PAIRS, ("*hand", "body")).tolist() == [1]
    assert matching_pairs(PAIRS, ("body", "*hand")).tolist() == [1]
    assert matching_pairs(PAIRS, ("*", "*")).tolist() == [0, 1, 2]
    assert matching_pairs(PAIRS, ("body", "table")).tolist() == []
