"""A YAML file that stands by itself, with no includes: a model, rules, a map of a log."""

from __future__ import annotations

from pathlib import Path

from replay.errors import Problem, ScenarioError
from replay.language.node import Node
from replay.scenario.source import Folder, SourceRule
from replay.scenario.yaml_text import parse


def read_yaml(path: Path, *, besides: str = "") -> Node:
    """Return what a file holds.

    Args:
        path: of the file.
        besides: what is said after the reason why it cannot be read.

    Raises:
        ScenarioError: it cannot be read, or is no YAML; each with file, line and column.
    """
    library = Folder(path)
    shown = library.shown(library.main)
    problems: list[Problem] = []
    try:
        root = parse(library.read(library.main), shown, problems)
    except SourceRule as error:
        raise ScenarioError([Problem(f"{error}{besides}", file=shown)]) from None
    if root is None or problems:
        raise ScenarioError(problems)
    return root
