"""Numbers of nights: kept, read again, told as tables, sparklines and a page."""

import json
import re

import pyarrow.parquet as pq
import pytest

from replay.batch.history import Night, Past, append_night, nights
from replay.batch.sparkline import sparkline
from replay.batch.trend import read_trend, table
from replay.cli.exit_codes import ExitCode
from replay.cli.main import run
from replay.scenario.measures import COLUMNS
from tests.batch import scenes
from tests.cli.nights import night


@pytest.mark.parametrize(
    ("values", "bars"),
    [
        ([], ""),
        ([None, None], ""),
        ([1.0, 2.0, None, 8.0], "▁▂·█"),
        ([0.5, 0.5, 0.5 + 1e-9], "▄▄▄"),
        ([0.0, 0.0], "▄▄"),
        ([-1.0, 1.0], "▁█"),
        ([1.7e308, -1.7e308], "█▁"),
    ],
)
def test_sparklines(values, bars):
    assert sparkline(values) == bars


def written(path):
    for day, (value, accepted, failing) in enumerate([(0.021, "a", ()), (0.014, "a", ("s",)), (0.022, "b", ())]):
        verdicts = {"s": "different" if failing else "same", "other": "same"}
        results = {"clearance.min": {"s": value, "other": 0.5}, "contact.pairs": {"s": float(day)}}
        units = {"clearance.min": "m", "contact.pairs": ""}
        append_night(path, Night(f"day {day}", "1", verdicts, frozenset(failing), results, accepted, units))
    return path


def test_a_trend_is_a_row_for_each_number_with_the_nights_at_which_was_accepted(tmp_path):
    trend = read_trend(written(tmp_path / "h.jsonl"), measures=["clear*"], scenarios=["s"])
    assert trend.accepted == (False, False, True)
    lines = table(trend)
    assert lines[1].split() == ["s", "clearance.min", "2.1", "cm", "2.2", "cm", "1.4", "cm", "2.2", "cm", "▇▁█"]
    assert lines[1].index("█") == lines[2].index("^")


def test_trend_as_a_command_writes_json_and_a_page(tmp_path, capsys):
    path, html = written(tmp_path / "h.jsonl"), tmp_path / "t.html"
    assert run(["trend", "--history", str(path), "--format", "json", "--html", str(html)]) is ExitCode.FINE
    found = json.loads(capsys.readouterr().out)
    assert [night["failing"] for night in found["nights"]] == [[], ["s"], []]
    assert found["curves"][1] == {
        "scenario": "s",
        "name": "clearance.min",
        "unit": "m",
        "values": [0.021, 0.014, 0.022],
    }
    page = html.read_text()
    assert page.count("<svg") == 3 and page.count('class="accepted"') == 3 and page.count('class="failing"') == 2
    assert "<title>day 1: 1.4 cm</title>" in page
    assert run(["trend", "--history", str(path), "--metric", "none"]) is ExitCode.NOTHING
    assert run(["trend", "--history", str(tmp_path / "no")]) is ExitCode.INVALID


def test_a_night_without_numbers_of_an_earlier_version_is_read(tmp_path):
    path = tmp_path / "h.jsonl"
    path.write_text('{"time": "day 0", "version": "0", "failing": ["s"], "verdicts": {"s": "failed"}}\nrubbish\n')
    past = Past(nights(written(path)), "clearance.min")
    assert past.since == {}
    past = Past(nights(path, "clearance.min".__eq__), "clearance.min")
    assert past.curve("s") == [None, 0.021, 0.014, 0.022]
    assert read_trend(path, scenarios=["s"]).curves[0].values == (None, 0.021, 0.014, 0.022)


def test_results_are_the_same_in_result_json_parquet_and_history(tmp_path):
    scenes.write(tmp_path / "in", "a", distance=0.6)
    scenes.write(tmp_path / "in", "b")
    out = tmp_path / "out"
    options = ("--missing-baseline", "create", "--rrd", "none")
    assert night(tmp_path, out, *options) is ExitCode.FAILED  # a is in contact
    table = pq.read_table(out / "metrics.parquet")
    assert tuple(table.column_names) == COLUMNS
    rows = table.to_pylist()
    written = [row for name in "ab" for row in json.loads((out / name / "result.json").read_text())["results"]]
    assert rows == written
    found = {(row["scenario"], row["name"]): row for row in rows}
    touch = found["a", "expect[0].contact"]
    assert (
        touch["subject"] == "arm/rod | wall/slab" and touch["limit"] == 0.0 and touch["margin"] == -touch["value"] < 0
    )
    assert found["a", "contact.first"]["value"] == touch["time"] > 0.0
    assert found["a", "clearance.min"]["value"] == 0.0
    assert found["b", "contact.pairs"]["value"] == 0.0 and ("b", "contact.first") not in found
    assert found["b", "distance.tip.min"]["unit"] == "m" and found["b", "distance.tip.min"]["subject"] == "wall/slab"
    (line,) = (out / "history.jsonl").read_text().splitlines()
    assert json.loads(line)["results"]["clearance.min"]["a"] == 0.0
    assert night(tmp_path, out, "--resume", "--rrd", "none") is ExitCode.FAILED
    assert pq.read_table(out / "metrics.parquet").to_pylist() == rows


def test_numbers_at_the_end_of_what_numbers_are_have_a_curve_and_what_is_none_is_left_out(tmp_path, capsys):
    path, html = written(tmp_path / "h.jsonl"), tmp_path / "t.html"
    line = path.read_text().splitlines()[0]
    path.write_text("\n".join(line.replace("0.021", number) for number in ("1.7e308", "-1.7e308", "1e999", "NaN")))
    assert run(["trend", "--history", str(path), "--html", str(html)]) is ExitCode.FINE
    assert "last 2 of 2 nights" in capsys.readouterr().out
    assert not re.search(r"\b(nan|inf)\b", html.read_text())
