"""Measured curves as CSV files: a header that names columns with their units, then one row a point."""

from __future__ import annotations

import csv
import io
import math
import re
import stat
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from replay import limits
from replay.errors import CurveError
from replay.lfs_pointer import LFS_POINTER, is_lfs_pointer
from replay.numerics.arrays import Floats

_IN_BRACKETS = re.compile(r"(.*\S)\s*\[([^\]]+)\]")
_AFTER_UNDERSCORE = re.compile(r"(.+)_([A-Za-z]+)")


@dataclass(frozen=True)
class Column:
    """A column: its header (`distance_cm`, `output [V]`), what that names, and in which unit ("" if none)."""

    header: str
    name: str
    unit: str


@dataclass(frozen=True, eq=False)
class Curve:
    """One measured curve.

    Attributes:
        file: where it comes from, for messages.
        x, y: the columns.
        x_values: (n,) in the unit of x, strictly increasing.
        y_values: (n,) in the unit of y.
        lines: (n,) line in the file of each point.
    """

    file: str
    x: Column
    y: Column
    x_values: Floats
    y_values: Floats
    lines: tuple[int, ...]


def read_curve(
    path: Path, *, x: str | None = None, y: str | None = None, where: Mapping[str, str] | None = None
) -> Curve:
    """Read a curve from a CSV file.

    Lines that start with # are remarks, blank lines at the end are ignored. A column's unit ends its name after an
    underscore or in brackets: `distance_cm`, `distance [cm]`.

    Args:
        path: of the file, UTF-8 with commas.
        x, y: headers of the abscissa and of what was measured; when left out, the first column and the only other one.
        where: only the rows whose cells have these values, by header; other rows are not looked at. It picks one curve
            of a file that holds several.

    Raises:
        CurveError: with file and line: the file cannot be read; a column is not there or not unique; a cell is missing,
            not a number or not finite; x does not strictly increase; no row is left.
    """
    chosen = dict(where or {})
    rows = _rows(path)
    if not rows:
        raise CurveError(str(path), None, "is empty; the first line must name the columns, as in distance_cm,output_V")
    line, header = rows[0]
    names = [cell.strip() for cell in header]
    for name in names:
        if names.count(name) > 1:
            raise CurveError(str(path), line, f"column {name!r} is there twice")
    if all(_number(name) is not None for name in names):
        raise CurveError(str(path), line, "holds numbers; the first line must name the columns, as in distance_cm")
    for name in (*chosen, *(given for given in (x, y) if given is not None)):
        if name not in names:
            raise CurveError(str(path), line, f"has no column {name!r}; its columns are {', '.join(names)}")
    x_name, y_name = _axes(path, line, names, x, y, chosen)

    lines: list[int] = []
    x_values: list[float] = []
    y_values: list[float] = []
    for line, row in rows[1:]:
        if len(row) != len(names):
            raise CurveError(str(path), line, f"has {len(row)} values where the header names {len(names)} columns")
        cells = dict(zip(names, (cell.strip() for cell in row), strict=True))
        if not all(_same(cells[name], value) for name, value in chosen.items()):
            continue
        position = _value(path, line, x_name, cells[x_name])
        if x_values and position == x_values[-1]:
            raise CurveError(str(path), line, f"{x_name} = {position:g} is there twice, see line {lines[-1]}")
        if x_values and position < x_values[-1]:
            rule = f"{x_name} = {position:g} comes after {x_values[-1]:g}; sort the rows by rising {x_name}"
            raise CurveError(str(path), line, rule)
        lines.append(line)
        x_values.append(position)
        y_values.append(_value(path, line, y_name, cells[y_name]))
    if not lines:
        wanted = ", ".join(f"{name} = {value}" for name, value in chosen.items())
        raise CurveError(str(path), None, f"has no row with {wanted}" if chosen else "has no row below its header")
    return Curve(str(path), _column(x_name), _column(y_name), np.array(x_values), np.array(y_values), tuple(lines))


def _rows(path: Path) -> list[tuple[int, list[str]]]:
    """Return the cells of every line that is not a remark, with the line's number, up to the last one with content."""
    try:
        found = path.stat()
        if not stat.S_ISREG(found.st_mode) and not stat.S_ISDIR(found.st_mode):
            raise CurveError(str(path), None, "is a pipe or a device; curves are read from files")
        if found.st_size > limits.TEXT_LOG:
            raise CurveError(str(path), None, f"has more than {limits.TEXT_LOG} bytes")
        text = path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise CurveError(str(path), None, f"cannot be read: {error.strerror or error}") from None
    except UnicodeDecodeError as error:
        raise CurveError(str(path), None, f"is not UTF-8 text: {error.reason} at byte {error.start}") from None
    if is_lfs_pointer(text.encode()):
        raise CurveError(str(path), None, LFS_POINTER)
    lines = [(number, line) for number, line in enumerate(io.StringIO(text), 1) if not line.startswith("#")]
    while lines and not lines[-1][1].strip():
        lines.pop()
    rows = []
    for number, line in lines:
        try:
            rows.append((number, next(csv.reader([line], strict=True), [])))
        except csv.Error as error:
            raise CurveError(str(path), number, f"is not a line of comma-separated values: {error}") from None
    return rows


def _axes(
    path: Path, line: int, names: Sequence[str], x: str | None, y: str | None, chosen: Mapping[str, str]
) -> tuple[str, str]:
    free = [name for name in names if name not in chosen and name != y]
    if x is None:
        if not free:
            raise CurveError(str(path), line, "has no column left for the abscissa")
        x = free[0]
    others = [name for name in free if name != x]
    if y is None:
        if len(others) != 1:
            choice = f"; say which of {', '.join(others)} was measured" if others else " but the abscissa"
            raise CurveError(str(path), line, f"has {'several columns' if others else 'no column'}{choice}")
        y = others[0]
    if x == y:
        raise CurveError(str(path), line, f"{x} cannot be both the abscissa and what was measured")
    return x, y


def _column(header: str) -> Column:
    found = _IN_BRACKETS.fullmatch(header) or _AFTER_UNDERSCORE.fullmatch(header)
    return Column(header, *found.groups()) if found else Column(header, header, "")


def _number(text: str) -> float | None:
    """Return a cell's number, NaN and infinities too; None when it is none (Python's own `1_000` is none)."""
    try:
        return None if "_" in text else float(text)
    except ValueError:
        return None


def _same(cell: str, wanted: str) -> bool:
    number = _number(cell)
    return cell == wanted.strip() or (number is not None and number == _number(wanted.strip()))


def _value(path: Path, line: int, name: str, cell: str) -> float:
    if not cell:
        raise CurveError(str(path), line, f"{name} is missing")
    number = _number(cell)
    if number is None:
        raise CurveError(str(path), line, f"{name} = {cell[:60]!r} is not a number")
    if not math.isfinite(number):
        raise CurveError(str(path), line, f"{name} = {cell[:60]} is not finite")
    return number + 0.0
