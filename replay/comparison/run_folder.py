"""A run folder as others read it: what its run.json says, and the recordings that this lists."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import NotRequired

from typing_extensions import TypedDict

from replay.errors import RecordingError
from replay.json_text import read_json_file, typed
from replay.language.fields import is_title

RUN = "run.json"
"""Name of the file that says what became of a run, in its folder."""
_RECORDED = ("passed", "broken")


class RunScenario(TypedDict):
    """What run.json says of one scenario, as far as it is read."""

    status: str


class RunVerdict(TypedDict):
    """What run.json says of the comparison of one scenario, as far as it is read."""

    cause: NotRequired[str]


class WrittenRun(TypedDict):
    """run.json, as far as it is read."""

    scenarios: dict[str, RunScenario]
    interrupted: bool
    verdicts: NotRequired[dict[str, RunVerdict]]


def read_run(folder: Path) -> WrittenRun:
    """Return what a run folder's run.json says; OSError or ValueError when there is none that replay wrote."""
    return typed(read_json_file(folder / RUN, surrogates=True), WrittenRun)


def recordings_in(folder: Path) -> dict[str, Path]:
    """Return the recordings of a folder by scenario: FOLDER/NAME/NAME.mcap.

    Of a run folder they are those that the last run made or kept, there or not, and not what earlier runs left beside
    them; of a folder without a run.json, such as a baseline, all that there are.

    Raises:
        RecordingError: there are none, run.json is not one that replay wrote, or a folder may not be looked into.
    """
    report = folder / RUN
    listed = os.path.lexists(report)
    if listed:
        found = {name: folder / name / f"{name}.mcap" for name in _listed(folder)}
    else:
        found = {}
        for path in sorted(_below(folder)):
            inside = path.relative_to(folder).with_suffix("")
            name = inside.parent if inside.parent.name == inside.name else inside
            found[name.as_posix()] = path
    if not found:
        what = "its run.json lists no recording" if listed else "holds no recording (*.mcap)"
        raise RecordingError(str(folder), what)
    return found


def _below(folder: Path) -> Iterator[Path]:
    """Yield the recordings in a folder and below; hidden folders hold what is not in place yet."""

    def refuse(error: OSError) -> None:
        raise RecordingError(str(error.filename), f"cannot be looked through: {error.strerror}")

    for place, folders, files in os.walk(folder, onerror=refuse):
        folders[:] = [name for name in folders if not name.startswith(".")]
        yield from (Path(place) / file for file in files if file.endswith(".mcap"))


def _listed(folder: Path) -> list[str]:
    try:
        names = [name for name, entry in read_run(folder)["scenarios"].items() if entry["status"] in _RECORDED]
    except (OSError, ValueError) as error:
        reason = "is not one that replay wrote" if isinstance(error, ValueError) else error.strerror or "is no file"
        raise RecordingError(str(folder / RUN), reason) from None
    for name in names:
        if not is_title(name):
            raise RecordingError(str(folder / RUN), f"{name!r} is no scenario's name")
    return names
