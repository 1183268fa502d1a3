"""What differs between two recordings: the one result that every report reads."""

from __future__ import annotations

import dataclasses
import enum
import math
from dataclasses import dataclass
from typing import Any

from replay.comparison.rules import Rule
from replay.comparison.signals import Signal

JSON_VERSION = 1
LISTED_EVENTS = 1000
"""Events of one signal that are kept one by one; all are counted."""


class DiffVerdict(enum.Enum):
    """Whether two runs are the same as far as the rules say."""

    SAME = "same"
    DIFFERENT = "different"
    UNREADABLE = "unreadable"  # a recording of theirs cannot be read, so nobody knows


class Fate(enum.Enum):
    """How an event of one run relates to the other run."""

    SHIFTED = "shifted"  # in both, at different times
    VANISHED = "vanished"  # only in the baseline
    APPEARED = "appeared"  # only in the candidate


@dataclass(frozen=True)
class Change:
    """A named value that differs; None in the run that lacks it."""

    name: str
    baseline: str | None
    candidate: str | None


@dataclass(frozen=True)
class Moment:
    """A frame of the baseline and its time [s]."""

    frame: int
    time: float


@dataclass(frozen=True)
class Worst:
    """The largest error of a signal, where it is, and the two values there (for rotations: 0 and the angle)."""

    error: float
    at: Moment
    baseline: float
    candidate: float


@dataclass(frozen=True)
class EventDifference:
    """A change of state that is not at the same time in both runs.

    Attributes:
        what: such as "contact begins".
        baseline, candidate: when; None in the run that lacks it. Frames count in the run's own recording.
        shift: candidate minus baseline [s]; None unless shifted. `shift_frames` the same in frames.
        allowed: the rules accept it.
    """

    what: str
    fate: Fate
    baseline: Moment | None
    candidate: Moment | None
    shift: float | None
    shift_frames: int | None
    allowed: bool


@dataclass(frozen=True)
class SignalDifference:
    """How one signal differs; `decides` is false when the rules accept all of it, or ignore it for now.

    Attributes:
        rule: the rule that was applied, None for exact.
        frames: number of frames in which the values differ.
        outside: of these, frames outside the tolerance; for states, events that are not accepted.
        first: the first frame outside the tolerance, or that differs when none is outside.
        worst_abs, worst_rel: over all frames that differ by a finite number.
        rms: root mean square of the differences in all frames; None where the rule does not bound it.
        least: the smallest number of each run over all common frames; None where one has none, and for states.
        nan: frames in which NaN is not accepted: in one run only, or in any under `nan: fail`.
        infinite: frames with an infinity in one run only, or two of opposite sign.
        echo: further frames that differ only because another signal says that there is no value.
        events: for states, by time; the first `LISTED_EVENTS` of `event_count`.
        max_shift, max_shift_frames: largest shift of an event [s].
    """

    signal: Signal
    rule: Rule | None
    decides: bool
    frames: int
    outside: int
    first: Moment
    worst_abs: Worst | None = None
    worst_rel: Worst | None = None
    least: tuple[float, float] | None = None
    nan: int = 0
    infinite: int = 0
    echo: int = 0
    events: tuple[EventDifference, ...] = ()
    event_count: int = 0
    lone_events: int = 0
    max_shift: float = 0.0
    max_shift_frames: int = 0
    rms: float | None = None

    @property
    def spread(self) -> bool:
        """Whether the root mean square of the differences is larger than the rule accepts."""
        bound = None if self.rule is None else self.rule.tolerance.rms
        return bound is not None and self.rms is not None and self.rms > bound


@dataclass(frozen=True)
class Frames:
    """How the frames of two runs correspond, by integer nanoseconds."""

    matched: int
    missing: int = 0
    extra: int = 0
    first_missing: Moment | None = None
    first_extra: Moment | None = None
    decides: bool = False


@dataclass(frozen=True)
class Absence:
    """Signals of one sensor, pair, joint or link that only one of the runs has.

    Attributes:
        topic, name: what they belong to; `name` is "" when the whole topic or all of its scalars are meant.
        signals: which.
        whole_topic: the other run has nothing under this topic.
        same_as: (topic, name) that only the other run has, with exactly the same readings: probably renamed.
        decides: false when the rules ignore all of them.
    """

    topic: str
    name: str
    signals: tuple[Signal, ...]
    whole_topic: bool
    same_as: tuple[str, str] | None
    decides: bool

    @property
    def label(self) -> str:
        """What is absent, in words."""
        return f"topic {self.topic}" if self.whole_topic else f"{self.topic} {self.name}".rstrip()


@dataclass(frozen=True)
class Difference:
    """Everything in which a candidate differs from a baseline.

    Attributes:
        name: of the scenario.
        provenance: versions, model, inputs, libraries; decides only when `strict_provenance`.
        scene: what the scene or the schemas are made of; decides unless a rule ignores it.
        missing, extra: only in the baseline; only in the candidate.
        signals: the signals that differ, those that decide first.
        compared: number of signals that both have.
        expired: rules that no longer apply, and would have applied to something that now decides.
    """

    name: str
    provenance: tuple[Change, ...]
    scene: tuple[Change, ...]
    frames: Frames
    missing: tuple[Absence, ...]
    extra: tuple[Absence, ...]
    signals: tuple[SignalDifference, ...]
    compared: int
    expired: tuple[Rule, ...] = ()
    strict_provenance: bool = False

    @property
    def verdict(self) -> DiffVerdict:
        """Different when anything decides."""
        decides = (
            (self.strict_provenance and self.provenance)
            or self.scene
            or self.frames.decides
            or any(absence.decides for absence in (*self.missing, *self.extra))
            or any(signal.decides for signal in self.signals)
        )
        return DiffVerdict.DIFFERENT if decides else DiffVerdict.SAME

    @property
    def deciding(self) -> tuple[SignalDifference, ...]:
        """The signals outside their tolerances."""
        return tuple(signal for signal in self.signals if signal.decides)

    @property
    def accepted(self) -> tuple[SignalDifference, ...]:
        """The signals that differ within their tolerances."""
        return tuple(signal for signal in self.signals if not signal.decides)

    def as_json(self) -> dict[str, Any]:
        """Return JSON values; NaN and infinities as the texts "NaN", "Infinity", "-Infinity", times in seconds."""
        values: dict[str, Any] = _plain(self)
        return {"version": JSON_VERSION, "verdict": self.verdict.value, **values}


def _plain(value: Any) -> Any:
    if isinstance(value, Signal):
        return {
            "full_name": value.full_name,
            **{key: getattr(value, key) for key in ("topic", "field", "name", "unit")},
        }
    if isinstance(value, Rule):
        expires = None if value.expires is None else value.expires.isoformat()
        tolerance = dataclasses.asdict(value.tolerance)
        only = {"scenarios": list(value.scenarios)} if value.scenarios else {}
        link = {} if value.link is None else {"link": value.link}
        return {"signals": list(value.signals), **tolerance, "reason": value.reason, **link, "expires": expires, **only}
    if dataclasses.is_dataclass(value):
        return {field.name: _plain(getattr(value, field.name)) for field in dataclasses.fields(value)}
    if isinstance(value, tuple | list):
        return [_plain(item) for item in value]
    if isinstance(value, enum.Enum):
        return value.value
    if isinstance(value, float) and not math.isfinite(value):
        return "NaN" if math.isnan(value) else "Infinity" if value > 0 else "-Infinity"
    return value
