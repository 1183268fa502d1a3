"""Scenario files to validated scenarios, with every file they need."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from pydantic import ValidationError

from replay.errors import Problem, ScenarioError
from replay.scenario.checks import check
from replay.scenario.include import Text
from replay.scenario.methods import BUILTIN_MODELS, Model, builtin_model
from replay.scenario.model import Scenario
from replay.scenario.names import Names
from replay.scenario.node import Node
from replay.scenario.problems import translate
from replay.scenario.script import motion_problems
from replay.scenario.source import Attached, Folder, Library, Provenance, SourceRule, find, problem_at, resolve_name
from replay.scenario.yaml_text import parse

VERSION = 1


def load(path: str | Path) -> Scenario:
    """Read a scenario file and everything it needs.

    Args:
        path: of the scenario's YAML file; included files and meshes stand in its folder or below, or in packages.

    Returns:
        The validated scenario; `.sources` holds the bytes of every file read, `.sha256` their digests.

    Raises:
        ScenarioError: everything that is wrong, each with file, line, column, and what would work.
    """
    return _load(Folder(Path(path)))


def load_sources(main: str, sources: Mapping[str, bytes]) -> Scenario:
    """Read a scenario from files in memory, as a recording holds them.

    Args:
        main: name of the scenario file in `sources`.
        sources: bytes by name, as `Scenario.sources`.

    Raises:
        ScenarioError: as `load`.
    """
    return _load(Attached(main, sources))


def load_model(file_or_name: str | Path) -> Model:
    """Return a built-in model by its name, or the model that a YAML file holds.

    Raises:
        ScenarioError: there is neither a model nor a file of that name, or the file is not a valid model.
    """
    if str(file_or_name) in BUILTIN_MODELS:
        return BUILTIN_MODELS[str(file_or_name)]
    library = Folder(Path(file_or_name))
    shown = library.shown(library.main)
    problems: list[Problem] = []
    try:
        root = parse(library.read(library.main), shown, problems)
    except SourceRule as error:
        names = ", ".join(sorted(BUILTIN_MODELS))
        raise ScenarioError([Problem(f"{error}; built-in models are: {names}", file=shown)]) from None
    if root is None or problems:
        raise ScenarioError(problems)
    if not isinstance(root.value, dict):
        raise ScenarioError([root.place.problem("a model is a mapping with collision, distance and capacitive")])
    try:
        return Model.model_validate(builtin_model(root.data()))
    except ValidationError as error:
        raise ScenarioError(_in_order(translate(error, root, Model))) from None


def _load(library: Library) -> Scenario:
    problems: list[Problem] = []
    text = Text(library, problems)
    root = text.read()
    if root is None:
        raise ScenarioError(problems)
    version = root.child("version")
    if version is not None and (type(version.value) is not int or version.value != VERSION):
        rule = f"is not known; this release reads version {VERSION} of the language, write version: {VERSION}"
        raise ScenarioError([problem_at(root, ("version",), rule)])
    scenario: Scenario | None = None
    try:
        scenario = Scenario.model_validate(root.data())
    except ValidationError as error:
        problems.extend(translate(error, root, Scenario))
    problems.extend(problem_at(root, path, rule) for path, rule in check(Names(root, scenario)))
    provenance = Provenance(main=library.main, sources=text.sources, root=root)
    problems.extend(_read_meshes(library, text, root, provenance))
    if scenario is None:
        raise ScenarioError(_in_order(problems))
    scenario._provenance = provenance
    if scenario.motion.recorded is not None:
        problems.extend(_read_log(library, text, root, scenario))
    if problems:
        raise ScenarioError(_in_order(problems))
    problems.extend(motion_problems(scenario))
    if problems:
        raise ScenarioError(_in_order(problems))
    return scenario


def _read_meshes(library: Library, text: Text, root: Node, provenance: Provenance) -> list[Problem]:
    """Read the files of all mesh shapes; a file is looked for relative to the file that names it."""
    problems = []
    links = root.child("links")
    for link, node in (links.mapping if links is not None else {}).items():
        shapes = node.child("shapes")
        for shape, body in (shapes.mapping if shapes is not None else {}).items():
            kind, file = body.child("type"), body.child("file")
            if kind is None or kind.value != "mesh" or file is None or not isinstance(file.value, str):
                continue
            try:
                name = resolve_name(file.value, text.names[file.place.file])
                if name not in provenance.sources:
                    provenance.sources[name] = library.read(name)
                provenance.meshes[link, shape] = name
            except SourceRule as error:
                problems.append(problem_at(root, ("links", link, "shapes", shape, "file"), str(error)))
    return problems


def _read_log(library: Library, text: Text, root: Node, scenario: Scenario) -> list[Problem]:
    """Read the log of recorded motion, which is looked for like a mesh, and what it says of the joints."""
    from replay.scenario.recorded import PATH, tracks

    node, provenance = find(root, (*PATH, "file")), scenario.provenance
    assert node is not None
    try:
        name = resolve_name(str(node.value), text.names[node.place.file])
        provenance.sources[name] = library.read(name)
    except SourceRule as error:
        return [problem_at(root, (*PATH, "file"), str(error))]
    found, problems = tracks(scenario, library.shown(name), provenance.sources[name])
    provenance.tracks.update(found)
    return problems


def _in_order(problems: list[Problem]) -> list[Problem]:
    unique = {str(problem): problem for problem in problems}
    return sorted(unique.values(), key=lambda problem: (problem.file or "", problem.line or 0, problem.column or 0))
