"""What a regression says: a verdict for each scenario, and the run that they are of."""

from __future__ import annotations

import enum
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from replay.batch.case import CaseResult
from replay.batch.finding import Finding
from replay.batch.run_file import Run
from replay.comparison.effects import Severity

INDEX, JUNIT, SUMMARY, METRICS = "index.html", "junit.xml", "summary.md", "metrics.parquet"
REPORTS = (INDEX, JUNIT, SUMMARY, METRICS)
"""Names of the reports in a run folder."""
PICTURE = "worst.png"
"""Name of the picture of a scenario's worst moment in its folder."""
PAGE = "report.html"
"""Name of a scenario's own page in its folder."""
OVERLAY = "{name}.difference.rrd"
"""Name of the recording that shows both runs of a scenario."""


class RegressVerdict(enum.Enum):
    """What the regression says of a scenario."""

    SAME = "same"
    CREATED = "created"  # it had no baseline, and has one now
    DIFFERENT = "different"
    BROKEN = "broken"  # an expectation does not hold
    FAILED = "failed"
    CRASHED = "crashed"
    TIMEOUT = "timeout"
    MEMORY = "memory"
    INTERRUPTED = "interrupted"
    MISSING = "missing baseline"
    UNREADABLE = "unreadable baseline"
    UNCOMPARED = "no baseline"  # and that is accepted
    SKIPPED = "skipped"

    @property
    def fine(self) -> bool:
        """Whether there is nothing to be done about it."""
        return self in (RegressVerdict.SAME, RegressVerdict.CREATED, RegressVerdict.UNCOMPARED, RegressVerdict.SKIPPED)

    @property
    def left_out(self) -> bool:
        """Whether it says nothing about the scenario's results."""
        return self in (RegressVerdict.UNCOMPARED, RegressVerdict.SKIPPED)


@dataclass(frozen=True, eq=False)
class Judged:
    """A scenario and what is said of it.

    Attributes:
        name: of the scenario.
        verdict: what became of it.
        message: one line that says why; "" when it is the same.
        result: of its run; None when it was skipped.
        finding: what its comparison with its baseline said; None when there was none to make.
        source: file that it was read from, as the user named it.
        tags: of the scenario.
    """

    name: str
    verdict: RegressVerdict
    message: str = ""
    result: CaseResult | None = None
    finding: Finding | None = None
    source: str = ""
    tags: tuple[str, ...] = ()

    @property
    def severity(self) -> Severity:
        """How much it matters."""
        if self.verdict is RegressVerdict.BROKEN:
            return Severity.BROKEN
        if self.finding is not None and self.finding.effects:
            return self.finding.effects[0].severity
        if self.verdict in (RegressVerdict.MISSING, RegressVerdict.UNREADABLE):
            return Severity.UNCOMPARED
        bookkeeping = self.verdict.fine or self.verdict is RegressVerdict.DIFFERENT
        return Severity.BOOKKEEPING if bookkeeping else Severity.CRASHED

    @property
    def size(self) -> float:
        """How large the worst difference is, in tolerances; infinite where there is no number for it."""
        found = self.finding.effects if self.finding is not None else ()
        return found[0].size if found else math.inf

    @property
    def order(self) -> tuple[object, ...]:
        """What rows of scenarios are sorted by: the worst first."""
        return self.verdict.fine, self.severity, -self.size, self.name


@dataclass(frozen=True, eq=False)
class Regression:
    """A run with its verdicts.

    Attributes:
        run: what was run.
        baseline: folder.
        rules: file of tolerances; "" for none.
        model: file or name of the model that replaces the scenarios' own; "" for none.
        judged: all scenarios, in the order in which they were given, and then those that were skipped.
        unused: scenarios that have a baseline and were not among those of the folders given; none for single files.
    """

    run: Run
    baseline: Path
    rules: str
    model: str
    judged: tuple[Judged, ...]
    unused: tuple[str, ...]

    def count(self, *verdicts: RegressVerdict) -> int:
        """Return how many scenarios have one of some verdicts."""
        return sum(item.verdict in verdicts for item in self.judged)


def verdicts(found: Regression) -> Mapping[str, str]:
    """Return each scenario that was run with its verdict, for the history."""
    return {item.name: item.verdict.value for item in found.judged if not item.verdict.left_out}
