"""Which scenarios a command is about: files, folders, recordings to run again, and filters by name or tag."""

from __future__ import annotations

import fnmatch
import re
from collections.abc import Sequence
from pathlib import Path

from replay.errors import InvalidValue, Problem, ScenarioError
from replay.scenario.load import load, load_sources
from replay.scenario.model import Scenario

_VERSION_KEY = re.compile(rb"^version\s*:", re.MULTILINE)


def find_scenarios(paths: Sequence[str | Path]) -> list[Path]:
    """Return the scenario files that paths stand for, each once, in the order given.

    A file stands for itself. A folder stands for every `*.yaml` and `*.yml` file in it or below, sorted by path, that
    has a `version` key at its top level: parts that are only included have none. Hidden files and folders, such as an
    environment's, are not looked at.

    Raises:
        InvalidValue: a path is not there, or a folder holds no scenario.
    """
    found: dict[Path, None] = {}
    for path in map(Path, paths):
        if path.is_file():
            found[path] = None
        elif path.is_dir():
            files = sorted(file for pattern in ("*.yaml", "*.yml") for file in path.rglob(pattern) if file.is_file())
            visible = [f for f in files if not any(part.startswith(".") for part in f.relative_to(path).parts)]
            scenarios = [file for file in visible if _VERSION_KEY.search(file.read_bytes())]
            if not scenarios:
                raise InvalidValue("SCENARIO", path, "holds no scenario: no *.yaml file with a top-level `version` key")
            found.update(dict.fromkeys(scenarios))
        else:
            raise InvalidValue("SCENARIO", path, "is not there; give a scenario file, a recording, or a folder")
    return list(found)


def load_all(paths: Sequence[str | Path]) -> list[Scenario]:
    """Return the scenarios of all paths; a recording (`.mcap`) gives the scenario that is attached to it.

    Raises:
        ScenarioError: what is wrong with any of them, all problems together; or two have the same name.
        RecordingError: a recording cannot be read.
        InvalidValue: see `find_scenarios`.
    """
    scenarios: list[Scenario] = []
    problems: list[Problem] = []
    homes: dict[str, Path] = {}
    for path in find_scenarios(paths):
        try:
            scenario = _attached(path) if path.suffix == ".mcap" else load(path)
        except ScenarioError as error:
            problems.extend(error.problems)
            continue
        if scenario.name in homes:
            problems.append(Problem(f"name {scenario.name!r} is taken by {homes[scenario.name]}", file=str(path)))
        homes[scenario.name] = path
        scenarios.append(scenario)
    if problems:
        raise ScenarioError(problems)
    return scenarios


def select(scenarios: Sequence[Scenario], patterns: Sequence[str]) -> list[Scenario]:
    """Return the scenarios that match any pattern: a glob on the name, or `tag:NAME`; all without a pattern."""
    if not patterns:
        return list(scenarios)
    return [scenario for scenario in scenarios if any(_matches(scenario, pattern) for pattern in patterns)]


def _matches(scenario: Scenario, pattern: str) -> bool:
    if pattern.startswith("tag:"):
        return any(fnmatch.fnmatchcase(tag, pattern.removeprefix("tag:")) for tag in scenario.tags)
    return fnmatch.fnmatchcase(scenario.name, pattern)


def _attached(path: Path) -> Scenario:
    from replay.logs.mcap_reader import McapLog
    from replay.recording.reader import read_provenance

    with McapLog(path) as log:
        provenance = read_provenance(log)
        sources = {attachment.name: log.attachment(attachment) for attachment in log.attachments}
    return load_sources(provenance.root, sources)
