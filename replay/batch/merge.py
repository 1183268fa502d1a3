"""Several parts of a night (shards) as one: the scenarios' folders together, and reports over all of them."""

from __future__ import annotations

import contextlib
import datetime
import os
import shutil
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NotRequired

from typing_extensions import TypedDict

from replay.batch.baseline import check_name
from replay.batch.case import CaseResult, CaseStatus
from replay.batch.claim import claim
from replay.batch.finding import Finding, WrittenFinding
from replay.batch.judged import Judged, Regression, RegressVerdict
from replay.batch.run_file import Run
from replay.batch.written import RESULT, read_result
from replay.comparison.run_folder import RUN
from replay.errors import InvalidValue
from replay.json_text import read_json_file, typed
from replay.logs.part_file import write_error
from replay.recording.recorded_paths import RecordedPaths


class _Scenario(TypedDict):
    """What run.json says of the run of a scenario."""

    status: str
    seconds: float
    memory: int
    error: NotRequired[str]


class _Verdict(TypedDict):
    """What run.json says of the comparison of a scenario."""

    verdict: str
    message: NotRequired[str]
    finding: NotRequired[WrittenFinding]
    tags: NotRequired[list[str]]
    source: NotRequired[str]


class _Part(TypedDict):
    """run.json of a part of a night."""

    started: str
    seconds: float
    workers: int
    interrupted: bool
    baseline: str
    rules: str
    model: str
    scenarios: dict[str, _Scenario]
    verdicts: dict[str, _Verdict]
    unused_baselines: list[str]


def merge(parts: Sequence[Path], directory: Path) -> Regression:
    """Put parts of a night into one run folder and return what they say together; `write_reports` completes it.

    Files are linked (hard links) where that is possible, and copied elsewhere. A scenario that one part ran and others
    skipped has the verdict of the one.

    Args:
        parts: run folders that `regress` wrote.
        directory: the run folder of the whole night; empty, or not there yet.

    Raises:
        InvalidValue: a part is no such folder, two ran the same scenario or differ in baseline, rules or model, or the
            folder is not empty.
        BusyError: another process writes one of the folders.
        WriteError: the folder cannot be written.
    """
    if directory.exists() and (not directory.is_dir() or any(directory.iterdir())):
        raise InvalidValue("-o", directory, "is not empty; a merged night gets a folder of its own")
    read = {part: _read(part) for part in parts}
    _same_conditions(read)
    owner: dict[str, Path] = {}
    for part, values in read.items():
        for name, entry in values["verdicts"].items():
            check_name(name)
            if entry["verdict"] == RegressVerdict.SKIPPED.value:
                continue
            if name in owner:
                raise InvalidValue(
                    "RUNDIR", part, f"holds {name!r}, and so does {owner[name]}; parts share no scenario"
                )
            owner[name] = part
    with contextlib.ExitStack() as claims:
        claims.enter_context(claim(directory))
        for part in parts:
            claims.enter_context(claim(part, shared=True))
        judged: dict[str, Judged] = {}
        for part, values in read.items():
            for name, entry in values["verdicts"].items():
                if owner.get(name) == part:
                    _bring(part / name, directory / name)
                    judged[name] = _judged(name, entry, values["scenarios"].get(name), directory)
                elif name not in owner:
                    judged.setdefault(name, Judged(name, RegressVerdict.SKIPPED, entry.get("message", "")))
    first = next(iter(read.values()))
    results = tuple(item.result for item in judged.values() if item.result is not None)
    run = Run(
        directory,
        results,
        any(values["interrupted"] for values in read.values()),
        min(_moment(part, values) for part, values in read.items()),
        max(values["seconds"] for values in read.values()),
        sum(values["workers"] for values in read.values()),
    )
    unused = set.intersection(*(set(values["unused_baselines"]) for values in read.values()))
    return Regression(
        run, Path(first["baseline"]), first["rules"], first["model"], tuple(judged.values()), tuple(sorted(unused))
    )


def _read(part: Path) -> _Part:
    try:
        return typed(read_json_file(part / RUN, surrogates=True), _Part)
    except PermissionError as error:
        raise InvalidValue("RUNDIR", part, f"has a run.json that cannot be read: {error.strerror}") from None
    except (OSError, ValueError):
        raise InvalidValue("RUNDIR", part, "holds no run.json of a `replay regress` that came to its end") from None


def _same_conditions(read: dict[Path, _Part]) -> None:
    (first, known), *others = read.items()
    for part, values in others:
        for key in ("baseline", "rules", "model"):
            a, b = (str(one.get(key)) for one in (known, values))
            if a != b:
                raise InvalidValue("RUNDIR", part, f"was compared with {key} {b!r}, and {first} with {a!r}")


def _moment(part: Path, values: _Part) -> datetime.datetime:
    try:
        return datetime.datetime.fromisoformat(values["started"])
    except ValueError:
        raise InvalidValue("RUNDIR", part, f"has a run.json of {values['started']!r}, which is no time") from None


def _bring(source: Path, target: Path) -> None:
    """Link or copy the files of a scenario's folder; what is no file of it is left."""
    try:
        there = source.is_dir() and not source.is_symlink()
        files = [file for file in sorted(source.iterdir()) if file.is_file() and not file.is_symlink()] if there else []
    except OSError as error:
        raise InvalidValue("RUNDIR", source, f"cannot be looked through: {error.strerror}") from None
    try:
        target.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise write_error(target, error) from None
    for file in files:
        try:
            os.link(file, target / file.name)
        except OSError:
            _copy(file, target / file.name)


def _copy(file: Path, target: Path) -> None:
    try:
        stream = file.open("rb")
    except OSError as error:
        raise InvalidValue("RUNDIR", file, f"cannot be read: {error.strerror}") from None
    try:
        with stream, target.open("wb") as copy:
            shutil.copyfileobj(stream, copy)
    except OSError as error:
        raise write_error(target, error) from None


def _judged(name: str, entry: _Verdict, ran: _Scenario | None, directory: Path) -> Judged:
    folder = directory / name
    try:
        verdict = RegressVerdict(entry["verdict"])
        finding = Finding.from_json(entry["finding"]) if "finding" in entry else None
        status = CaseStatus(ran["status"]) if ran is not None else CaseStatus.FAILED
    except ValueError as error:
        raise InvalidValue("RUNDIR", directory, f"has a run.json with {error}") from None
    result: CaseResult | None = None
    if ran is not None:
        timed: dict[str, Any] = {"seconds": ran["seconds"], "memory": ran["memory"]}
        result = CaseResult(name, status, error=ran.get("error", ""), **timed)
        try:
            known = CaseResult.from_json(read_result(folder / RESULT), RecordedPaths(folder / f"{name}.mcap", None))
            if (known.name, known.status) != (name, status):
                raise ValueError(f"is of {known.name!r}, {known.status.value}")
            result = replace(known, **timed, reused=False)
        except FileNotFoundError:  # one that has not ended has none
            pass
        except (OSError, ValueError) as error:
            note = f"its {RESULT} is left out: {error}"
            result = replace(result, notes=(note,))
    return Judged(
        name, verdict, entry.get("message", ""), result, finding, entry.get("source", ""), tuple(entry.get("tags", ()))
    )
