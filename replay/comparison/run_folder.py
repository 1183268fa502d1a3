"""The recordings of a run folder: those that its run.json lists, and not what earlier runs left beside them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from replay.errors import RecordingError

_RECORDED = ("passed", "broken")


def recordings_in(folder: Path) -> dict[str, Path]:
    """Return the recordings of a folder by scenario: FOLDER/NAME/NAME.mcap.

    Of a run folder they are those that the last run made or kept, there or not; of a folder without a run.json, such as
    a baseline, all that there are.

    Raises:
        RecordingError: there are none, or run.json is not one that replay wrote.
    """
    report = folder / "run.json"
    if report.exists():
        found = {name: folder / name / f"{name}.mcap" for name in _listed(report)}
    else:
        found = {}
        for path in sorted(folder.rglob("*.mcap")):
            inside = path.relative_to(folder).with_suffix("")
            name = inside.parent if inside.parent.name == inside.name else inside
            found[name.as_posix()] = path
    if not found:
        what = "its run.json lists no recording" if report.exists() else "holds no recording (*.mcap)"
        raise RecordingError(str(folder), what)
    return found


def _listed(report: Path) -> list[str]:
    try:
        scenarios: Any = json.loads(report.read_text(encoding="utf-8"))["scenarios"]
        names = [str(name) for name, entry in scenarios.items() if entry["status"] in _RECORDED]
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        raise RecordingError(str(report), "is not one that replay wrote") from None
    for name in names:
        if Path(name).name != name or name in (".", ".."):
            raise RecordingError(str(report), f"{name!r} is no scenario's name")
    return names
