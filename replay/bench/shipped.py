"""The scenarios that the source tree ships, where the package runs from it."""

from __future__ import annotations

from pathlib import Path

import replay
from replay.errors import ReplayError, ScenarioError
from replay.scenario.load import load
from replay.scenario.model import Scenario

FOLDER = Path(replay.__file__).parents[1] / "scenarios"


def shipped(name: str) -> Scenario | str:
    """Return the scenario of a name, or why it is not at hand: no source tree, or no human body (pyskindose)."""
    path = FOLDER / f"{name}.yaml"
    if not path.is_file():
        return "not at hand: the scenarios are part of the source tree, not of the package"
    try:
        return load(path)
    except ScenarioError as error:
        return _first_line(error)


def _first_line(error: ReplayError) -> str:
    return str(error).splitlines()[0]
