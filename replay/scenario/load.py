"""Scenario files to validated scenarios, with every file they need."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Mapping
from difflib import get_close_matches
from pathlib import Path
from typing import TYPE_CHECKING

from pydantic import ValidationError

from replay import limits
from replay.errors import InvalidValue, Problem, ScenarioError
from replay.geometry.mesh_file import FORMATS
from replay.language.node import KeyPath, Node
from replay.scenario.checks import check
from replay.scenario.include import ScenarioText
from replay.scenario.methods import BUILTIN_MODELS, Model, builtin_model
from replay.scenario.model import Scenario
from replay.scenario.names import Names
from replay.scenario.notes import sensor_faults
from replay.scenario.problems import translate
from replay.scenario.script import motion_problems
from replay.scenario.sensors import Sensors
from replay.scenario.source import (
    Attached,
    Folder,
    Library,
    Remembered,
    ScenarioProvenance,
    SourceRule,
    find,
    packed,
    problem_at,
    resolve_name,
)
from replay.scenario.sweep import SweepCase, SweepPart, cases, replaced
from replay.scenario.yaml_file import read_yaml

if TYPE_CHECKING:
    from replay.scenario.recorded import RecordedMotion

VERSION = 1


def load(path: str | Path) -> Scenario:
    """Read a scenario file and everything it needs.

    Args:
        path: of the scenario's YAML file; included files and meshes stand in its folder or below, or in packages.

    Returns:
        The validated scenario; `.sources` holds the bytes of every file read, `.sha256` their digests. Of a file with
        a sweep it is the scenario whose values no case has replaced; see `load_cases`.

    Raises:
        ScenarioError: everything that is wrong, each with file, line, column, and what would work.
    """
    return _File(Folder(Path(path))).scenario()


def load_cases(path: str | Path) -> tuple[Scenario, ...]:
    """Read the scenarios that a file stands for: one, or one for each case of its sweep.

    Raises:
        ScenarioError: as `load`, of all cases together.
    """
    file = _File(Folder(Path(path)))
    scenario = file.scenario()
    return (scenario,) if scenario.sweep is None else file.cases(scenario.name)


def load_sources(main: str, sources: Mapping[str, bytes], *, case: str | None = None) -> Scenario:
    """Read a scenario from files in memory, as a recording holds them.

    Args:
        main: name of the scenario file in `sources`.
        sources: bytes by name, as `Scenario.sources`.
        case: name of the case of its sweep; without it, or when it is the scenario's own name, as `load`.

    Raises:
        ScenarioError: as `load`; or there is no such case.
    """
    if case is not None and case.endswith("]"):  # one of many, and others of them may follow
        return _opened(main, tuple(sorted(sources.items()))).case(case)
    file = _File(Attached(main, sources))
    return file.scenario() if case is None else file.case(case)


def load_from(library: Library) -> Scenario:
    """Read a scenario from wherever its files are; ScenarioError as `load`."""
    return _File(library).scenario()


def load_model(file_or_name: str | Path) -> Model:
    """Return a built-in model by its name, or the model that a YAML file holds.

    Raises:
        InvalidValue: the name is empty.
        ScenarioError: there is neither a model nor a file of that name, or the file is not a valid model.
    """
    if str(file_or_name) in BUILTIN_MODELS:
        return BUILTIN_MODELS[str(file_or_name)]
    names = ", ".join(sorted(BUILTIN_MODELS))
    if not str(file_or_name):
        raise InvalidValue("model", "''", f"names none; give a file, or a built-in model: {names}")
    root = read_yaml(Path(file_or_name), besides=f"; built-in models are: {names}")
    if not isinstance(root.value, dict) or "links" in root.mapping:
        what = "a scenario" if root.mapping else root.shown()
        raise ScenarioError(
            [root.place.problem(f"a model is a mapping of {', '.join(Model.model_fields)}, not {what}")]
        )
    if set(root.mapping) == {"model"}:
        raise ScenarioError([root.keys["model"].problem("model: a file of a model begins one level below this key")])
    try:
        return Model.model_validate(builtin_model(root.data()))
    except ValidationError as error:
        raise ScenarioError(_in_order(translate(error, root, Model))) from None


@functools.lru_cache(maxsize=2)
def _opened(main: str, sources: tuple[tuple[str, bytes], ...]) -> _File:
    """Return a file with a sweep: a baseline's and a candidate's are asked for one case after another."""
    return _File(Attached(main, dict(sources)))


class _File:
    """A scenario file, read and merged with what it includes: the scenario that it holds, and the cases of its sweep.

    Raises:
        ScenarioError: nothing of it can be read.
    """

    def __init__(self, library: Library) -> None:
        self._library = library = Remembered(library)
        self._problems: list[Problem] = []
        self._text = ScenarioText(library, self._problems)
        root = self._text.read()
        if root is None:
            raise ScenarioError(self._problems)
        version = root.child("version")
        if version is not None and (type(version.value) is not int or version.value != VERSION):
            rule = f"is not known; this release reads version {VERSION} of the language, write version: {VERSION}"
            raise ScenarioError([problem_at(root, ("version",), rule)])
        self._root = root

    def scenario(self) -> Scenario:
        """Return the scenario as it is written."""
        return self._validated(self._root, list(self._problems))

    def cases(self, name: str) -> tuple[Scenario, ...]:
        """Return the cases of the scenario's sweep."""
        problems: list[Problem] = []
        found = []
        for case in cases(self._root, name):
            try:
                found.append(self._case(case))
            except ScenarioError as error:
                problems.extend(error.problems)
        if problems:
            raise ScenarioError(_in_order(problems))
        return tuple(found)

    def case(self, name: str) -> Scenario:
        """Return the case of a name."""
        sweep = self._root.child("sweep")
        if sweep is None or self._cases_by_name is None or self._root.mapping["name"].value == name:
            return self.scenario()  # which says what is wrong
        if name not in self._cases_by_name:
            raise ScenarioError([sweep.place.problem(f"the sweep has no case {name!r}")])
        return self._case(self._cases_by_name[name])

    @functools.cached_property
    def _cases_by_name(self) -> dict[str, SweepCase] | None:
        """The cases of the sweep; None where there is no valid one."""
        title, sweep = self._root.child("name"), self._root.child("sweep")
        if title is None or not isinstance(title.value, str) or sweep is None:
            return None
        try:
            SweepPart.model_validate(sweep.data())
        except ValidationError:
            return None
        return {case.name: case for case in cases(self._root, title.value)}

    def _case(self, case: SweepCase) -> Scenario:
        problems = list(self._problems)
        root = replaced(self._root, case, problems)
        return self._validated(root, problems)

    def _validated(self, root: Node, problems: list[Problem]) -> Scenario:
        scenario: Scenario | None = None
        named = self._text.whole and _sections_known(root)
        try:
            scenario = Scenario.model_validate(root.data())
        except ValidationError as error:
            problems.extend(_not_told(problems, translate(error, root, Scenario)))
            named = named and not any("[key]" in detail["loc"] for detail in error.errors(include_url=False))
        if named:  # else names would be missed that are written, but not to be read
            found = itertools.islice(check(Names(root, scenario)), limits.PROBLEMS)
            problems.extend(problem_at(root, path, rule) for path, rule in found)
        provenance = ScenarioProvenance(main=self._library.main, sources=dict(self._text.sources), tree=packed(root))
        problems.extend(_read_meshes(self._library, self._text, root, provenance))
        if scenario is None:
            raise ScenarioError(_in_order(problems))
        scenario._provenance = provenance
        problems.extend(sensor_faults(scenario, scenario.model))
        recorded = None
        if scenario.motion.recorded is not None:
            recorded = _read_log(self._library, self._text, root, scenario, problems)
        if scenario.measured is not None and not problems:
            _read_measured(self._library, self._text, root, scenario, recorded, problems)
        if problems:
            raise ScenarioError(_in_order(problems))
        problems.extend(motion_problems(scenario))
        if problems:
            raise ScenarioError(_in_order(problems))
        return scenario


def _read_meshes(library: Library, text: ScenarioText, root: Node, provenance: ScenarioProvenance) -> list[Problem]:
    """Read the files of all mesh shapes; a file is looked for relative to the file that names it."""
    problems = []
    links = root.child("links")
    for link, node in (links.mapping if links is not None else {}).items():
        shapes = node.child("shapes")
        for shape, body in (shapes.mapping if shapes is not None else {}).items():
            kind, file = body.child("type"), body.child("file")
            if kind is None or kind.value != "mesh" or file is None or not isinstance(file.value, str):
                continue
            if not file.value.lower().endswith(FORMATS):
                continue  # which the shape itself has told
            try:
                name = resolve_name(file.value, text.names[file.place.file])
                if name not in provenance.sources:
                    provenance.sources[name] = library.read(name)
                provenance.meshes[link, shape] = name
            except SourceRule as error:
                problems.append(problem_at(root, ("links", link, "shapes", shape, "file"), str(error)))
    return problems


def _read_log(
    library: Library, text: ScenarioText, root: Node, scenario: Scenario, problems: list[Problem]
) -> tuple[str, RecordedMotion] | None:
    """Read the log of recorded motion, which is looked for like a mesh; return its name and what it says of joints."""
    from replay.scenario.recorded import PATH, read

    provenance = scenario.provenance
    name = _log_name(text, root, PATH, problems)
    if name is None:
        return None
    try:
        found = read(scenario, library, name)
    except InvalidValue:
        return None  # links or joints that are their own ancestors, which is told already
    provenance.tracks.update(found.tracks)
    provenance.free_tracks.update(found.free)
    provenance.log_notes.extend(found.notes)
    problems.extend(found.problems)
    if found.problems:
        return None
    provenance.sources[name] = found.excerpt
    provenance.originals[name] = dict(found.origin)
    return name, found


def _read_measured(
    library: Library,
    text: ScenarioText,
    root: Node,
    scenario: Scenario,
    recorded: tuple[str, RecordedMotion] | None,
    problems: list[Problem],
) -> None:
    """Read the log of the real machine, and keep of it what the comparison needs."""
    from replay.scenario.measured_log import MEASURED, PATH, read

    provenance = scenario.provenance
    name = _log_name(text, root, PATH, problems)
    if name is None or scenario.measured is None:
        return
    same = recorded[1] if recorded is not None and recorded[0] == name else None
    found = read(scenario, scenario.measured, library, name, provenance.problem, same)
    provenance.log_notes.extend(found.notes)
    problems.extend(found.problems)
    if not found.problems:
        provenance.measured = name
        provenance.sources[name] = found.excerpt(same)
        provenance.originals[name] = {**found.origin, **({} if same else {"use": MEASURED})}


def _log_name(text: ScenarioText, root: Node, path: KeyPath, problems: list[Problem]) -> str | None:
    """Return the name in the library of the log that a part of the language names as its `file`."""
    node = find(root, (*path, "file"))
    assert node is not None
    try:
        return resolve_name(str(node.value), text.names[node.place.file])
    except SourceRule as error:
        problems.append(problem_at(root, (*path, "file"), str(error)))
        return None


def _sections_known(root: Node) -> bool:
    """Return whether no section that gives names is misspelt, which is told already."""
    sensors = root.child("sensors")
    unknown = root.mapping.keys() - Scenario.model_fields.keys()
    return not any(get_close_matches(key, ("include", "links", "sensors"), cutoff=0.6) for key in unknown) and (
        sensors is None or sensors.mapping.keys() <= Sensors.model_fields.keys()
    )


def _not_told(told: list[Problem], found: list[Problem]) -> list[Problem]:
    """Return what was found at other places than what is told already: a value that cannot be read is told once."""
    places = {(problem.file, problem.line, problem.column) for problem in told}
    return [problem for problem in found if (problem.file, problem.line, problem.column) not in places]


def _in_order(problems: list[Problem]) -> list[Problem]:
    unique = {str(problem): problem for problem in problems}
    return sorted(unique.values(), key=lambda problem: (problem.file or "", problem.line or 0, problem.column or 0))
