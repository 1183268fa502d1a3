import datetime
import json
import re
from pathlib import Path

import jsonschema
import pytest

from replay.comparison import rules_file, wording
from replay.comparison.diff import compare
from replay.comparison.difference import DiffVerdict
from replay.comparison.rules import EXACT, Rule, Tolerance
from replay.comparison.rules_file import read_rules, schema_text
from replay.comparison.signals import groups
from replay.errors import InvalidValue, ScenarioError
from replay.language.globs import literal_glob
from replay.scenario.yaml_text import parse
from tests.comparison import made_up

ROOT = Path(__file__).parents[2]
SHIPPED = ROOT / "scenarios" / "rules.yaml"
TODAY = datetime.date(2027, 3, 31)


def written(tmp_path, text):
    path = tmp_path / "rules.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_rule_says_all_it_can(tmp_path):
    text = """
rules_version: 1
rules:
  - {signal: "/collision/*", abs: 1e-9, rel: 1, time: 20 ms, nan: fail, zero: signed, reason: r, link: "https://x/1"}
  - {signal: ["/tf/*", "*/d[ab]"], ignore: true, reason: "why", expires: 2027-03-31}
  - {signal: "/distance/*", time: 2 frames, reason: "why"}
  - {signal: "/capacitive/*", time: 0.5, bracket: 100 us, reason: "why"}
"""
    rules = read_rules(written(tmp_path, text), today=TODAY)
    assert rules.tolerance("/collision/level/a|b") == Tolerance(1e-9, 1.0, 0.02, 0, "fail", "signed")
    assert rules.rule("/collision/level/a|b").link == "https://x/1"
    assert rules.rule("/collision/level/a|b").place.endswith("rules.yaml:4:14")
    assert rules.tolerance("/x/db").ignore
    assert rules.tolerance("/x/dc") == EXACT
    assert rules.tolerance("/distance/s/status") == Tolerance(frames=2)
    assert rules.tolerance("/capacitive/s/saturated") == Tolerance(time=0.5, bracket=1e-4)


def test_the_first_rule_that_matches_counts(tmp_path):
    text = """
rules_version: 1
rules:
  - {signal: "/collision/clearance/*", abs: 1, reason: first}
  - {signal: "/collision/*", abs: 2, reason: second}
"""
    rules = read_rules(written(tmp_path, text))
    assert rules.tolerance("/collision/clearance/a/b|c/d").abs == 1.0
    assert rules.tolerance("/collision/level/a/b|c/d").abs == 2.0
    assert rules.tolerance("/Collision/level/a/b|c/d") == EXACT


def test_an_expired_rule_applies_no_longer_and_is_reported(tmp_path):
    text = """
rules_version: 1
rules:
  - {signal: "/joint_states/*", abs: 1, reason: known, expires: 2027-03-31}
  - {signal: "/tf/*", abs: 1, reason: unused, expires: 2027-01-01}
"""
    baseline = made_up.recording()

    def change(recording):
        recording.joint_positions[3, 0] += 0.5

    candidate = made_up.altered(baseline, change)
    path = written(tmp_path, text)
    found = compare(baseline, candidate, rules=read_rules(path, today=TODAY))
    assert (found.verdict, found.expired) == (DiffVerdict.SAME, ())
    found = compare(baseline, candidate, rules=read_rules(path, today=TODAY + datetime.timedelta(days=1)))
    assert found.verdict is DiffVerdict.DIFFERENT
    assert [rule.reason for rule in found.expired] == ["known"]
    with pytest.raises(InvalidValue, match="today"):
        read_rules(path)


def test_a_known_difference_is_told_as_long_as_it_is_there_and_lets_the_run_pass(tmp_path):
    text = """
rules_version: 1
rules:
  - {signal: "/tf/*", ignore: true, reason: new bearing, link: "https://example.org/7", expires: 2027-03-31}
"""
    path = written(tmp_path, text)
    rules = read_rules(path, today=TODAY)
    baseline = made_up.recording()

    def move(recording):
        recording.link_poses[5:9, 0, 2, 3] += 0.1

    found = compare(baseline, made_up.altered(baseline, move), rules=rules)
    assert found.verdict is DiffVerdict.SAME
    (item,) = found.accepted
    assert (item.signal.full_name, item.frames, item.decides) == ("/tf/translation.z/arm", 4, False)
    told = f"rule ignored ({path}:4:14), until 2027-03-31: new bearing (https://example.org/7)"
    assert wording.rule(item.rule) == told
    assert compare(baseline, made_up.recording(), rules=rules).signals == ()


@pytest.mark.parametrize(
    ("rule", "place", "message"),
    [
        ("{signal: '/x', reason: r, abz: 1}", "3:31", "unknown key; did you mean 'abs'?"),
        ("{signal: '/x', abs: 1}", "3:5", "reason is missing"),
        ("{signal: '/x', reason: '  '}", "3:28", "must say why"),
        ("{signal: '/x', reason: r, abs: -1}", "3:36", "must be a number that is not negative"),
        ("{signal: '/x', reason: r, abs: .nan}", "3:36", "must be a number"),
        ("{signal: '/x', reason: r, time: 3 m}", "3:37", "length"),
        ("{signal: '/x', reason: r, time: -1 frame}", "3:37", "whole number of frames"),
        ("{signal: '/x', reason: r, nan: same}", "3:36", "'equal' or 'fail'"),
        ("{signal: '/x', reason: r, ignore: 1}", "3:39", "must be true or false"),
        ("{signal: '/x', reason: r, expires: 2027-02-30}", "3:40", "must be a date"),
        ("{signal: collision, reason: r}", "3:14", "begin with '/'"),
        ("{signal: [], reason: r}", "3:6", "must be a pattern"),
        ("{signal: ['/x', 3], reason: r}", "3:21", "must be a pattern"),
        ("{signal: '/x', reason: r, reason: s}", "3:31", "written twice"),
        ("17", "3:5", "must be a mapping"),
    ],
)
def test_what_is_wrong_is_said_with_its_place(tmp_path, rule, place, message):
    with pytest.raises(ScenarioError) as caught:
        read_rules(written(tmp_path, f"rules_version: 1\nrules:\n  - {rule}\n"))
    (line,) = str(caught.value).splitlines()
    assert f"rules.yaml:{place}: " in line
    assert message in line


@pytest.mark.parametrize(
    "text", ["", "[]", "rules_version: 2\nrules: []", "rules_version: 1", "rules: []", "rules_version: 1\nrules: 3"]
)
def test_files_that_are_no_rules(tmp_path, text):
    with pytest.raises(ScenarioError, match=r"rules\.yaml"):
        read_rules(written(tmp_path, text))
    with pytest.raises(ScenarioError, match="does not exist"):
        read_rules(tmp_path / "none.yaml")


def test_the_schema_is_up_to_date_and_accepts_the_shipped_rules():
    schema = json.loads(schema_text())
    assert (ROOT / "schemas" / rules_file.SCHEMA_FILE).read_text(encoding="utf-8") == schema_text()
    jsonschema.Draft202012Validator.check_schema(schema)
    validator = jsonschema.Draft202012Validator(schema)
    shipped = parse(SHIPPED.read_bytes(), "rules.yaml", []).data()
    validator.validate(shipped)
    for wrong in ({"signal": "/x"}, {"signal": "x", "reason": "r"}, {"signal": "/x", "reason": "r", "abz": 1}):
        assert not validator.is_valid({"rules_version": 1, "rules": [wrong]})


def test_shipped_rules_give_every_signal_a_tolerance_with_a_reason():
    rules = read_rules(SHIPPED)
    baseline = made_up.recording()
    for group in groups(baseline):
        for signal in group.signals:
            assert rules.rule(signal.full_name) is not None, signal.full_name
    assert all(len(rule.reason.split()) >= 8 for rule in rules.active)

    def last_digits(recording):
        for column in (recording.joint_positions, recording.collision.clearance, recording.distance.distance):
            column *= 1.0 + 1e-15
        recording.capacitive.capacitance[:] *= 1.0 + 1e-6
        recording.distance.triangle[30:40] = 0
        recording.collision.level[40, 0] = 1

    def more(recording):
        recording.distance.distance[50, 0] += 1e-6

    nearly = made_up.altered(baseline, last_digits)
    assert compare(baseline, nearly, rules=rules).verdict is DiffVerdict.SAME
    assert compare(baseline, nearly).verdict is DiffVerdict.DIFFERENT
    assert compare(baseline, made_up.altered(baseline, more), rules=rules).verdict is DiffVerdict.DIFFERENT


def test_a_literal_glob_matches_its_name_alone():
    name = "/distance/what[1]*?/distance"
    exact = Rule((literal_glob(name),), EXACT, "r")
    assert exact.matches(name)
    assert not exact.matches("/distance/what1ab/distance")


def test_the_shipped_rules_are_not_taken_for_a_scenario():
    assert re.search(rb"^version\s*:", SHIPPED.read_bytes(), re.MULTILINE) is None
