"""Contestants in processes of their own, and what is counted of them."""

import math

import pytest

from replay.bench import hard_sensing, stability
from replay.bench.arena import ask
from replay.bench.contestants import contestants
from tests.bench import misbehaving

pytestmark = pytest.mark.compiled  # it measures them

QUESTIONS = [{"family": "f", "number": k, "truth": 1.0 + k, "size": 1.0} for k in range(3)]


def failures(answer, patience=0.5, starting=20.0):
    return [outcome.failure for outcome in ask(answer, QUESTIONS, patience=patience, starting=starting)]


def test_a_hang_and_a_crash_are_outcomes_and_the_next_question_follows():
    assert failures(misbehaving.hangs_on_the_second) == ["", "hang", ""]
    assert failures(misbehaving.crashes_on_the_second) == ["", "crash", ""]
    assert failures(misbehaving.always_crashes) == ["crash"] * 3
    assert failures(misbehaving.refuses) == ["ValueError: not this one"] * 3


def test_counts():
    several = {
        "replay": ("", misbehaving.right),
        "wrong": ("", misbehaving.wrong),
        "no number": ("", misbehaving.no_number),
        "absent": ("a_package_nobody_has", misbehaving.right),
    }
    lines = {line["method"]: line for line in stability.examine("cones", QUESTIONS, 5.0, several)}
    assert [lines["replay"][kind] for kind in ("wrong", "NaN", "refused", "hangs", "crashes")] == [0] * 5
    assert lines["wrong"]["wrong"] == 3
    assert lines["no number"]["NaN"] == 3
    assert "not installed" in lines["absent"]["note"]


def test_ours_have_no_failure():
    for subject, questions in (
        ("cones", hard_sensing.hard_cones(3)),
        ("plates", hard_sensing.hard_plates()[::4]),
        ("boxes", hard_sensing.hard_boxes(1)),
    ):
        judge, (_, answer) = stability._JUDGES[subject], contestants(subject)["replay"]
        for question in questions:
            wrong, error = judge(question, answer(question), stability._STRICT[subject])
            assert not wrong, (question, error)


def test_invalid_input_must_be_refused():
    invalid = [q for q in stability._questions("pairs", 1) if q["family"] == stability.INVALID]
    lines = stability.examine("pairs", invalid, 20.0, {"replay": contestants("pairs")["replay"]})
    assert [(line["asked"], line["wrong"], line["refused"]) for line in lines] == [(5, 0, 0)]


def test_judges_see_what_is_wrong():
    pair = {"truth": 0.5, "meets": False, "size": 1.0}
    assert not stability._judge_pair(pair, [0.0, 0.5], 1e-12)[0]
    assert stability._judge_pair(pair, [1.0, 0.0], 1e-12)[0]
    assert stability._judge_pair(pair, [0.0, 0.6], 1e-12)[0]
    cone = {"truth": math.inf, "size": 1.0}
    assert stability._judge_cone(cone, [0.5], 1e-12)[0]
