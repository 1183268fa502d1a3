"""Where the log of a comparison is from: the scenario itself, with its excerpt, or a log and a map beside it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from pydantic import ValidationError

from replay.comparison.measured.compare import compare
from replay.comparison.measured.result import MeasuredComparison
from replay.comparison.rules import Rules
from replay.errors import InvalidValue, Problem, ScenarioError
from replay.language.node import KeyPath
from replay.logs.mcap_reader import McapLog
from replay.recording.reader import own_topics, read, read_files, read_provenance
from replay.scenario import measured_log
from replay.scenario.load import load_sources
from replay.scenario.measured import MeasuredMapPart
from replay.scenario.measured_log import MeasuredLog
from replay.scenario.measured_signals import EVENTS
from replay.scenario.model import Scenario
from replay.scenario.problems import translate
from replay.scenario.source import Attached, Folder, Library, problem_at
from replay.scenario.yaml_file import read_yaml


@dataclass(eq=False)
class MeasuredSource:
    """A log of the machine, and what of it measures which signals.

    Attributes:
        written: the map.
        library, name: where the log is.
        problem: returns that a rule is broken at a path of the language, with its place.
    """

    written: MeasuredMapPart
    library: Library
    name: str
    problem: Callable[[KeyPath, str], Problem]
    _read: tuple[str, MeasuredLog] | None = None

    def read(self, scenario: Scenario) -> None:
        """Read the log for a scenario, before it is run; errors as of `take`."""
        self._read = scenario.name, self.take(scenario)

    def take(self, scenario: Scenario) -> MeasuredLog:
        """Return what the log says of a scenario's signals, once if it is read already: logs may be large.

        Raises:
            ScenarioError: the log cannot be used.
        """
        kept, self._read = self._read, None
        if kept is not None and kept[0] == scenario.name:
            return kept[1]
        log = measured_log.read(scenario, self.written, self.library, self.name, self.problem).without_file()
        if log.problems:
            raise ScenarioError(log.problems)
        return log

    @staticmethod
    def of_scenario(scenario: Scenario) -> MeasuredSource | None:
        """Return the log that a scenario names, as its sources hold it; None when it names none."""
        known = scenario.provenance
        if scenario.measured is None:
            return None
        return MeasuredSource(scenario.measured, Attached(known.main, known.sources), known.measured, known.problem)

    @staticmethod
    def of_files(log: Path, written: MeasuredMapPart, problem: Callable[[KeyPath, str], Problem]) -> MeasuredSource:
        """Return a log beside the scenario."""

        def told(path: KeyPath, rule: str) -> Problem:
            return Problem(rule, file=str(log)) if path[-1] == "file" else problem(path, rule)

        library = Folder(log)
        return MeasuredSource(written, library, library.main, told)


def load_map(path: Path) -> tuple[MeasuredMapPart, Callable[[KeyPath, str], Problem]]:
    """Return the map that a YAML file holds, and what tells a broken rule at its place.

    Raises:
        ScenarioError: it cannot be read, or is no valid map.
    """
    root = read_yaml(path)
    if not isinstance(root.value, dict):
        raise ScenarioError([root.place.problem("a map of a measured log is a mapping with `signals`")])
    if set(root.mapping) == {"measured"}:
        raise ScenarioError([root.keys["measured"].problem("measured: a map begins one level below this key")])
    try:
        written = MeasuredMapPart.model_validate(root.data())
    except ValidationError as error:
        raise ScenarioError(translate(error, root, MeasuredMapPart)) from None
    return written, lambda at, rule: problem_at(root, at[len(measured_log.PATH) :], rule)


def compare_recording(path: str | Path, *, rules: Rules | None = None) -> MeasuredComparison:
    """Return what a recording says beside the log of the machine that is attached to it: it needs nothing else.

    Args:
        path: of a recording.
        rules: tolerances; without them everything must be equal.

    Raises:
        RecordingError: the recording cannot be read.
        ScenarioError: the log cannot be used, or the recording does not have a signal.
        UndeterminedClockError: a clock is to be found, and the signals do not tell it.
        InvalidValue: there is no log.
    """
    with McapLog(path) as file:
        provenance = read_provenance(file)
        files = read_files(file, provenance)
    scenario = load_sources(provenance.root, files, case=provenance.scenario)
    source = MeasuredSource.of_scenario(scenario)
    if source is None:
        rule = (
            "its scenario names no log of the machine: give it a `measured`, or name the log with --measured and --map"
        )
        raise InvalidValue("recording", path, rule)
    return compare_scenario(path, scenario, source, rules=rules)


def compare_scenario(
    path: str | Path, scenario: Scenario, source: MeasuredSource, *, rules: Rules | None = None
) -> MeasuredComparison:
    """Return what the recording of a scenario says beside a log of the machine; errors as of `compare_recording`."""
    log = source.take(scenario)
    with McapLog(path) as file:
        topics = {channel.topic for channel in file.channels.values()} & own_topics(read_provenance(file).layout)
    recording = read(path, topics=_needed(topics, source.written))
    return compare(recording, source.written, log, rules=rules, problem=source.problem)


def _needed(topics: set[str], written: MeasuredMapPart) -> set[str]:
    """Return the topics of a recording that the signals are read of; of events those of whatever they tell of."""
    names = tuple(written.signals)
    if any(name.startswith(f"{EVENTS}/") for name in names):
        return topics
    return {topic for topic in topics if any(name.startswith(f"{topic}/") for name in names)}
