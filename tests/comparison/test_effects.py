"""Differences as people see them: in words and numbers, the worst first, bookkeeping folded under its reading."""

import numpy as np
import pytest

from replay.comparison import quantities
from replay.comparison.effects import Severity, effects, headline
from replay.comparison.rules import Rule, Rules, Tolerance
from replay.comparison.runs import RecordingPair, diff_pair
from tests.comparison import made_up

BASELINE = made_up.recording()
PAIR = "arm/beam|stand/base"


def told(*changes, rules=None, limits=None):
    def change(recording):
        for one in changes:
            one(recording)

    pair = RecordingPair(BASELINE, made_up.altered(BASELINE, change))
    return effects(diff_pair(pair, rules=rules), limits)


def later(recording):
    recording.collision.level[40:42, 0] = 1


def gone(recording):
    recording.collision.level[40:60, 0] = 1


def new(recording):
    recording.collision.level[10:20, 1] = 2


def nearer(recording):
    column = recording.collision.clearance[:, 0]
    column[20:40] -= 0.004


def output(recording):
    recording.capacitive.output_voltage[48, 0] += 0.085
    recording.capacitive.delta_output[48, 0] -= 0.085
    recording.capacitive.capacitance[48, 0] -= 1e-13
    recording.capacitive.per_object[48, 0] -= 5e-14


def point(recording):
    recording.distance.distance[20, 1] += 1e-3
    recording.distance.point[20, 1] += 1e-3
    recording.distance.point_sensor[20, 1] += 1e-3
    recording.distance.triangle[20:25, 1] += 1
    recording.distance.case[20, 1] = 3


def undetected(recording):
    recording.distance.status[50:60, 0] = 0
    recording.distance.distance[50:60, 0] = np.nan


def triangle(recording):
    recording.distance.triangle[20:25, 1] += 1


def moves(recording):
    recording.joint_positions[10:, 1] += 0.02
    recording.link_poses[10:, :, 0, 3] += 0.01


def looked(recording):
    recording.collision.evaluated[20:22, 0] = False
    recording.collision.clearance[20:22, 0] = np.nan


def within(recording):
    recording.collision.evaluated[50:60, 1] = True
    recording.collision.clearance[50:60, 1] = 0.01


@pytest.mark.parametrize(
    ("change", "severity", "text"),
    [
        (later, Severity.CONTACT_TIME, "contact 33.3 ms later: arm/beam | stand/base"),
        (gone, Severity.CONTACT, "contact vanishes, was at 0.666667 s, until 1 s: arm/beam | stand/base"),
        (new, Severity.CONTACT, "contact appears at 0.166667 s, until 0.333333 s: arm/beam | stand/column"),
        (nearer, Severity.CLEARANCE, "clearance 2.3 -> 1.9 cm at 0.616667 s: arm/beam | stand/base"),
        (output, Severity.READING, "output +85 mV at 0.8 s: guard"),
        (point, Severity.READING, "distance +1 mm at 0.333333 s: right"),
        (undetected, Severity.READING, "status becomes nothing"),
        (triangle, Severity.BOOKKEEPING, "triangle becomes 2 33.3 ms earlier: right"),
        (moves, Severity.READING, "joint position +1.15 deg"),
        (within, Severity.CLEARANCE, "clearance comes within the margin at 0.833333 s: arm/beam | stand/column"),
        (looked, Severity.BOOKKEEPING, "evaluation of the clearance 33.3 ms later: arm/beam | stand/base"),
    ],
)
def test_an_effect_in_words(change, severity, text):
    (effect,) = told(change)
    assert effect.severity is severity
    if change is undetected:
        assert str(effect) == "detection ends at 0.833333 s: left"
    elif change is nearer:
        assert str(effect).startswith("clearance ") or str(effect).startswith("smallest clearance ")
    elif change is moves:
        assert str(effect).startswith(text) and str(effect).endswith(": turn")
    elif change is triangle:
        assert str(effect).startswith("triangle becomes")
    else:
        assert str(effect) == text


def test_a_category_changes_at_the_time_of_its_frame():
    (found,) = told(triangle)
    assert found.severity is Severity.BOOKKEEPING
    assert found.text.endswith(", at 0.333333 s"), "frame 20 at 60 Hz"
    assert found.at == pytest.approx(20 / 60, abs=1e-9)


def test_the_worst_comes_first_and_each_thing_counts_once():
    found = told(triangle, later, new, nearer, output, undetected, moves)
    assert [effect.severity for effect in found] == sorted(effect.severity for effect in found)
    subjects = [effect.subject for effect in found]
    assert subjects[:2] == ["arm/beam | stand/column", "arm/beam | stand/base"]
    assert len(found) == 6, "one for each pair, each sensor, and the motion"
    assert headline(found).endswith("arm/beam | stand/column; 4 more readings"), "a triangle is no reading"


def test_what_is_larger_in_tolerances_comes_first():
    def both(recording):
        recording.distance.distance[20, 0] += 1e-3
        recording.distance.distance[20, 1] += 2e-3

    rules = Rules((Rule(("/distance/left/*",), Tolerance(abs=1e-6), "fine"), Rule(("*",), Tolerance(abs=1e-4), "rest")))
    assert [effect.subject for effect in told(both, rules=rules)] == ["left", "right"]
    assert [effect.subject for effect in told(both)] == ["right", "left"]


def test_a_clearance_is_told_with_its_limit():
    def smallest(recording):
        recording.collision.level[40:60, 0] = 1
        recording.collision.clearance[40:60, 0] = 0.014

    def before(recording):
        recording.collision.level[40:60, 0] = 1
        recording.collision.clearance[40:60, 0] = 0.018

    a, b = made_up.altered(BASELINE, before), made_up.altered(BASELINE, smallest)
    (effect,) = effects(diff_pair(RecordingPair(a, b), rules=None), {PAIR: 0.02})
    assert effect.severity is Severity.CLEARANCE
    assert str(effect) == "smallest clearance 1.8 -> 1.4 cm (limit 2 cm): arm/beam | stand/base"


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (0.0334, "s", "33.4 ms"),
        (0.0, "m", "0 m"),
        (1.0, "m", "1 m"),
        (0.01, "m", "1 cm"),
        (-0.0021, "m", "-2.1 mm"),
        (3.2e-13, "F", "320 fF"),
        (1e-11, "F", "10 pF"),
        (0.5235987755982988, "rad", "30 deg"),
        (1.5, "rad/s", "85.9 deg/s"),
        (0.02, "m/s", "2 cm/s"),
        (float("nan"), "m", "nan m"),
        (float("inf"), "F", "inf F"),
        (12.0, "", "12"),
        (3.0, "frames", "3 frames"),
    ],
)
def test_quantities_in_units_that_suit(value, unit, text):
    found = quantities.shown(value, unit)
    assert found.split()[0] == text.split()[0]
    assert found == text or not np.isfinite(value) or value == 0.0


def test_two_values_are_told_with_as_many_digits_as_tell_them_apart():
    assert quantities.change(0.021, 0.014, "m") == "2.1 -> 1.4 cm"
    assert quantities.change(0.5, 0.5000001, "m") == "50 -> 50.00001 cm"
    assert quantities.written(0.2, 0.21, "m") == "20 -> 21 cm"
    assert quantities.written(2.0, 1.0, "rad/s") == "2 -> 1 rad/s"
    assert quantities.written(1e-11, 1.2e-11, "F") == "10 -> 12 pF"
