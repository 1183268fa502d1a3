"""The reports of comparisons with the machine as files: whichever are wanted."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from replay.comparison.measured import report_html, report_junit
from replay.comparison.measured.result import MeasuredComparison
from replay.logs.part_file import write_file


def write(found: Sequence[MeasuredComparison], *, html: Path | None = None, junit: Path | None = None) -> None:
    """Write a page with drawings, and a JUnit report; WriteError when a file cannot be written."""
    if html is not None:
        write_file(html, report_html.html(found), named=True)
    if junit is not None:
        write_file(junit, report_junit.junit(found), named=True)
