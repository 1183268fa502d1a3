"""The signals of one field of two runs, column by column: equal ones are found together, the others one at a time."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from replay.comparison import difference as result
from replay.comparison.events import Matched, StateTrack, match, tracks
from replay.comparison.moments import Moments
from replay.comparison.numbers import Errors, compare_numbers, compare_rotations, root_mean_square
from replay.comparison.rules import Rule, Rules, Tolerance
from replay.comparison.signals import Group, Signal, unify_categories
from replay.numerics.arrays import Column, Flags, Floats, Integers
from replay.numerics.columns import Field, Kind
from replay.numerics.constants import SECOND

_BLOCK_VALUES = 1 << 20
"""Values that are compared at once while equal columns are looked for, which bounds the temporary memory to 16 MiB."""


@dataclass(frozen=True, eq=False)
class MatchedFrames:
    """The frames that two runs have in common.

    Attributes:
        time: (F,) [ns].
        baseline, candidate: (F,) their indices in each recording; None when these are all frames in order.
    """

    time: Integers
    baseline: Integers | None
    candidate: Integers | None

    def baseline_moment(self, index: int) -> result.Moment:
        """Return the frame of the baseline at an index of the matched frames."""
        return self._moment(self.baseline, index)

    def candidate_moment(self, index: int) -> result.Moment:
        """Return the frame of the candidate at an index of the matched frames."""
        return self._moment(self.candidate, index)

    def _moment(self, rows: Integers | None, index: int) -> result.Moment:
        return result.Moment(int(index if rows is None else rows[index]), float(self.time[index]) / SECOND)

    def known(self, a: Moments | None, b: Moments | None) -> tuple[Moments | None, Moments | None]:
        """Return what the baseline and the candidate know of moments, by the matched frames."""
        count = len(self.time)
        return a and a.in_rows(self.baseline, count), b and b.in_rows(self.candidate, count)


Finding = Callable[[Signal, Rule | None], result.SignalDifference]
"""A difference that waits for the signal and the rule that it is told of."""

Gates = dict[tuple[str, str, str], Flags]
"""By topic, field and name of a gate: the matched frames in which one run has a value and the other has none."""


def compare_groups(
    a: Group, b: Group, frames: MatchedFrames, rules: Rules, gates: Gates
) -> Iterator[result.SignalDifference]:
    """Yield how the signals that both groups have differ; nothing for a signal that is equal or ignored.

    One that is ignored until a day is a known difference: it is told as long as it is there, and does not decide.
    A gate's disagreements are added to `gates`, for the groups behind it.
    """
    column_b = {signal: k for k, signal in enumerate(b.signals)}
    common = [(k, column_b[signal]) for k, signal in enumerate(a.signals) if signal in column_b]
    values_a, values_b, categories = unify_categories(a, b)
    columns_a = np.array([k for k, _ in common], dtype=np.int64)
    columns_b = np.array([k for _, k in common], dtype=np.int64)
    changed = _changed(values_a, values_b, frames, columns_a, columns_b)
    known_a, known_b = frames.known(a.moments, b.moments)
    for known, columns in ((known_a, columns_a), (known_b, columns_b)):
        if known is not None:  # what one knows better may differ where the columns do not
            changed |= np.isin(columns, known.column)
    for (k, j), differs in zip(common, changed.tolist(), strict=True):
        signal = a.signals[k]
        rule = rules.rule(signal.full_name)
        tolerance = rules.tolerance(signal.full_name)
        if not differs and tolerance.nan == "equal":
            continue
        x, y = _take(values_a[:, k], frames.baseline), _take(values_b[:, j], frames.candidate)
        if a.field.open:
            _note_gate(gates, signal, a.field, x, y)
        if tolerance.ignore and (rule is None or rule.expires is None):
            continue
        echo = _echo(gates, signal, a.field)
        if a.field.kind.is_state:
            better = known_a and known_a.of(k), known_b and known_b.of(j)
            of = partial(tracks, known=better, between=a.between and b.between)
            found = _compare_states(of, a.field, x, y, categories, frames, tolerance, echo)
        else:
            compare = compare_rotations if a.field.kind is Kind.ROTATION else compare_numbers
            found = _summarise(compare(x, y, tolerance), x, y, frames, echo, a.field.kind, tolerance.rms)
        if found is not None:
            item = found(signal, rule)
            yield dataclasses.replace(item, decides=False) if tolerance.ignore else item


def _changed(a: Column, b: Column, frames: MatchedFrames, columns_a: Integers, columns_b: Integers) -> Flags:
    """Return which columns are not the same bits in all matched frames."""
    changed = np.zeros(len(columns_a), dtype=bool)
    if not len(columns_a):
        return changed
    step = max(1, _BLOCK_VALUES // (len(columns_a) * int(np.prod(a.shape[2:], dtype=np.int64))))
    for begin in range(0, len(frames.time), step):
        window = slice(begin, begin + step)
        x = _block(a, frames.baseline, window, columns_a)
        y = _block(b, frames.candidate, window, columns_b)
        changed |= (x != y).reshape(len(x), len(columns_a), -1).any(axis=(0, 2))
    return changed


def _block(values: Column, rows: Integers | None, window: slice, columns: Integers) -> Column:
    block = values[window] if rows is None else values[rows[window]]
    if len(columns) != values.shape[1] or not np.array_equal(columns, np.arange(len(columns))):
        block = block[:, columns]
    if block.dtype == np.float64:
        return np.ascontiguousarray(block).view(np.uint64)
    return block


def _take(column: Column, rows: Integers | None) -> Column:
    return np.ascontiguousarray(column if rows is None else column[rows])


def _note_gate(gates: Gates, signal: Signal, field: Field, x: Column, y: Column) -> None:
    disagree = np.isin(x, field.open) != np.isin(y, field.open)
    if disagree.any():
        gates[signal.topic, signal.field, signal.name] = disagree


def _echo(gates: Mapping[tuple[str, str, str], Flags], signal: Signal, field: Field) -> Flags | None:
    """Return the frames in which a signal's gate is what differs; a pair has its own gate, a sensor one for all."""
    if field.gate is None:
        return None
    own = gates.get((signal.topic, field.gate, signal.name))
    return gates.get((signal.topic, field.gate, "")) if own is None else own


def _summarise(
    errors: Errors,
    x: Column,
    y: Column,
    frames: MatchedFrames,
    echo: Flags | None,
    kind: Kind,
    bound: float | None,
) -> Finding | None:
    differs, outside = errors.differs | errors.outside, errors.outside
    rms = None if bound is None else root_mean_square(errors.error if echo is None else errors.error[~echo])
    echoes = 0
    if echo is not None:
        echoes = int((differs & echo).sum())
        differs, outside = differs & ~echo, outside & ~echo
    if not differs.any():
        return None
    decisive = outside if outside.any() else differs

    def worst(error: Floats) -> result.Worst | None:
        candidates = differs & np.isfinite(error)
        if not candidates.any():
            return None
        at = int(np.argmax(np.where(candidates, error, -1.0)))
        values = (0.0, float(error[at])) if kind is Kind.ROTATION else (float(x[at]), float(y[at]))
        return result.Worst(float(error[at]), frames.baseline_moment(at), *values)

    return partial(
        result.SignalDifference,
        decides=bool(outside.any()) or (bound is not None and rms is not None and rms > bound),
        rms=rms,
        frames=int(differs.sum()),
        outside=int(outside.sum()),
        first=frames.baseline_moment(int(np.argmax(decisive))),
        worst_abs=worst(errors.error),
        worst_rel=worst(errors.relative),
        least=None if kind is Kind.ROTATION else _least(x, y),
        nan=int((errors.nan & outside).sum()),
        infinite=int((errors.infinite & outside).sum()),
        echo=echoes,
    )


def _least(x: Column, y: Column) -> tuple[float, float] | None:
    if np.isnan(x).all() or np.isnan(y).all():
        return None
    return float(np.nanmin(x)), float(np.nanmin(y))


def _compare_states(
    of: Callable[..., Iterator[StateTrack]],
    field: Field,
    x: Column,
    y: Column,
    categories: tuple[str, ...],
    frames: MatchedFrames,
    tolerance: Tolerance,
    echo: Flags | None,
) -> Finding | None:
    kept = np.arange(len(x)) if echo is None else np.flatnonzero(~echo)
    echoes = 0 if echo is None else int((x[echo] != y[echo]).sum())
    x, y = x[kept], y[kept]
    events: list[result.EventDifference] = []
    count = outside = lone = 0
    max_shift, max_frames = 0.0, 0
    for track in of(field, x, y, categories, time=frames.time[kept]):
        matched = match(track)
        shifts = _Shifts.of(matched, frames, kept, tolerance)
        count += len(matched.state)
        outside += int((~shifts.allowed).sum())
        lone += int((~shifts.paired).sum())
        if shifts.paired.any():
            max_shift = max(max_shift, float(np.abs(shifts.seconds[shifts.paired]).max()))
            max_frames = max(max_frames, int(np.abs(shifts.frames[shifts.paired]).max()))
        events += _listed(track, matched, shifts, frames, kept)
    if not count:
        return None
    events.sort(key=lambda event: ((event.baseline or event.candidate or _START).time, event.what))
    differing = np.flatnonzero(x != y)
    decisive = next((event for event in events if not event.allowed), None)
    first = None if decisive is None else decisive.baseline or decisive.candidate
    return partial(
        result.SignalDifference,
        decides=outside > 0,
        frames=len(differing),
        outside=outside,
        first=first or events[0].baseline or events[0].candidate or _START,
        echo=echoes,
        events=tuple(events[: result.LISTED_EVENTS]),
        event_count=count,
        lone_events=lone,
        max_shift=max_shift,
        max_shift_frames=max_frames,
    )


_START = result.Moment(0, 0.0)


def _at(moment: result.Moment, time: int) -> result.Moment:
    """Return a moment with the frame of another, at its own time [ns]."""
    return result.Moment(moment.frame, float(time) / SECOND)


@dataclass(frozen=True, eq=False)
class _Shifts:
    paired: Flags
    seconds: Floats
    frames: Integers
    allowed: Flags

    @staticmethod
    def of(matched: Matched, frames: MatchedFrames, kept: Integers, tolerance: Tolerance) -> _Shifts:
        paired = (matched.baseline >= 0) & (matched.candidate >= 0)
        from_, to = kept[matched.baseline], kept[matched.candidate]
        nanoseconds = np.where(matched.finer, matched.gap, frames.time[to] - frames.time[from_])
        count = np.abs(to - from_)
        # two frames' times are rounded to nanoseconds: what lies between them is known to 1 ns
        limit = tolerance.time * SECOND + 1.0 if tolerance.time > 0.0 else -1.0
        within = (np.abs(nanoseconds) <= limit) | ((tolerance.frames > 0) & (count <= tolerance.frames))
        if tolerance.bracket is not None:
            within = np.where(matched.finer, np.abs(nanoseconds) <= tolerance.bracket * SECOND, within)
        return _Shifts(paired, nanoseconds / SECOND, to - from_, paired & within)


def _listed(
    track: StateTrack, matched: Matched, shifts: _Shifts, frames: MatchedFrames, kept: Integers
) -> Sequence[result.EventDifference]:
    events = []
    for k in range(min(len(matched.state), result.LISTED_EVENTS)):
        in_a, in_b = int(matched.baseline[k]), int(matched.candidate[k])
        paired = bool(shifts.paired[k])
        events.append(
            result.EventDifference(
                what=track.label(int(matched.state[k])),
                fate=result.Fate.SHIFTED if paired else result.Fate.VANISHED if in_a >= 0 else result.Fate.APPEARED,
                baseline=None if in_a < 0 else _at(frames.baseline_moment(int(kept[in_a])), matched.times[0][k]),
                candidate=None if in_b < 0 else _at(frames.candidate_moment(int(kept[in_b])), matched.times[1][k]),
                shift=float(shifts.seconds[k]) if paired else None,
                shift_frames=int(shifts.frames[k]) if paired else None,
                allowed=bool(shifts.allowed[k]),
            )
        )
    return events
