"""One scenario after another into a run folder: recordings, result.json and log.txt for each, run.json for all."""

from __future__ import annotations

import dataclasses
import datetime
import json
import platform
import time
import traceback
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import replay
from replay.errors import RecordingExistsError, ReplayError, WriteError
from replay.recording.record import Progress, RecordedPaths, record_blocks
from replay.scenario.methods import Model
from replay.scenario.model import Scenario
from replay.scenario.scene import build
from replay.scenario.verdict import ExpectationCheck, Outcome
from replay.simulation import FrameBlock, Simulation


@dataclass(frozen=True)
class CaseResult:
    """What became of one scenario.

    Attributes:
        name: of the scenario.
        frames: frames computed.
        outcomes: what became of each expectation.
        recordings: where they are; None when the scenario failed before there were any.
        error: the one line that says why it failed; "" when it did not.
        trace: where in the program it crashed, for log.txt; "" when its failure has a known cause.
        counters: what the collision pipeline did, by counter.
        seconds: wall time.
        notes: what a reader should know about the scene.
    """

    name: str
    frames: int = 0
    outcomes: tuple[Outcome, ...] = ()
    recordings: RecordedPaths | None = None
    error: str = ""
    trace: str = ""
    counters: dict[str, int] = field(default_factory=dict)
    seconds: float = 0.0
    notes: tuple[str, ...] = ()

    @property
    def broken(self) -> tuple[Outcome, ...]:
        """The expectations that did not hold."""
        return tuple(outcome for outcome in self.outcomes if not outcome.passed)

    @property
    def status(self) -> str:
        """Return "passed", "broken" (an expectation does not hold) or "failed" (no result)."""
        return "failed" if self.error else "broken" if self.broken else "passed"

    def as_json(self) -> dict[str, Any]:
        """Return what result.json holds: nothing that depends on the machine, the clock or the folder."""
        return {
            "scenario": self.name,
            "status": self.status,
            "frames": self.frames,
            "error": self.error,
            "expectations": [
                {"expectation": outcome.expectation, "passed": outcome.passed, "detail": outcome.detail}
                for outcome in self.outcomes
            ],
            "counters": self.counters,
            "notes": list(self.notes),
        }


def run_all(
    scenarios: Sequence[Scenario],
    directory: str | Path,
    *,
    model: Model | None = None,
    rrd: bool = True,
    overwrite: bool = False,
    progress: Callable[[Scenario], Progress] | None = None,
    done: Callable[[CaseResult], None] | None = None,
) -> list[CaseResult]:
    """Run scenarios one after another, each into DIRECTORY/NAME/, and write DIRECTORY/run.json.

    A scenario that fails does not stop the others; its result says why.

    Args:
        scenarios: what to run.
        directory: the run folder; made when it is not there.
        model: replaces the scenarios' own models.
        rrd: whether to make rerun recordings too.
        overwrite: replace recordings that exist.
        progress: called at the start of each scenario for what follows its frames.
        done: called with each result.

    Raises:
        RecordingExistsError: a recording exists and may not be overwritten; nothing is run then.
        WriteError: the run folder cannot be written.
    """
    directory = Path(directory)
    for scenario in scenarios if not overwrite else ():
        for recording in (directory / scenario.name / f"{scenario.name}{kind}" for kind in (".mcap", ".rrd")):
            if recording.exists():
                raise RecordingExistsError(str(recording))
    started = datetime.datetime.now(datetime.UTC)
    results = []
    try:
        for scenario in scenarios:
            follow = progress(scenario) if progress else None
            result = run_case(scenario, directory, model=model, rrd=rrd, overwrite=overwrite, progress=follow)
            results.append(result)
            if done:
                done(result)
    finally:
        _write_run(directory, started, results, len(scenarios))
    return results


def run_case(
    scenario: Scenario,
    directory: Path,
    *,
    model: Model | None = None,
    rrd: bool = True,
    overwrite: bool = False,
    progress: Progress | None = None,
) -> CaseResult:
    """Run one scenario into DIRECTORY/NAME/ and return what became of it; arguments as of `run_all`."""
    begin = time.perf_counter()
    folder = directory / scenario.name
    try:
        scene = build(scenario, model=model)
        simulation = Simulation(scene)
        check = scene.expectation_check()
        blocks = _checked(simulation.blocks(), check)
        recordings = record_blocks(scene, blocks, folder, rrd=rrd, overwrite=overwrite, progress=progress)
    except WriteError:
        raise  # no later scenario could be written either
    except ReplayError as error:
        result = CaseResult(scenario.name, error=str(error), seconds=time.perf_counter() - begin)
    except Exception as error:  # a crash is this scenario's result; the night goes on with the next
        result = CaseResult(
            scenario.name,
            error=f"crashed: {type(error).__name__}: {error}",
            trace=traceback.format_exc(),
            seconds=time.perf_counter() - begin,
        )
    else:
        result = CaseResult(
            scenario.name,
            frames=scene.frames,
            outcomes=tuple(check.finish()),
            recordings=recordings,
            counters=dataclasses.asdict(simulation.collision.counters) if simulation.collision else {},
            seconds=time.perf_counter() - begin,
            notes=scene.notes,
        )
    _write(folder / "result.json", json.dumps(result.as_json(), indent=1) + "\n")
    _write(folder / "log.txt", "".join(f"{line}\n" for line in describe(result)) + result.trace)
    return result


def describe(result: CaseResult) -> list[str]:
    """Return a result as lines for people."""
    if result.error:
        return [f"{result.name}: failed", *(f"  {line}" for line in result.error.splitlines())]
    pace = result.frames / result.seconds if result.seconds > 0.0 else 0.0
    lines = [f"{result.name}: {result.status}, {result.frames} frames in {result.seconds:.1f} s ({pace:.0f} a second)"]
    for outcome in result.outcomes:
        lines.append(f"  {'ok  ' if outcome.passed else 'FAIL'} {outcome.expectation} ({outcome.detail})")
    lines.extend(f"  note: {note}" for note in result.notes)
    return lines


def report(result: CaseResult) -> list[str]:
    """Return a result as lines for people, and where its recordings are."""
    made = result.recordings
    return [*describe(result), *(f"  {path}" for path in ((made.mcap, made.rrd) if made else ()) if path)]


def _checked(blocks: Iterator[FrameBlock], check: ExpectationCheck) -> Iterator[FrameBlock]:
    for block in blocks:
        check.update(block.time, block.collision, block.distance, block.capacitive)
        yield block


def _write_run(directory: Path, started: datetime.datetime, results: Sequence[CaseResult], planned: int) -> None:
    """Write what belongs to this machine and this moment, beside recordings that know neither."""
    content = {
        "replay": replay.__version__,
        "host": platform.node(),
        "python": platform.python_version(),
        "started": started.isoformat(timespec="seconds"),
        "seconds": round((datetime.datetime.now(datetime.UTC) - started).total_seconds(), 3),
        "planned": planned,
        "scenarios": {
            result.name: {"status": result.status, "seconds": round(result.seconds, 3)} for result in results
        },
    }
    _write(directory / "run.json", json.dumps(content, indent=1) + "\n")


def _write(path: Path, text: str) -> None:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise WriteError(str(path), error.strerror or str(error)) from None
