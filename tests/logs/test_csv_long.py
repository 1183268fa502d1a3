"""Long tables of plain numbers say what they would say cell by cell, and are refused where they are none."""

import numpy as np
import pytest

from replay import limits
from replay.errors import RecordingError
from replay.logs.csv_long import is_long
from replay.logs.field_csv import read_columns
from replay.scenario.log_file import csv_format

PLAIN = "time,a,b,note\n" + "".join(f"{k}.{k % 10}5,{k * 0.1},{-k}e-3,{k}\n" for k in range(400))
ODD = PLAIN.replace(",0.7000000000000001,", ",nan ,").replace(",-8e-3,", ", true ,").replace(",-9e-3", ",")
STAMPED = "time,a,b,note\n0,1,2,3\n0,1,2,3\n" + PLAIN.split("\n", 1)[1].replace("0.05,", "1700000000,", 1)
FILES = {
    "plain": PLAIN,
    "words, gaps and not finite": f"{ODD}500,,inf,0\n\n501,+1.5,-Infinity,x y\n",
    "decimal commas": PLAIN.replace(",", ";").replace(".", ","),
    "a comment, then semicolons": "# of the lab\n" + PLAIN.replace(",", ";"),
    "windows": PLAIN.replace("\n", "\r\n"),
    "before a clock is there": STAMPED,
    "a line twice, and out of order": f"{PLAIN}399.95,39.900000000000006,-399e-3,399\n3.04,1,1,1\n",
    "dates": "time,a,b\n" + "".join(f"2024-05-01T12:00:{k:02}.5Z,{k},{k}\n" for k in range(60)),
    "an excerpt": f"# excerpt of x.csv, sha256 {'0' * 64}\n{PLAIN}",
}
ORIGIN = {"name": "x", "sha256": "0" * 64}


def read(text):
    return read_columns("log.csv", text.encode(), csv_format(None, None, None), ["a", "b"], 10**9)


@pytest.fixture
def long(monkeypatch):
    """Every file is a long one, of which little is the head, and few lines are read at a time."""
    monkeypatch.setattr("replay.logs.field_csv.is_long", lambda data: True)
    monkeypatch.setattr("replay.logs.csv_long._HEAD", 200)
    monkeypatch.setattr("replay.logs.csv_long._BLOCK", 500)


@pytest.mark.parametrize("kind", FILES)
def test_a_long_table_says_what_any_other_does(kind, request):
    first = read(FILES[kind])
    request.getfixturevalue("long")
    again = read(FILES[kind])
    assert (again.begin, again.left_out, again.origin) == (first.begin, first.left_out, first.origin)
    for place, one in first.series.items():
        assert again.series[place].time.tolist() == one.time.tolist()
        assert np.array_equal(again.series[place].value, one.value, equal_nan=True)
    for window in (None, (100 * 10**9, 200 * 10**9)):
        assert again.cut(window, ORIGIN) == first.cut(window, ORIGIN)


REFUSED = {
    PLAIN.replace("30.05,3.0", "30.05,3.0x"): "line 32, column 'a': '3.0x' is not a finite number",
    PLAIN.replace("30.05,3.0", "30.05,3.0\n\n").replace("40.05", "4o.05"): "is no plain table",
    PLAIN.replace("\n40.05", "\n\n4o.05"): "line 43, column 'time': '4o.05' is not a finite number",
    PLAIN.replace("30.05,3.0", '30.05,"3.0"'): "column 'a': '\"3.0\"' is not a finite number",
    PLAIN.replace("\n30.05", "\n# here it stopped\n30.05"): "no plain table, of which alone more than 10000000 cells",
    PLAIN.replace("0.05,", "o.05,", 1): "line 2, column 'time': 'o.05' is not a finite number",
    PLAIN.replace("30.05,3.0", "30.05,1e400"): "'1e400' is not a finite number",
    PLAIN.replace("30.05,3.0", "30.05,nan(1)"): "'nan(1)' is not a finite number",
    PLAIN.replace("\n30.05", "\n" + "9" * 30 + ",1,1,1\n30.05"): "is beyond 146 years",
}


@pytest.mark.parametrize("text", REFUSED)
def test_what_is_no_plain_table_is_refused_with_its_line(text, long):
    with pytest.raises(RecordingError) as told:
        read(text)
    assert REFUSED[text] in str(told.value)
    assert "\n" not in str(told.value)


@pytest.mark.parametrize(("bound", "most"), [("LONG_LOG", len(PLAIN)), ("LONG_CELLS", 10 * 401)])
def test_long_tables_have_bounds_of_their_own(bound, most, long, monkeypatch):
    monkeypatch.setattr(limits, bound, most)
    read(PLAIN)
    monkeypatch.setattr(limits, bound, most - 1)
    with pytest.raises(RecordingError, match=str(most - 1)):
        read(PLAIN)


def test_of_what_is_no_plain_number_as_much_is_read_as_of_any_other_table(long, monkeypatch):
    monkeypatch.setattr(limits, "CELLS", 40)
    assert len(read(PLAIN).series["", "a"].time) == 400
    with pytest.raises(RecordingError, match="among some that are no plain numbers"):
        read(PLAIN.replace("e-3,", "e-3 ,"))


@pytest.mark.parametrize(("bound", "most"), [("TEXT_LOG", len(PLAIN)), ("CELLS", PLAIN.count(",") + PLAIN.count("\n"))])
def test_a_table_is_long_where_it_is_not_read_cell_by_cell(bound, most, monkeypatch):
    monkeypatch.setattr(limits, bound, most)
    assert not is_long(PLAIN.encode())
    monkeypatch.setattr(limits, bound, most - 1)
    assert is_long(PLAIN.encode())
