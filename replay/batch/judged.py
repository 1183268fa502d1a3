"""What a regression says: a verdict for each scenario, and the run that they are of."""

from __future__ import annotations

import enum
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from replay.batch.case import CaseResult
from replay.batch.run_file import Run
from replay.comparison.plots import Plot
from replay.comparison.runs import Case

INDEX, JUNIT = "index.html", "junit.xml"
"""Names of the reports in a run folder."""
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
        comparison: with its baseline; None when there was none to make.
        drawings: of its signals that differ.
        undrawn: there are more, for which the page has no room.
        source: file that it was read from, as the user named it.
    """

    name: str
    verdict: RegressVerdict
    message: str = ""
    result: CaseResult | None = None
    comparison: Case | None = None
    drawings: tuple[Plot, ...] = ()
    undrawn: bool = False
    source: str = ""


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
