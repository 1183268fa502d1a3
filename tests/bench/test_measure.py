"""Timing, verdicts and the report."""

import json
import math

import numpy as np
import pytest

from replay.bench import goals, results
from replay.bench.goals import PROMISES, Goal, advantage
from replay.bench.measure import Check, Contender, Row, absent, compete, exponent
from replay.bench.report import Grid, LogLogPlot, Report, pareto_front, pareto_plot


def contender(name, *, answer=1.0, work=0):
    def run():
        return sum(range(work)) * 0.0 + answer

    return Contender(name, run, 10, lambda found: Check(abs(found - 1.0), 10 * int(found != 1.0), 0.0))


def test_a_wrong_contender_is_reported_as_failed_never_as_fast():
    rows = compete("case", [contender("slow", work=100_000), contender("liar", answer=2.0)], rounds=3)
    slow, liar = rows
    assert (slow.failed, liar.failed, liar.wrong) == (False, True, 10)
    assert 0.0 < slow.low <= slow.median <= slow.high
    goal = advantage("cone.speed", rows, ["case"], "slow", "liar")
    assert goal.measured > 10.0
    assert goal.verdict == "wrong"
    assert goal.failed
    report = Report("test", tables={"table": rows}, plots=[pareto_plot("plot", rows, "error")])
    assert "FAILED: wrong answers" in report.as_text()
    assert list(report.plots[0].lines) == ["slow"]


def test_a_method_that_missed_something_is_crossed_where_it_stands():
    def row(method, seconds, error, missed=0, **more):
        return Row(
            "case", method, seconds, seconds, seconds, 1, error, 0, 10, missed=missed, **{"failed": False, **more}
        )

    rows = [row("rays", 1.0, 1e-2, missed=3), row("rays", 4.0, 1e-3), row("exact", 2.0, 1e-12)]
    rows += [row("broken", 3.0, 1e-1, missed=1, failed=True)]
    plot = pareto_plot("plot", rows, "error", {"exact": "ours"})
    assert plot.lines == {"rays": [(1.0, 1e-2), (4.0, 1e-3)], "ours": [(2.0, 1e-12)]}
    assert plot.crossed == [(1.0, 1e-2)]


def test_an_error_that_is_no_number_fails():
    row = compete("case", [Contender("nan", lambda: None, 1, lambda _: Check(math.nan))], rounds=1)[0]
    assert row.failed


def test_an_advantage_is_of_fastest_rounds_the_least_over_cases_and_needs_both():
    rows = compete("case", [contender("slow", work=200_000), contender("fast")], rounds=3)
    other = compete("other", [contender("slow", work=100_000), contender("fast")], rounds=3)
    ratio = rows[0].low / rows[1].low
    assert advantage("cone.speed", rows, ["case"], "slow", "fast") == Goal("cone.speed", ratio)
    both = advantage("cone.speed", rows + other, ["case", "other"], "slow", "fast").measured
    assert both == min(ratio, other[0].low / other[1].low) > 1.0
    alone = [rows[0], absent("case", "fast", "not installed")]
    for several, cases in ((alone, ["case"]), (rows, ["case", "another"]), (rows, [])):
        assert advantage("cone.speed", several, cases, "slow", "fast").verdict == "not measured"
    wrong = compete("case", [contender("liar", answer=2.0)], rounds=1)
    assert advantage("cone.speed", wrong, ["case"], "slow", "liar").verdict == "wrong"


@pytest.mark.parametrize(("measured", "verdict"), [(10.0, "met"), (9.9, "missed"), (math.nan, "not measured")])
def test_goals(measured, verdict):
    goal = Goal("cone.speed", measured)
    assert (goal.verdict, goal.failed) == (verdict, verdict == "missed")


def test_goal_from_above():
    assert Goal("stability", 0.0).verdict == "met"
    assert Goal("stability", 1.0).verdict == "missed"
    assert Goal("stability", 0.0, wrong=True).verdict == "wrong"


def test_goals_stand_in_the_order_of_the_promises():
    several = [Goal("stability", 0.0), Goal("gjk.coal", 4.0), Goal("gjk.fcl", 3.0)]
    assert [goal.key for goal in goals.in_order(several)] == ["gjk.fcl", "gjk.coal", "stability"]
    assert PROMISES["motion.fcl"].target == ">= 10 x (stretch 30)"
    assert PROMISES["diff.memory"].target == "<= 1024 MiB"


def test_exponent_of_a_power_law():
    assert exponent([(n, 3.0 * n**1.5) for n in (10.0, 100.0, 1000.0)]) == pytest.approx(1.5)
    assert math.isnan(exponent([(1.0, 1.0)]))


def test_pareto_front_keeps_what_no_other_beats():
    points = [(1.0, 5.0), (2.0, 5.0), (3.0, 1.0), (4.0, 2.0), (0.5, 9.0)]
    assert pareto_front(points) == [(0.5, 9.0), (1.0, 5.0), (3.0, 1.0)]


def test_report_as_json_and_as_a_page_that_needs_no_other_file(tmp_path):
    rows = [*compete("case", [contender("ours")], rounds=1), absent("case", "peer", "not installed")]
    report = Report(
        "test",
        tables={"table <1>": rows},
        grids={"grid": Grid([{"a": 1, "b": "x"}])},
        goals=[Goal("cone.speed", math.nan), Goal("gjk.fcl", 4.0)],
        plots=[
            LogLogPlot(
                "cost", "n", "s", {"ours": [(1.0, 0.0), (10.0, 1e-3)]}, joined=True, front=True, crossed=[(1.0, 0.0)]
            ),
            pareto_plot("empty", [], "error", headline=True),
        ],
        notes=["a note"],
    )
    data, page, picture = results.write([report, Report("second")], tmp_path / "new")
    found = json.loads(data.read_text())
    assert set(found) == {"machine", "goals", "benchmarks"}
    assert set(found["benchmarks"]) == {"test", "second"}
    assert set(found["benchmarks"]["test"]) == {"said", "seconds", "tables", "grids", "goals", "notes"}
    ours, peer = found["benchmarks"]["test"]["tables"]["table <1>"]
    assert ours["median"] > 0.0
    assert (peer["median"], peer["note"]) == (None, "not installed")
    assert [(goal["key"], goal["verdict"]) for goal in found["goals"]] == [
        ("gjk.fcl", "met"),
        ("cone.speed", "not measured"),
    ]
    assert found["goals"][1]["measured"] is None
    assert "numpy" in found["machine"]["packages"]
    assert picture.read_bytes().startswith(b"\x89PNG")
    html = page.read_text()
    assert "table &lt;1&gt;" in html
    assert html.index("not measured") < html.index("table &lt;1&gt;")  # the goals come first
    assert html.count("data:image/png;base64,") == 2
    assert "http" not in html.replace("http-equiv", "")
    assert "not installed" in report.as_text()
    assert results.as_text([report]).rstrip().endswith("not measured")
    assert np.isfinite(ours["worst_error"])
