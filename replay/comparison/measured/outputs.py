"""The reports of comparisons with the machine as files: whichever are wanted."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from replay.comparison.measured import report_html, report_junit
from replay.comparison.measured.overlay import write_measured
from replay.comparison.measured.result import MeasuredComparison
from replay.logs.part_file import write_file


class MeasuredOutputs:
    """Writes what shows a recording while it is there, and the other files at the end."""

    def __init__(self, *, html: Path | None = None, junit: Path | None = None, rrd: Path | None = None) -> None:
        """Choose the reports.

        Args:
            html, junit: files to write.
            rrd: a rerun recording that shows both; of several scenarios a folder, with one for each.
        """
        self._html = html
        self._junit = junit
        self._rrd = rrd

    def visit(self, recording: Path, found: MeasuredComparison, several: bool) -> None:
        """Take one scenario, alone or of several; WriteError when what shows it cannot be written."""
        if self._rrd is not None:
            file = self._rrd / f"{found.difference.name}.rrd" if several else self._rrd
            write_measured(file, recording, found)

    def write(self, found: Sequence[MeasuredComparison]) -> None:
        """Write the page with drawings and the JUnit report; WriteError when a file cannot be written."""
        if self._html is not None:
            write_file(self._html, report_html.html(found), named=True)
        if self._junit is not None:
            write_file(self._junit, report_junit.junit(found), named=True)
