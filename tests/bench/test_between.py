"""The benchmark of what lies between the frames, small."""

import json
import math

from replay.bench import between


def test_every_question_has_an_answer_and_ours_are_right():
    report = between.Report("between")
    grid = between._times(report, 4)
    assert [line["time within the bracket"] for line in grid.lines] == ["4", "4"]
    assert all(float(line["longest bracket [us]"]) <= 1.001 for line in grid.lines)
    assert [goal.verdict for goal in report.goals] == ["met"]
    peers = between._peers(3).lines
    assert len(peers) == 8
    for line in peers:
        assert sum(int(line[key]) for key in ("right", "early", "late", "missed")) == 3
    json.dumps(report.as_json(), allow_nan=False)


def test_a_scene_is_run_both_ways():
    scenario = between.shipped("carm_head_contact")
    assert not isinstance(scenario, str)
    line, asked, told, ratio = between._scene("head", scenario, scenario.rate, blocks=1, rounds=1)
    assert asked == told == int(line["clear"]) + int(line["contact"])
    assert line["undecided"] == "0"
    assert int(line["contact"]) > 0
    assert ratio > 0.0


def test_verdicts():
    assert between._verdict(math.nan, 0.5) == "missed"
    assert between._verdict(0.5 + 1e-4, 0.5) == "right"
    assert between._verdict(0.4, 0.5) == "early"
    assert between._verdict(0.6, 0.5) == "late"
