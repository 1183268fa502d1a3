"""A recording and a log of the machine to what the one says beside the other."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING

import numpy as np

from replay.alignment.clock import ClockEstimate, LogClock, Undetermined
from replay.alignment.estimate import estimate_clock
from replay.alignment.hints import hints
from replay.alignment.pair import SignalPair, fitted, on_same_turn
from replay.alignment.residuals import SampledFrames, match
from replay.alignment.statistics import statistics
from replay.comparison.columns import MatchedFrames, compare_groups
from replay.comparison.difference import Absence, Difference, Frames, SignalDifference
from replay.comparison.measured.result import MeasuredClock, MeasuredComparison, MeasuredSignal
from replay.comparison.measured.rules import MEASURED, MeasuredRules, detection_of
from replay.comparison.measured.signals import SimulatedSignal, simulated_signals
from replay.comparison.rules import Rule, Rules
from replay.comparison.runs import COLLISION
from replay.comparison.signals import Group, Signal
from replay.errors import Problem, ScenarioError, UndeterminedClockError
from replay.language.node import KeyPath
from replay.numerics.arrays import Column, Integers
from replay.numerics.columns import Field, Kind
from replay.numerics.constants import SECOND
from replay.recording.reader import Recording
from replay.scenario.measured_log import PATH, MeasuredLog
from replay.scenario.problems import did_you_mean

if TYPE_CHECKING:
    from replay.scenario.measured import MeasuredMapPart


def compare(
    recording: Recording,
    written: MeasuredMapPart,
    log: MeasuredLog,
    *,
    rules: Rules | None = None,
    problem: Callable[[KeyPath, str], Problem],
) -> MeasuredComparison:
    """Return what a recording says beside a log of the machine.

    Args:
        recording: with the topics of the signals.
        written: which channels measure which signals, and when.
        log: what it says of them.
        rules: tolerances; without them everything must be equal.
        problem: returns that a rule is broken at a path of the language, with its place.

    Raises:
        ScenarioError: the recording does not have a signal.
        UndeterminedClockError: a clock is to be found, and the signals do not tell it.
    """
    mine = MeasuredRules.made_of(rules or Rules(), recording.provenance.scenario)
    simulated = simulated_signals(recording, written.signals.keys())
    missing = [name for name in written.signals if name not in simulated]
    if missing:
        rule = (
            f"is no signal of the recording; {did_you_mean(missing[0], simulated, what='of those written there are')}"
        )
        raise ScenarioError([problem((*PATH, "signals", missing[0]), rule)])
    seconds = recording.time / SECOND
    pairs = {
        name: SignalPair(
            name, seconds, one.values, log.series[name].time, log.series[name].value, one.field.kind.is_state
        )
        for name, one in simulated.items()
    }
    clocks = {name: _clock(name, written, pairs, log.zero, problem) for name in written.clock_names()}
    signals = tuple(
        _signal(
            recording.time,
            simulated[name],
            _turned(pairs[name], clocks[part.clock].used, log.series[name].turn),
            clocks[part.clock],
            part.fit,
            written.max_gap,
            mine,
        )
        for name, part in written.signals.items()
    )
    return MeasuredComparison(
        log=log.origin["name"],
        origin=dict(log.origin),
        frames=len(recording.time),
        clocks=tuple(clocks.values()),
        signals=signals,
        difference=_difference(recording.provenance.scenario, signals, mine),
    )


def _turned(pair: SignalPair, clock: LogClock, turn: float) -> SignalPair:
    return on_same_turn(pair, clock, turn) if turn else pair


def _clock(
    name: str | None,
    written: MeasuredMapPart,
    pairs: Mapping[str, SignalPair],
    zero: int,
    problem: Callable[[KeyPath, str], Problem],
) -> MeasuredClock:
    """Return a clock as it is given, or as its signals tell it."""
    part = written.clock(name)
    told = _told([pairs[signal] for signal, of in written.signals.items() if of.clock == name], part.drift != "none")
    if part.offset is None:
        if isinstance(told, ClockEstimate):
            return MeasuredClock(name or "", told, told, given=False, zero=zero)
        path = (*PATH, "offset") if name is None else (*PATH, "clocks", name, "offset")
        rule = f"cannot be estimated: {told.reason}; state the offset"
        raise UndeterminedClockError(problem(path, rule), told.reason, told.candidates)
    drift = told.drift if isinstance(told, ClockEstimate) else 0.0
    used = LogClock(part.offset, drift)
    return MeasuredClock(name or "", used, told, given=True, zero=zero, note=_disagreement(used, told))


def _told(pairs: list[SignalPair], drift: bool) -> ClockEstimate | Undetermined:
    """Return what signals tell of their clock; looked for is every offset at which log and scenario overlap."""
    begins = [float(pair.measured_time[0]) for pair in pairs if len(pair.measured_time)]
    ends = [float(pair.measured_time[-1]) for pair in pairs if len(pair.measured_time)]
    if not begins or not len(pairs[0].time):
        return Undetermined("there is no sample in the time of interest")
    lowest, highest = float(pairs[0].time[0]) - max(ends), float(pairs[0].time[-1]) - min(begins)
    if not lowest < highest:
        return Undetermined("one frame and one sample tell no time")
    return estimate_clock(pairs, drift=drift, lowest=lowest, highest=highest)


def _disagreement(used: LogClock, told: ClockEstimate | Undetermined) -> str:
    if isinstance(told, Undetermined):
        return f"the offset is not checked: {told.reason}"
    given = used.offset + used.drift * (told.reference - used.reference)
    low, high = told.offset_interval
    if low <= given <= high:
        return ""
    return f"the signals tell another offset: {told.offset:.6g} s, between {low:.6g} and {high:.6g} s"


def _signal(
    time: Integers,
    simulated: SimulatedSignal,
    pair: SignalPair,
    clock: MeasuredClock,
    fit: bool,
    max_gap: float,
    rules: MeasuredRules,
) -> MeasuredSignal:
    matched = match(pair, clock.used, max_gap=max_gap)
    numbers = statistics(matched)
    told = hints(matched, numbers)
    line = numbers.fit if fit else None
    if line is not None:
        matched = match(fitted(pair, line.scale, line.offset), clock.used, max_gap=max_gap)
        numbers = statistics(matched)
    differences = (
        *_values(time, simulated, matched, rules),
        *_detections(time, simulated.signal, matched, rules),
    )
    return MeasuredSignal(
        signal=simulated.signal,
        clock=clock.name,
        matched=matched,
        statistics=numbers,
        hints=told,
        fit=None if line is None else (line.scale, line.offset),
        rule=rules.rule(simulated.signal.full_name),
        differences=differences,
    )


def _values(
    time: Integers, simulated: SimulatedSignal, matched: SampledFrames, rules: Rules
) -> Iterator[SignalDifference]:
    """Yield how the values differ where both have one."""
    column = simulated.column if simulated.field.kind.is_state else matched.pair.value
    measured = simulated.states(matched.at_frames)
    yield from _compared(time, simulated.field, simulated.signal, measured, column, matched.frames, rules)


def _detections(time: Integers, signal: Signal, matched: SampledFrames, rules: Rules) -> Iterator[SignalDifference]:
    """Yield how it differs when there is a value at all, over the frames for which the log says it.

    A clearance that is not evaluated is not one that is not there.
    """
    if signal.topic == COLLISION:
        return
    field = Field("detected", Kind.FLAG, begins=("detection",))
    rows = np.flatnonzero(matched.enclosed)
    there = matched.measured_there, matched.simulated_there
    yield from _compared(time, field, detection_of(signal), *there, rows, rules)


def _compared(
    time: Integers, field: Field, signal: Signal, measured: Column, simulated: Column, rows: Integers, rules: Rules
) -> Iterator[SignalDifference]:
    """Yield how two columns (F,) differ in some frames, by the rules of `diff`: the log is the baseline."""
    if len(rows):
        log, recording = (Group(field, (signal,), column[:, None]) for column in (measured, simulated))
        yield from compare_groups(log, recording, MatchedFrames(time[rows], rows, rows), rules, {})


def _difference(scenario: str, signals: tuple[MeasuredSignal, ...], rules: MeasuredRules) -> Difference:
    """Return the comparison as `diff` tells one; a signal without any sample in the scenario's time is missing."""
    found = [item for signal in signals for item in signal.differences]
    uncovered = [signal.signal for signal in signals if not signal.covered]
    covered = [signal.matched.enclosed for signal in signals if signal.covered]
    missing = tuple(
        Absence(
            topic=signal.topic,
            name="/".join(filter(None, [signal.field, signal.name])),
            signals=(signal,),
            whole_topic=False,
            same_as=None,
            decides=not rules.tolerance(signal.full_name).ignore,
        )
        for signal in uncovered
    )
    difference = Difference(
        name=scenario,
        provenance=(),
        scene=(),
        frames=Frames(matched=int(np.any(covered, axis=0).sum()) if covered else 0),
        missing=missing,
        extra=(),
        signals=tuple(sorted(found, key=lambda item: (not item.decides, item.signal))),
        compared=len(signals) - len(missing),
    )
    names = [item.signal.full_name for item in difference.deciding]
    names += [signal.full_name for absence in missing if absence.decides for signal in absence.signals]
    return dataclasses.replace(difference, expired=tuple(_expired(names, rules)))


def _expired(names: list[str], rules: Rules) -> Iterator[Rule]:
    for rule in rules.expired:
        if any(rule.matches(name) or rule.matches(f"{MEASURED}{name}") for name in names):
            yield rule
