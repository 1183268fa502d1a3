"""What a comparison with a machine says: the clocks, each signal in numbers, and the difference by the rules."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from replay.alignment.clock import ClockEstimate, LogClock, Undetermined
from replay.alignment.residuals import SampledFrames
from replay.alignment.statistics import ResidualStatistics
from replay.comparison.difference import Difference, DiffVerdict, SignalDifference
from replay.comparison.rules import Rule
from replay.comparison.signals import Signal

JSON_VERSION = 1


@dataclass(frozen=True, eq=False)
class MeasuredClock:
    """A clock of the log beside the scenario's time.

    Attributes:
        name: "" for the log's own.
        used: what times were converted by: t = t_log + offset + drift (t_log - reference).
        told: what the signals tell of it: that is what is used unless the offset is given.
        given: whether the offset is given.
        zero: time of the log [ns] at which this clock is 0.
        note: what a reader should know; "" for nothing.
    """

    name: str
    used: LogClock
    told: ClockEstimate | Undetermined
    given: bool
    zero: int
    note: str = ""

    def as_json(self) -> dict[str, Any]:
        """Return JSON values."""
        values: dict[str, Any] = {
            "name": self.name,
            "given": self.given,
            "offset": self.used.offset,
            "drift": self.used.drift,
            "reference": self.used.reference,
            "zero": self.zero / 1e9,
            "note": self.note,
        }
        if isinstance(self.told, Undetermined):
            values["undetermined"] = self.told.reason
            values["candidates"] = list(self.told.candidates)
        else:
            values["estimate"] = {
                "offset": self.told.offset,
                "offset_interval": list(self.told.offset_interval),
                "drift": self.told.drift,
                "drift_interval": list(self.told.drift_interval),
                "reference": self.told.reference,
                "confidence": self.told.confidence,
                "used": list(self.told.used),
            }
        values["unused"] = dict(self.told.unused)
        return values


@dataclass(frozen=True, eq=False)
class MeasuredSignal:
    """A signal beside what the machine measured.

    Attributes:
        signal: which.
        clock: name of its clock, "" for the log's own.
        matched: both at the frames' times; with `fit`, the simulated values are those that fit the measured ones best.
        statistics: of the residual, measured - simulated.
        hints: what explains most of it.
        fit: scale and offset that were applied to the simulated values; None for none.
        rule: that was applied; None for exact.
        differences: of its values, and of whether it has one; none where they are equal or ignored.
    """

    signal: Signal
    clock: str
    matched: SampledFrames
    statistics: ResidualStatistics
    hints: tuple[str, ...]
    fit: tuple[float, float] | None
    rule: Rule | None
    differences: tuple[SignalDifference, ...]

    @property
    def decides(self) -> bool:
        """Whether it is further off than its rule accepts."""
        return any(item.decides for item in self.differences)

    @property
    def covered(self) -> bool:
        """Whether any frame has a measured value, or the knowledge that there was none."""
        return bool(self.matched.enclosed.any())

    def as_json(self) -> dict[str, Any]:
        """Return JSON values; what is not finite is None."""
        found, matched = self.statistics, self.matched
        line = found.fit
        return {
            "signal": self.signal.full_name,
            "unit": self.signal.unit,
            "clock": self.clock,
            "decides": self.decides,
            "frames": found.count,
            "unmatched_frames": matched.n_unmatched_frames,
            "unmatched_samples": matched.n_unmatched_samples,
            "bias": _finite(found.bias),
            "rms": _finite(found.rms),
            "largest": _finite(found.largest),
            "largest_frame": found.frame,
            "largest_time": float(matched.pair.time[found.frame]) if found.frame >= 0 else None,
            "percentiles": [_finite(value) for value in found.percentiles],
            "correlation": _finite(found.correlation),
            "best_line": None
            if line is None
            else {
                "scale": line.scale,
                "scale_interval": list(line.scale_interval),
                "offset": line.offset,
                "offset_interval": list(line.offset_interval),
            },
            "fit": None if self.fit is None else list(self.fit),
            "detections": {
                "both": matched.both,
                "only_measured": matched.only_measured,
                "only_simulated": matched.only_simulated,
            },
            "hints": list(self.hints),
        }


@dataclass(frozen=True, eq=False)
class MeasuredComparison:
    """A recording beside a log of the machine.

    Attributes:
        log: what the log is called; `origin` name and SHA-256 of the file that it is, or was cut out of.
        frames: of the recording.
        clocks: of the log.
        signals: in the order in which they are written.
        difference: the same by the rules of `diff`: the log is the baseline, the recording the candidate; frames are
            those of the recording.
    """

    log: str
    origin: dict[str, str]
    frames: int
    clocks: tuple[MeasuredClock, ...]
    signals: tuple[MeasuredSignal, ...]
    difference: Difference

    @property
    def verdict(self) -> DiffVerdict:
        """Different when a signal is further off than the rules accept."""
        return self.difference.verdict

    def as_json(self) -> dict[str, Any]:
        """Return JSON values."""
        return {
            "version": JSON_VERSION,
            "scenario": self.difference.name,
            "verdict": self.verdict.value,
            "log": self.log,
            "origin": self.origin,
            "frames": self.frames,
            "clocks": [clock.as_json() for clock in self.clocks],
            "signals": [signal.as_json() for signal in self.signals],
            "difference": self.difference.as_json(),
        }


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
