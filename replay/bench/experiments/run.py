"""All experiments: run them, write their tables and drawings."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from replay.bench.experiments import conductors, prediction, splitting
from replay.bench.experiments.tables import Table
from replay.errors import InvalidValue, RecordingExistsError
from replay.logs.part_file import write_file
from replay.scenario.curve_plot import Panel, draw

EXPERIMENTS: dict[str, Callable[[Path], tuple[list[Table], list[Panel]]]] = {
    "I": splitting.run,
    "II": prediction.run_fit,
    "III": prediction.run_sizes,
    "IV": prediction.run_pivot,
    "V": conductors.run_neighbours,
    "VI": conductors.run_person,
}
"""By number; the first four are the thesis's."""


def run(name: str, folder: Path) -> tuple[list[Table], list[Panel]]:
    """Return the tables and drawings of one experiment.

    Args:
        name: a key of `EXPERIMENTS`.
        folder: with the scenarios of I to IV, `scenarios/experiments` of this project.

    Raises:
        InvalidValue: the folder is not there.
        ScenarioError, CurveError: a scenario or a measured curve in it is not valid.
    """
    if not folder.is_dir():
        raise InvalidValue("--scenarios", folder, "is not there; give the folder scenarios/experiments of this project")
    return EXPERIMENTS[name](folder)


def write(tables: Sequence[Table], panels: Sequence[Panel], directory: Path, *, overwrite: bool) -> list[Path]:
    """Write each table as CSV, and the drawings as one PNG named after the first table; returns the paths.

    Raises:
        RecordingExistsError: one of them exists and `overwrite` is false; nothing is written.
        WriteError: one of them cannot be written.
    """
    files = [directory / f"{table.name}.csv" for table in tables]
    drawing = directory / f"{tables[0].name}.png"
    for path in (*files, drawing):
        if path.exists() and not overwrite:
            raise RecordingExistsError(str(path))
    for path, table in zip(files, tables, strict=True):
        write_file(path, table.csv().encode(), overwrite=overwrite)
    draw(drawing, panels, overwrite=overwrite)
    return [*files, drawing]
