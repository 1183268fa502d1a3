"""Which scenarios a command is about: files, folders, recordings to run again, and filters by name or tag."""

from __future__ import annotations

import itertools
import re
import unicodedata
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from replay import limits
from replay.batch.case import CaseResult, CaseStatus
from replay.batch.folders import look_through
from replay.batch.shard import Shard
from replay.errors import InvalidValue, Problem, ScenarioError
from replay.language.fields import stands_beside
from replay.language.globs import fits
from replay.lfs_pointer import is_lfs_pointer
from replay.scenario.load import load_cases, load_sources
from replay.scenario.model import Scenario

RULES = "rules.yaml"
"""Name of the file of tolerances that comes with a folder of scenarios."""

RECORDINGS = (".mcap", ".mcap.part")
"""What names of recordings end in, finished and unfinished ones."""
_UTF_8_MARK, _UTF_16_MARKS = b"\xef\xbb\xbf", (b"\xff\xfe", b"\xfe\xff")
_VERSION_KEY = re.compile(rb"""(?:\A|[\r\n])(?:---[ \t]+)?["']?version["']?\s*:""")
_IN_BRACES = re.compile(rb"(?:\s|[#%][^\r\n]*+|---)*+\{")
_KEY_IN_BRACES = re.compile(rb"""[{,\s]["']?version["']?\s*:""")
_NAME_KEY = re.compile(rb"^name[ \t]*:[ \t]*([A-Za-z0-9_][A-Za-z0-9_.-]*)[ \t]*(?:#.*)?\r?$", re.MULTILINE)


def find_scenarios(paths: Sequence[str | Path]) -> list[Path]:
    """Return the scenario files that paths stand for, each once, in the order given.

    A file stands for itself. A folder stands for every `*.yaml` and `*.yml` file (in upper or lower case) in it or
    below, links to folders included, sorted by path, that has a `version` key at its top level, however it is written:
    parts that are only included have none. One that cannot be read, or is UTF-16 text, counts too: nobody knows that it
    is none. Hidden files and folders, such as an environment's, are not looked at.

    Raises:
        InvalidValue: a path is not there or is an `.rrd`, or a folder holds no scenario.
    """
    found: dict[Path, None] = {}
    for path in map(Path, paths):
        if path.is_file() and path.suffix.lower() == ".rrd":
            raise InvalidValue("SCENARIO", path, "holds drawings only; the .mcap beside it can be run again")
        if path.is_file():
            found[path] = None
        elif path.is_dir():
            scenarios = [file for file in look_through(path).files if _may_be_scenario(file)]
            if not scenarios:
                raise InvalidValue("SCENARIO", path, "holds no scenario: no *.yaml file with a top-level `version` key")
            found.update(dict.fromkeys(scenarios))
        else:
            what = "is neither a file nor a folder" if path.exists() else "is not there"
            raise InvalidValue("SCENARIO", path, f"{what}; give a scenario file, a recording, or a folder")
    return list(found)


def _may_be_scenario(file: Path) -> bool:
    try:
        data = _beginning(file)
    except OSError:
        return True
    if data.startswith(_UTF_16_MARKS) or is_lfs_pointer(data):
        return True
    data = data.removeprefix(_UTF_8_MARK)
    key = _KEY_IN_BRACES if _IN_BRACES.match(data) else _VERSION_KEY
    return key.search(data) is not None


def _beginning(file: Path) -> bytes:
    """Return as much of a file as a YAML file may have; what is larger is none that is read."""
    with file.open("rb") as stream:
        return stream.read(limits.YAML_BYTES)


def left_out(paths: Sequence[str | Path]) -> list[str]:
    """Return a line for each place in the folders among paths that `find_scenarios` cannot look at."""
    return [line for path in map(Path, paths) if path.is_dir() for line in look_through(path).left_out]


def rules_beside(paths: Sequence[str | Path]) -> Path | None:
    """Return the tolerances that come with scenarios: `rules.yaml` in the first folder named, or beside the file."""
    first = Path(paths[0])
    file = (first if first.is_dir() else first.parent) / RULES
    return file if file.is_file() else None


def load_all(paths: Sequence[str | Path]) -> list[Scenario]:
    """Return the scenarios of all paths: of a file with a sweep its cases, of a recording (`.mcap`) its own scenario.

    Raises:
        ScenarioError: what is wrong with any of them, all problems together; or two have names that are one on some
            file systems.
        RecordingError: a recording cannot be read.
        InvalidValue: see `find_scenarios`.
    """
    loaded, invalid = _load(paths)
    _refuse(invalid)
    return [scenario for scenario, _ in loaded]


def _load(paths: Sequence[str | Path]) -> tuple[list[tuple[Scenario, Path]], dict[Path, ScenarioError]]:
    """Return scenarios with their files, and what is wrong with the files that are not valid."""
    scenarios: list[tuple[Scenario, Path]] = []
    problems: list[Problem] = []
    invalid: dict[Path, ScenarioError] = {}
    homes: dict[str, tuple[str, Path]] = {}
    for path in find_scenarios(paths):
        try:
            found = [_attached(path)] if path.name.lower().endswith(RECORDINGS) else load_cases(path)
        except ScenarioError as error:
            invalid[path] = error
            continue
        for scenario in found:
            folder = _folded(scenario.name)
            if folder in homes:
                problems.append(Problem(_taken(scenario.name, *homes[folder]), file=str(path)))
            homes[folder] = scenario.name, path
            scenarios.append((scenario, path))
    if problems:  # of two scenarios with one name, nobody knows which is meant
        _refuse(invalid, problems)
    return scenarios, invalid


def _folded(name: str) -> str:
    """Return what a name is on file systems that take upper and lower case, and all forms of a character, for one."""
    return unicodedata.normalize("NFD", unicodedata.normalize("NFD", name).casefold())


def _taken(name: str, other: str, home: Path) -> str:
    """Return what is wrong with a name when another scenario, of a file `home`, has it already."""
    if name == other:
        return f"name {name!r} is taken by {home}; each scenario of a run has its own"
    form = unicodedata.normalize("NFC", name) == unicodedata.normalize("NFC", other)
    what = "the form of its characters (Unicode NFC, NFD)" if form else "upper and lower case"
    shown = f"{name!a} differs from {other!a}" if form else f"{name!r} differs from {other!r}"
    return f"name {shown} of {home} only in {what}: on other systems their folders would be one; rename one of them"


def _refuse(invalid: Mapping[Path, ScenarioError], problems: Sequence[Problem] = ()) -> None:
    found = [*(problem for error in invalid.values() for problem in error.problems), *problems]
    if found:
        raise ScenarioError(found)


def select(scenarios: Sequence[Scenario], patterns: Sequence[str]) -> list[Scenario]:
    """Return the scenarios that match any pattern: a glob on the name, or `tag:NAME`; all without a pattern."""
    if not patterns:
        return list(scenarios)
    return [scenario for scenario in scenarios if any(_matches(scenario, pattern) for pattern in patterns)]


@dataclass(frozen=True)
class Selection:
    """What a command is about.

    Attributes:
        chosen: the scenarios to run.
        skipped: those that were filtered out, by name, with the reason.
        sources: the file that each comes from, as the user named it.
        of_folders: whether a folder was named: then these are all scenarios that there are.
        invalid: what is wrong with files among them that are not valid, by the name that the scenario would have.
    """

    chosen: tuple[Scenario, ...]
    skipped: Mapping[str, str]
    sources: Mapping[str, Path]
    of_folders: bool
    invalid: Mapping[str, ScenarioError]

    @property
    def failed(self) -> list[CaseResult]:
        """The results of the files that are not valid, which cannot be run."""
        return [CaseResult(n, CaseStatus.FAILED, error=str(error), invalid=True) for n, error in self.invalid.items()]

    @staticmethod
    def of(paths: Sequence[str | Path], patterns: Sequence[str], shard: Shard | None) -> Selection:
        """Return what paths, patterns and a shard select; errors as of `load_all`.

        Files that are not valid are told in the selection, if there is a valid one in it. What tags they have is not
        known, so every pattern for tags selects them; they are in the first shard.
        """
        loaded, wrong = _load(paths)
        everything = [scenario for scenario, _ in loaded]
        matching = select(everything, patterns)
        chosen = shard.of(matching) if shard else matching
        names = {scenario.name for scenario in matching}, {scenario.name for scenario in chosen}
        skipped = {s.name: "not selected" for s in everything if s.name not in names[0]}
        skipped |= {s.name: "in another shard" for s in matching if s.name not in names[1]}
        sources = {scenario.name: path for scenario, path in loaded}
        named: dict[str, Path] = {}
        for path in wrong:
            named[_name_in(path, sources.keys() | named)] = path
        mine = shard is None or shard.index == 1
        named = {name: path for name, path in named.items() if mine and (not patterns or _any_matches(name, patterns))}
        invalid = {name: wrong[path] for name, path in named.items()}
        if not chosen:
            _refuse({named[name]: error for name, error in invalid.items()})
        of_folders = any(Path(path).is_dir() for path in paths)
        return Selection(tuple(chosen), skipped, sources | named, of_folders, invalid)


def _name_in(path: Path, taken: Collection[str]) -> str:
    """Return the name that a file which is not valid gives its scenario; that of the file when it is none or taken."""
    try:
        found = _NAME_KEY.search(_beginning(path))
    except OSError:
        found = None
    stem = path.stem.lstrip(".") or "scenario"  # the name of a folder, and no way to another one
    numbered = (f"{stem}_{number}" for number in itertools.count(2))
    names = itertools.chain([found[1].decode()] if found else [], [stem], numbered)
    return next(name for name in names if name not in taken and not stands_beside(name))


def _any_matches(name: str, patterns: Sequence[str]) -> bool:
    return any(pattern.startswith("tag:") or _name_matches(name, pattern) for pattern in patterns)


def _matches(scenario: Scenario, pattern: str) -> bool:
    """Return whether a pattern selects a scenario."""
    if pattern.startswith("tag:") and scenario.name != pattern:
        return any(fits(tag, pattern.removeprefix("tag:")) for tag in scenario.tags)
    return _name_matches(scenario.name, pattern)


def _name_matches(name: str, pattern: str) -> bool:
    """Return whether a pattern stands for a name; a name itself does even when it holds brackets."""
    return name == pattern or fits(name, pattern)


def _attached(path: Path) -> Scenario:
    from replay.recording.slim import attached_files

    name, root, files = attached_files(path)
    return load_sources(root, files, case=name)
