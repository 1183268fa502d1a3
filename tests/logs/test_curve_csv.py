"""Measured curves: what is read, and every way in which a file can be wrong, with its line."""

import os
from pathlib import Path

import numpy as np
import pytest

from replay.errors import CurveError
from replay.logs.curve_csv import read_curve

HEADER = "distance_cm,delta_output_V\n"

BAD = {
    "empty file": ("", "is empty"),
    "remarks only": ("# nothing\n\n", "is empty"),
    "header only": (HEADER, "has no row below its header"),
    "no header": ("1,2\n2,3\n", ":1: holds numbers"),
    "one column": ("distance_cm\n1\n", ":1: has no column but the abscissa"),
    "column twice": ("distance_cm,distance_cm\n1,2\n", ":1: column 'distance_cm' is there twice"),
    "several columns": ("distance_cm,a_V,b_V\n1,2,3\n", ":1: has several columns; say which of a_V, b_V was measured"),
    "row too short": (HEADER + "1,2\n2\n", ":3: has 1 values where the header names 2 columns"),
    "row too long": (HEADER + "1,2,3\n", ":2: has 3 values where the header names 2 columns"),
    "row missing": (HEADER + "1,2\n\n3,1\n", ":3: has 0 values where the header names 2 columns"),
    "cell missing": (HEADER + "1,2\n2,\n", ":3: delta_output_V is missing"),
    "abscissa missing": (HEADER + " ,2\n", ":2: distance_cm is missing"),
    "no number": (HEADER + "1,2\n2,1 V\n", ":3: delta_output_V = '1 V' is not a number"),
    "Python's number": (HEADER + "1_0,2\n", ":2: distance_cm = '1_0' is not a number"),
    "NaN": (HEADER + "1,nan\n", ":2: delta_output_V = nan is not finite"),
    "infinite": (HEADER + "1,2\n-inf,2\n", ":3: distance_cm = -inf is not finite"),
    "overflow": (HEADER + "1,1e999\n", ":2: delta_output_V = 1e999 is not finite"),
    "unsorted": (HEADER + "# remark\n1,2\n3,1\n2,1\n", ":5: distance_cm = 2 comes after 3; sort the rows"),
    "duplicated": (HEADER + "1,2\n1.0,1\n", ":3: distance_cm = 1 is there twice, see line 2"),
    "open quote": (HEADER + '1,"2\n', ":2: is not a line of comma-separated values"),
}


@pytest.mark.parametrize("name", BAD)
def test_a_bad_file_is_an_error_that_names_its_line(name, tmp_path):
    content, message = BAD[name]
    path = tmp_path / "curve.csv"
    path.write_text(content)
    with pytest.raises(CurveError) as caught:
        read_curve(path)
    assert str(caught.value).startswith(str(path))
    assert message in str(caught.value)
    if message.startswith(":"):
        assert caught.value.line == int(message.split(":")[1])


def test_unreadable_files(tmp_path):
    with pytest.raises(CurveError, match="cannot be read"):
        read_curve(tmp_path / "none.csv")
    with pytest.raises(CurveError, match="cannot be read"):
        read_curve(tmp_path)
    (tmp_path / "binary.csv").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(CurveError, match="is not UTF-8"):
        read_curve(tmp_path / "binary.csv")


def test_units_stand_after_an_underscore_or_in_brackets(tmp_path):
    path = tmp_path / "curve.csv"
    path.write_bytes("\ufeff# by hand\narm angle [deg],delta_output_mV\r\n-1.5,2\r\n0,3e1\r\n\r\n".encode())
    curve = read_curve(path)
    assert (curve.x.name, curve.x.unit, curve.y.name, curve.y.unit) == ("arm angle", "deg", "delta_output", "mV")
    np.testing.assert_array_equal(curve.x_values, [-1.5, 0.0])
    np.testing.assert_array_equal(curve.y_values, [2.0, 30.0])
    assert curve.lines == (3, 4)


def test_one_of_several_curves_is_picked_by_its_cells(tmp_path):
    path = tmp_path / "curves.csv"
    path.write_text("size_cm,back,distance_cm,c_pF\n5,,1,9\n5,yes,1,8\n5.0,,2,7\n10,,x,y\n")
    curve = read_curve(path, where={"size_cm": "5", "back": ""})
    np.testing.assert_array_equal(curve.y_values, [9.0, 7.0])
    assert curve.lines == (2, 4)
    with pytest.raises(CurveError, match="has no row with size_cm = 7"):
        read_curve(path, x="distance_cm", y="c_pF", where={"size_cm": "7"})
    with pytest.raises(CurveError, match="has no column 'side'; its columns are size_cm, back"):
        read_curve(path, where={"side": "5"})
    with pytest.raises(CurveError, match="cannot be both"):
        read_curve(path, x="c_pF", y="c_pF")


@pytest.mark.skipif(os.name != "posix", reason="pipes and devices as POSIX has them")
def test_a_device_is_not_read_without_end():
    with pytest.raises(CurveError, match="is a pipe or a device"):
        read_curve(Path("/dev/zero"))
