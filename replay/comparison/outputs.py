"""The reports of a diff as files: HTML, JUnit and rerun overlays, whichever are wanted."""

from __future__ import annotations

from pathlib import Path

from replay.comparison import report_html, report_junit
from replay.comparison.difference import DiffVerdict
from replay.comparison.overlay import write_overlay
from replay.comparison.plots import Plot, plots
from replay.comparison.runs import Case, RecordingPair, RunDifference
from replay.logs.part_file import write_file


class Outputs:
    """Collects what reports draw while columns are in memory, and writes the files at the end."""

    def __init__(self, *, html: Path | None = None, junit: Path | None = None, rrd: Path | None = None) -> None:
        """Choose the reports.

        Args:
            html, junit: files to write.
            rrd: the overlay of two recordings; for run folders a folder, with one for each scenario that differs.
        """
        self._html = html
        self._junit = junit
        self._rrd = rrd
        self._drawn: dict[str, tuple[Plot, ...]] = {}

    def visit(self, case: Case, pair: RecordingPair) -> None:
        """Take one scenario; WriteError when its overlay cannot be written."""
        if self._html is not None:
            self._drawn[case.name] = plots(case.difference, pair)
        if self._rrd is None:
            return
        if not case.of_folders:
            write_overlay(self._rrd, case, pair)
        elif case.difference.verdict is DiffVerdict.DIFFERENT:
            write_overlay(self._rrd / f"{case.name}.rrd", case, pair)

    def write(self, found: RunDifference) -> None:
        """Write HTML and JUnit.

        Raises:
            WriteError: a file cannot be written.
        """
        if self._html is not None:
            write_file(self._html, report_html.html(found, self._drawn), named=True)
        if self._junit is not None:
            write_file(self._junit, report_junit.junit(found), named=True)
