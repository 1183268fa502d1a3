"""Suggested rules: the tightest tolerances that would pass, marked for a person to review."""

from pathlib import Path

import pytest

from replay.comparison.difference import DiffVerdict
from replay.comparison.rules import Rule, Rules, Tolerance
from replay.comparison.rules_file import read_rules
from replay.comparison.runs import Case, RecordingPair, RunDifference, Unreadable, diff_pair
from replay.comparison.suggest import MARK, round_up, suggest
from tests.comparison import made_up
from tests.comparison.changed import BASELINE, change, compared


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        (1.0, "1.0e+0"),
        (1.01, "1.1e+0"),
        (0.0999, "1.0e-1"),
        (5e-324, "5.0e-324"),
        (2.775e-17, "2.8e-17"),
        (99.1, "1.0e+2"),
    ],
)
def test_tolerances_are_rounded_up_to_two_digits(value, expected):
    assert round_up(value) == expected
    assert float(round_up(value)) >= value


def test_suggested_rules_pass_and_no_tighter_ones_do(tmp_path):
    def calm(recording):
        change(recording)
        recording.distance.distance[20, 0] = BASELINE.distance.distance[20, 0]

    pair = RecordingPair(BASELINE, made_up.altered(BASELINE, calm))
    found = RunDifference("a", "b", (Case("made_up", Path("a"), Path("b"), diff_pair(pair, rules=None)),))
    path = tmp_path / "rules.yaml"
    path.write_text(suggest(found), encoding="utf-8")
    rules = read_rules(path)
    assert len(rules.active) == 4  # both state signals need two frames and share a rule
    assert all(rule.reason.startswith(MARK) for rule in rules.active)
    assert diff_pair(pair, rules=rules).verdict is DiffVerdict.SAME
    for k, rule in enumerate(rules.active):
        tolerance = rule.tolerance
        tighter = Tolerance(abs=tolerance.abs * 0.9, frames=max(0, tolerance.frames - 1))
        others = [*rules.active[:k], Rule(rule.signals, tighter, "tighter"), *rules.active[k + 1 :]]
        assert diff_pair(pair, rules=Rules(tuple(others))).verdict is DiffVerdict.DIFFERENT


def test_what_a_present_rule_says_of_nan_and_zero_is_kept():
    def calm(recording):
        recording.joint_positions[20, 0] += 1e-3

    rule = Rule(("/joint_states/position/lift",), Tolerance(abs=1e-9, nan="fail", zero="signed"), "as it is")
    pair = RecordingPair(BASELINE, made_up.altered(BASELINE, calm))
    for rules, kept in ((Rules((rule,)), ["nan: fail", "zero: signed"]), (None, [])):
        found = RunDifference("a", "b", (Case("made_up", Path("a"), Path("b"), diff_pair(pair, rules=rules)),))
        lines = [line.strip() for line in suggest(found).splitlines()]
        assert [line for line in lines if line.startswith(("nan:", "zero:"))] == kept


def test_what_no_tolerance_accepts_is_a_comment(tmp_path):
    found, _ = compared()
    path = tmp_path / "rules.yaml"
    path.write_text(suggest(found), encoding="utf-8")
    comments = [line for line in path.read_text().splitlines() if line.startswith("#   ")]
    assert [line.split(":")[0] for line in comments] == ['#   "/distance/left/distance', '#   "made_up']
    remaining, _ = compared(rules=read_rules(path))
    assert [item.signal.full_name for item in remaining.cases[0].difference.deciding] == ["/distance/left/distance"]


@pytest.mark.parametrize("accepted", [False, True])
def test_frames_that_only_one_run_has_are_a_comment_unless_a_rule_accepts_them(accepted):
    rules = Rules((Rule(("/frames",), Tolerance(ignore=True), "shorter"),)) if accepted else None
    pair = RecordingPair(BASELINE, made_up.only_frames(BASELINE, slice(0, 98)))
    found = RunDifference("a", "b", (Case("made_up", Path("a"), Path("b"), diff_pair(pair, rules=rules)),))
    lines = [line for line in suggest(found).splitlines() if "missing in the candidate" in line]
    assert len(lines) == (0 if accepted else 1)
    assert all(line.startswith('#   "made_up: 2 frames missing') for line in lines)


def test_what_cannot_be_compared_is_a_comment():
    """A scenario that nobody could read, and those of one run only, but for such as rules leave out."""
    found = RunDifference(
        "a",
        "b",
        (),
        missing=("gone", "left"),
        extra=("new",),
        unreadable=(Unreadable("cut", Path("a"), Path("b"), "b/cut/cut.mcap: damaged: its end is missing"),),
        ignored=("left",),
    )
    assert [line for line in suggest(found).splitlines() if line.startswith("#   ")] == [
        '#   "scenario cut: b/cut/cut.mcap: damaged: its end is missing"',
        '#   "scenario gone: in one run only"',
        '#   "scenario new: in one run only"',
    ]
