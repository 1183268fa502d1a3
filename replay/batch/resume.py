"""Results of an earlier run that may be used again: only when nothing that they depend on has changed."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from replay.batch.case import CaseResult
from replay.batch.written import RESULT, read_result
from replay.errors import RecordingError
from replay.logs.mcap_reader import McapLog
from replay.recording.provenance import code_identity, library_versions
from replay.recording.reader import read_files, read_provenance
from replay.recording.recorded_paths import RecordedPaths
from replay.scenario.methods import Model
from replay.scenario.model import Scenario


def earlier_result(
    scenario: Scenario, folder: Path, *, model: Model | None, rrd: bool, savings: bool = True
) -> CaseResult | str:
    """Return the result in a scenario's folder, or why it cannot be used again.

    The recording's checksums are verified, and what it says of itself is compared with what a run would say now: the
    scenario's files and meshes by SHA-256, and those of which it needs an excerpt alone; the model, the package's
    sources, the libraries.

    Args:
        scenario: what is to be run.
        folder: where an earlier run may have left its recordings.
        model: replaces the scenario's own.
        rrd: whether a rerun recording is wanted too.
        savings: whether it is wanted with savings.
    """
    paths = RecordedPaths(folder / f"{scenario.name}.mcap", folder / f"{scenario.name}.rrd" if rrd else None)
    for path in (paths.mcap, *([paths.rrd] if paths.rrd else []), folder / RESULT):
        try:
            if not path.is_file():
                return f"there is no {path.name}"
            if path.is_symlink() or folder.is_symlink():
                return f"{path.name} is a link, or in a folder that is one"
        except OSError as error:
            return f"{path.name} cannot be looked for: {error.strerror}"
    try:
        with McapLog(paths.mcap) as log:
            found = read_provenance(log)
            read_files(log, found)  # are those that it states
        result = CaseResult.from_json(read_result(folder / RESULT), paths)
    except RecordingError as error:
        return error.reason
    except (OSError, ValueError):
        return f"{RESULT} is not one that replay wrote"
    if result.name != scenario.name or not result.status.recorded or result.frames != found.frames:
        return f"{RESULT} belongs to another recording"
    now = {"scenario": scenario.name, "root": scenario.main_source, "code": code_identity()}
    changed = [what for what, value in now.items() if getattr(found, what) != value]
    changed += _changes("file ", found.files, scenario.sha256)
    changed += _changes("original of ", _digests(found.originals), _digests(scenario.provenance.originals))
    changed += _changes("model ", found.model, (model or scenario.model).identity(savings=savings))
    changed += _changes("version of ", found.libraries, library_versions())
    return f"changed: {', '.join(changed)}" if changed else result


def _changes(what: str, before: Mapping[str, str], now: Mapping[str, str]) -> list[str]:
    return [f"{what}{name}" for name in sorted({*before, *now}) if before.get(name) != now.get(name)]


def _digests(originals: Mapping[str, Mapping[str, str]]) -> dict[str, str]:
    return {name: origin.get("sha256", "") for name, origin in originals.items()}
