"""Scenarios beside a log of the machine: run where no recording is given, then compared."""

from __future__ import annotations

import contextlib
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from replay.batch.run import Execution, run_all
from replay.batch.select import RECORDINGS, load_all
from replay.batch.watch import Watch
from replay.comparison.measured.result import MeasuredComparison
from replay.comparison.measured.source import MeasuredSource, compare_recording, compare_scenario, load_map
from replay.comparison.rules import Rules
from replay.errors import InvalidValue
from replay.scenario.methods import Model
from replay.scenario.model import Scenario


@dataclass(frozen=True, eq=False)
class ComparedCase:
    """A scenario, and what its recording says beside the log; or why it has none."""

    name: str
    found: MeasuredComparison | None
    error: str = ""


def compare_all(
    path: Path,
    *,
    log: Path | None = None,
    mapping: Path | None = None,
    rules: Rules | None = None,
    model: Model | None = None,
    output: Path | None = None,
    visit: Callable[[Path, MeasuredComparison, bool], None] = lambda recording, found, several: None,
    watch: Watch | None = None,
) -> Iterator[ComparedCase]:
    """Yield what the recording of each scenario says beside a log of the machine, as soon as all are run.

    Args:
        path: a scenario, or a recording, which is not run again.
        log: the log; the one that the scenario names, or its recording holds, when left out.
        mapping: what of the log measures which signals; the scenario's own `measured` when left out.
        rules: tolerances; without them everything must be equal.
        model: replaces the scenario's own.
        output: run folder for the recordings; they are not kept when left out.
        visit: called with each recording, while it is there, its comparison, and whether it is one of several.
        watch: follows the run.

    Raises:
        ReplayError: the scenario, the log, the map or a recording cannot be used, or a clock cannot be told.
        InvalidValue: there is no log, or no map; or a recording is to be computed by another model.
    """
    if mapping is not None and log is None:
        raise InvalidValue("--map", mapping, "says what a log measures: name the log with --measured")
    scenarios = load_all([path])
    source = _source(scenarios[0], log, mapping)
    if path.name.lower().endswith(RECORDINGS):
        for option, value in (("--model", model), ("--output", output)):
            if value is not None:
                raise InvalidValue("SCENARIO", path, f"is a recording, which is not run again: {option} has no effect")
        name = scenarios[0].name
        found = _beside(path, scenarios[0], source, rules)
        visit(path, found, False)
        yield ComparedCase(name, found)
        return
    with contextlib.ExitStack() as stack:
        folder = output or Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="replay-")))
        run = run_all(
            scenarios, folder, model=model, rrd=output is not None, overwrite=True, execution=Execution(), watch=watch
        )
        if run.interrupted:
            raise KeyboardInterrupt
        for scenario, result in zip(scenarios, run.results, strict=True):
            if result.recordings is None or not result.status.recorded:
                yield ComparedCase(result.name, None, result.error)
            else:
                found = _beside(result.recordings.mcap, scenario, source, rules)
                visit(result.recordings.mcap, found, len(scenarios) > 1)
                yield ComparedCase(result.name, found)


def _beside(
    recording: Path, scenario: Scenario, source: MeasuredSource | None, rules: Rules | None
) -> MeasuredComparison:
    """Return what a recording says beside a log; without one, beside the excerpt of it that the recording holds."""
    if source is None:
        return compare_recording(recording, rules=rules)
    return compare_scenario(recording, scenario, source, rules=rules)


def _source(scenario: Scenario, log: Path | None, mapping: Path | None) -> MeasuredSource | None:
    """Return the log beside a scenario, read before anything is run; None for the one that each scenario names."""
    if log is None:
        if scenario.measured is None:
            rule = "names no log of the machine: give it a `measured`, or name the log with --measured and --map"
            raise InvalidValue("SCENARIO", scenario.name, rule)
        return None
    if mapping is not None:
        source = MeasuredSource.of_files(log, *load_map(mapping))
    elif scenario.measured is not None:
        source = MeasuredSource.of_files(log, scenario.measured, scenario.provenance.problem)
    else:
        raise InvalidValue("--measured", log, "needs --map, which says what of it measures which signals")
    source.read(scenario)
    return source
