"""Which columns of a CSV are joints, and what is told of those that are not."""

from __future__ import annotations

from fractions import Fraction

import pytest

from replay.errors import RecordingError
from replay.logs.csv_table import CsvTable, Format
from replay.logs.joint_csv import read_csv

UNITS = {"s": Fraction(10**9), "ms": Fraction(10**6)}
FORMAT = Format(None, None, UNITS)


def read(text: str, needed=("swing",), format=FORMAT, max_gap=10**9):
    return read_csv("log.csv", text.encode(), format, needed, max_gap)


@pytest.mark.parametrize("heading", ["swing", "swing position [rad]", "swing position", "swing [deg]"])
def test_a_column_is_needed_by_its_heading_or_by_the_joint_that_it_is_of(heading):
    needed = (heading,) if heading.endswith("[deg]") else ("swing",)
    log = read(f"time,{heading},other\n0,1,x\n1,2,3\n", needed)
    assert [*log.joints] == [heading] and log.joints[heading].value.tolist() == [1.0, 2.0]
    with pytest.raises(RecordingError, match=r"line 3, column '.*': 'x' is not a finite number"):
        read(f"time,{heading}\n0,1\n1,x\n", needed)


def test_any_other_column_of_numbers_is_a_joint_too_and_one_of_anything_else_is_passed_over():
    log = read("time,swing,rail,note,half\n0,1,5,a,\n1,2,6,b,0.5\n")
    assert sorted(log.joints) == ["half", "rail", "swing"]
    half = log.joints["half"]
    assert (half.time.tolist(), half.value.tolist(), half.row.tolist()) == ([10**9], [0.5], [1])


@pytest.mark.parametrize("cell", ["1_000", "inf", "nan", "1e999", "0x10", "1,5"])
def test_what_is_no_finite_number_is_told(cell):
    with pytest.raises(RecordingError, match="is not a finite number"):
        read(f"time;swing\n0;1.5\n1;{cell}\n", format=Format(None, None, UNITS, ";", "."))


def test_an_excerpt_holds_some_lines_and_the_columns_that_were_needed():
    log = read("time,rail,swing position [rad]\n0,5,1\n1,6,2\n2,7,3\n")
    made = log.cut([0, 2], {"name": "log.csv", "sha256": "a" * 64}).decode()
    lines = made.splitlines()
    assert lines[0] == f"# replay:excerpt of log.csv, sha256 {'a' * 64}" or lines[0].endswith("a" * 64)
    assert lines[1:] == ["time,swing position [rad]", "0,1", "2,3"]
    again = read(made)
    assert again.origin == {"name": "log.csv", "sha256": "a" * 64}
    assert again.joints["swing position [rad]"].value.tolist() == [1.0, 3.0]


def test_begin_end_and_anchor_are_those_of_the_samples():
    log = read("time,swing\n3,1\n3,1\n2,5\n4,2\n3.5,9\n")
    assert (log.begin, log.end, log.left_out) == (2 * 10**9, 4 * 10**9, 0)
    assert log.anchor == (0, 3, 3)  # the first line, the first that is later, the latest
    assert log.joints["swing"].row.tolist() == [0, 2, 3, 4]  # a line that is there twice is one
    assert not log.published and log.frames == {}


def test_lines_before_the_clock_was_there_are_left_out():
    log = read("time,swing\n0,9\n0,9\n1700000000,1\n1700000001,2\n")
    assert (log.left_out, log.begin) == (2, 1700000000 * 10**9)
    assert log.joints["swing"].value.tolist() == [1.0, 2.0]


@pytest.mark.parametrize(
    ("text", "format", "time"),
    [
        ("time [ms],swing\n5,1\n", FORMAT, 5 * 10**6),
        ("time,swing\n5,1\n", FORMAT, 5 * 10**9),
        ("t,swing\n5,1\n", Format("t", "ms", UNITS), 5 * 10**6),
        ("t [ms],time,swing\n5,7,1\n", Format("t [ms]", None, UNITS), 5 * 10**6),
    ],
)
def test_the_unit_of_the_times_is_that_of_the_heading_unless_it_is_stated(text, format, time):
    assert read(text, format=format).begin == time


def test_of_separators_the_first_that_gives_a_time_is_taken():
    for separator in ",;\t|":
        table = CsvTable("a", f"time{separator}b{separator}\n1{separator}2{separator}\n".encode(), FORMAT)
        assert (table.separator, table.headings, table.time) == (separator, ["time", "b"], "time")
        assert table.columns == [("1",), ("2",)] and table.lines == [2]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("a;b;c\n1;2;3\n", r"its columns are \['a', 'b', 'c'\]; name the one"),
        ("a,b\n1,2\n", r"its columns are \['a', 'b'\]; name the one"),
        ("a\tb;c\td\n", r"its columns are \['a', 'b;c', 'd'\]"),
        ("alone\n1\n", r"its columns are \['alone'\]; name the one"),
        ("alone two\n1 2\n", "separated by spaces"),
    ],
)
def test_without_a_time_the_columns_are_told_as_the_separator_of_most_of_them_gives_them(text, words):
    with pytest.raises(RecordingError, match=words):
        read(text)


def test_cells_that_are_missing_or_too_many_must_be_empty():
    assert read("time,swing,\n0,1\n1,2,,\n").joints["swing"].value.tolist() == [1.0, 2.0]
    with pytest.raises(RecordingError, match="line 3 has 4 cells, its headings are 3"):
        read("time,swing,x\n0,1,2\n1,2,3,4\n")
    with pytest.raises(RecordingError, match="line 2 has 1 cells"):
        read("time,swing\n0\n")
