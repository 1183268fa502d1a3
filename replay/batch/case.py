"""One scenario run into its folder, and what became of it."""

from __future__ import annotations

import dataclasses
import enum
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from replay.errors import NoSpaceError, ReplayError, ScenarioError, UndeterminedClockError, count
from replay.recording.recorded_paths import RecordedPaths
from replay.scenario.measures import Measure, Measures
from replay.scenario.outcome import Outcome

if TYPE_CHECKING:
    from replay.batch.written import WrittenMeasure, WrittenResult
    from replay.guarding.outcome import GuardOutcomes
    from replay.recording.record import Progress
    from replay.scenario.expectation_check import ExpectationCheck
    from replay.scenario.first_frame import FirstFrame
    from replay.scenario.methods import Model
    from replay.scenario.model import Scenario
    from replay.scenario.unseen import Unseen
    from replay.simulation import FrameBlock


class CaseStatus(enum.Enum):
    """What became of a scenario."""

    PASSED = "passed"
    BROKEN = "broken"  # recorded, but an expectation does not hold
    FAILED = "failed"  # an error that says why
    CRASHED = "crashed"
    TIMEOUT = "timeout"
    MEMORY = "memory"
    INTERRUPTED = "interrupted"  # not run to its end, because the whole run was ended

    @property
    def recorded(self) -> bool:
        """Whether there is a whole recording."""
        return self in (CaseStatus.PASSED, CaseStatus.BROKEN)


@dataclass(frozen=True)
class CaseOrder:
    """What a worker needs to run one scenario: its files travel inside the scenario.

    Attributes:
        scenario: what to run.
        folder: for its recordings.
        model: replaces the scenario's own.
        rrd: whether to make a rerun recording too.
        savings: see `simulation.simulate`.
    """

    scenario: Scenario
    folder: Path
    model: Model | None = None
    rrd: bool = True
    savings: bool = True


@dataclass(frozen=True)
class CaseResult:
    """What became of one scenario.

    Attributes:
        name: of the scenario.
        status: passed, or what went wrong.
        frames: frames computed.
        outcomes: what became of each expectation.
        recordings: where they are; None when there are none.
        error: the one line that says why there are none; "" when there are.
        invalid: the scenario itself is at fault: a mesh cannot be used, or no scene can be built of it.
        counters: what the collision pipeline did, by counter.
        seconds: wall time.
        memory: the most resident memory seen [bytes].
        notes: what a reader should know about the scene.
        between_frames: contacts that no frame shows, and what is not proven, a line each.
        measures: its results as numbers: of its expectations, and extremes of its readings.
        guards: what became of each trigger of a guard, see `guarding.outcome.Stop.as_json`; `reactions` says it in
            lines for people.
        reused: taken from an earlier run.
        no_space: it failed because the disk is full.
    """

    name: str
    status: CaseStatus = CaseStatus.PASSED
    frames: int = 0
    outcomes: tuple[Outcome, ...] = ()
    recordings: RecordedPaths | None = None
    error: str = ""
    invalid: bool = False
    counters: dict[str, int] = field(default_factory=dict)
    seconds: float = 0.0
    memory: int = 0
    notes: tuple[str, ...] = ()
    between_frames: tuple[str, ...] = ()
    measures: tuple[Measure, ...] = ()
    guards: tuple[dict[str, Any], ...] = ()
    reactions: tuple[str, ...] = ()
    reused: bool = False
    no_space: bool = False

    def as_json(self) -> dict[str, Any]:
        """Return what result.json holds: nothing that depends on the machine, the clock or the folder."""
        return {
            "scenario": self.name,
            "status": self.status.value,
            "frames": self.frames,
            "error": self.error,
            "expectations": [
                {"expectation": outcome.expectation, "passed": outcome.passed, "detail": outcome.detail}
                for outcome in self.outcomes
            ],
            "counters": self.counters,
            "notes": list(self.notes),
            "between_frames": list(self.between_frames),
            "results": [measure.as_json(self.name) for measure in self.measures],
            **({"guards": list(self.guards), "reactions": list(self.reactions)} if self.guards else {}),
        }

    @staticmethod
    def from_json(values: WrittenResult, recordings: RecordedPaths) -> CaseResult:
        """Return the result that `as_json` wrote, as one that is reused; ValueError if its status is none."""
        return CaseResult(
            name=values["scenario"],
            status=CaseStatus(values["status"]),
            frames=values["frames"],
            outcomes=tuple(Outcome(place=None, **outcome) for outcome in values["expectations"]),
            recordings=recordings,
            error=values["error"],
            counters=values["counters"],
            notes=tuple(values["notes"]),
            between_frames=tuple(values.get("between_frames", ())),
            measures=tuple(map(_measure, values.get("results", ()))),
            guards=tuple(values.get("guards", ())),
            reactions=tuple(values.get("reactions", ())),
            reused=True,
        )


def _measure(row: WrittenMeasure) -> Measure:
    return Measure(row["name"], row["value"], row["unit"], row["time"], row["subject"], row["limit"], row["margin"])


def run_case(order: CaseOrder, progress: Progress) -> CaseResult:
    """Run one scenario into its folder and return what became of it; recordings that exist are replaced."""
    from replay.recording.record import record_blocks
    from replay.scenario.first_frame import FirstFrame
    from replay.scenario.guard_outcomes import lines
    from replay.scenario.scene import build
    from replay.scenario.unseen import Unseen
    from replay.simulation import Simulation

    begin = time.perf_counter()
    scenario = order.scenario
    try:
        scene = build(scenario, model=order.model, savings=order.savings)
        simulation = Simulation(scene)
        check, unseen, measures = scene.expectation_check(), Unseen(scene.layout), Measures(scene.layout)
        reactions = None if simulation.guarding is None else simulation.guarding.outcomes()
        first = FirstFrame(scenario, scene.layout)
        blocks = _checked(simulation.blocks(), check, unseen, measures, first, reactions)
        recordings = record_blocks(scene, blocks, order.folder, rrd=order.rrd, overwrite=True, progress=progress)
        by_machine, told = _beside_machine(scenario, recordings.mcap)
    except ReplayError as error:
        seconds = time.perf_counter() - begin
        return CaseResult(
            scenario.name,
            CaseStatus.FAILED,
            error=str(error),
            invalid=isinstance(error, ScenarioError),
            seconds=seconds,
            no_space=isinstance(error, NoSpaceError),
        )
    stops = [] if reactions is None else reactions.stops()
    outcomes = tuple(check.finish(stops))
    return CaseResult(
        scenario.name,
        CaseStatus.PASSED if all(outcome.passed for outcome in outcomes) else CaseStatus.BROKEN,
        frames=scene.frames,
        outcomes=outcomes,
        recordings=recordings,
        counters=dataclasses.asdict(simulation.collision.counters) if simulation.collision else {},
        seconds=time.perf_counter() - begin,
        notes=(
            *scene.notes,
            *(n for suite in simulation.suites.values() for n in suite.notes()),
            *first.lines(),
            *told,
        ),
        between_frames=unseen.lines(),
        measures=(*(outcome.measure for outcome in outcomes if outcome.measure), *measures.results(), *by_machine),
        guards=tuple(stop.as_json() for stop in stops),
        reactions=tuple(lines(stops)),
    )


def _beside_machine(scenario: Scenario, recording: Path) -> tuple[tuple[Measure, ...], tuple[str, ...]]:
    """Return how far a recording is from the machine's log that its scenario names, as numbers, and what to note.

    That a log does not tell its clock is no failure of the simulation: it is noted.
    """
    if scenario.measured is None:
        return (), ()
    from replay.comparison.measured.measures import measures_of
    from replay.comparison.measured.source import MeasuredSource, compare_scenario

    source = MeasuredSource.of_scenario(scenario)
    assert source is not None
    try:
        return measures_of(compare_scenario(recording, scenario, source)), ()
    except UndeterminedClockError as error:
        return (), (str(error),)


def describe(result: CaseResult) -> list[str]:
    """Return a result as lines for people."""
    if not result.status.recorded:
        return [f"{result.name}: {result.status.value}", *(f"  {line}" for line in result.error.splitlines())]
    pace = f" ({result.frames / result.seconds:.0f} a second)" if result.seconds > 0.0 else ""
    took = "reused" if result.reused else f"in {result.seconds:.1f} s{pace}"
    told = [f"{result.name}: {result.status.value}, {count(result.frames, 'frame')} {took}"]
    for outcome in result.outcomes:
        told.append(f"  {'ok  ' if outcome.passed else 'FAIL'} {outcome.expectation} ({outcome.detail})")
    told.extend(f"  {line}" for line in (*result.reactions, *result.between_frames))
    told.extend(f"  note: {note}" for note in result.notes)
    return told


def _checked(
    blocks: Iterator[FrameBlock],
    check: ExpectationCheck,
    unseen: Unseen,
    measures: Measures,
    first: FirstFrame,
    reactions: GuardOutcomes | None,
) -> Iterator[FrameBlock]:
    for block in blocks:
        first.update(block.collision, block.readings)
        measures.update(block.time, block.collision, block.readings)
        if reactions is not None:
            reactions.update(block.time, block.collision)
        check.update(block.time, block.collision, block.readings)
        unseen.update(block.collision)
        yield block
