"""A comparison with the machine as text for people."""

from __future__ import annotations

import math
from collections.abc import Iterator

from replay.alignment.clock import ClockEstimate, Undetermined
from replay.alignment.statistics import LineFit
from replay.comparison import quantities, wording
from replay.comparison.difference import DiffVerdict, SignalDifference
from replay.comparison.measured.effects import RUNS
from replay.comparison.measured.result import MeasuredClock, MeasuredComparison, MeasuredSignal
from replay.errors import count


def lines(found: MeasuredComparison, *, verbose: bool = False) -> Iterator[str]:
    """Yield the lines of the report, with names as they are.

    Args:
        found: the comparison.
        verbose: tell every event, and signals that say nothing of the time.
    """
    yield f"{found.verdict.value}: {found.difference.name}: {summary(found)}"
    for clock in found.clocks:
        yield from (f"  {line}" for line in of_clock(clock, verbose=verbose))
    ordered = sorted(found.signals, key=lambda one: not one.decides)
    for signal in ordered:
        yield f"  {verdict(signal)}: {signal.signal.full_name}"
        yield from (f"    {line}" for line in of_signal(signal, verbose=verbose))
    yield from (f"  {wording.absence(item, 'missing')}" for item in found.difference.missing)
    yield from (f"  {wording.expired(rule)}" for rule in found.difference.expired)


def summary(found: MeasuredComparison) -> str:
    """Return the comparison in one line."""
    off = sum(signal.decides for signal in found.signals)
    parts = [f"{off} of {count(len(found.signals), 'signal')} further off than the rules accept"]
    if found.difference.missing:
        parts.append(f"{count(len(found.difference.missing), 'signal')} without a sample in the scenario's time")
    told = found.verdict is DiffVerdict.DIFFERENT
    within = f"all {count(len(found.signals), 'signal')} within the rules"
    return f"{', '.join(parts) if told else within}, measured by {found.log}"


def verdict(signal: MeasuredSignal) -> str:
    """Return what the rules say of a signal, in words."""
    if not signal.covered:
        return "without a sample"
    if signal.decides:
        return "off"
    ignored = signal.rule is not None and signal.rule.tolerance.ignore
    return "ignored" if ignored else "within the rules"


def of_clock(clock: MeasuredClock, *, verbose: bool = False) -> Iterator[str]:
    """Yield what there is to say of a clock."""
    name = f"clock {clock.name}" if clock.name else "clock"
    told = clock.told
    if clock.given:
        yield f"{name}: offset {seconds(clock.used.offset)}, as given{_drift(told, clock)}"
    elif isinstance(told, ClockEstimate):
        low, high = told.offset_interval
        at = f" at {told.reference:.6g} s of the log" if told.drift_interval != (0.0, 0.0) else ""
        interval = f"{told.confidence:.0%}: {seconds(low)} .. {seconds(high)}"
        yield f"{name}: offset {seconds(told.offset)} ({interval}){at}{_drift(told, clock)}"
    if clock.note:
        yield f"  note: {clock.note}"
    if isinstance(told, ClockEstimate):
        if not told.agree:
            yield "  note: signals tell different offsets; the interval holds them all"
            yield from (f"    {one.name}: {1e3 * one.delay:+.4g} ms" for one in told.delays)
        if verbose:
            yield f"  told by {', '.join(told.used)}"
    if verbose:
        yield from (f"  not told by {name_}: {reason}" for name_, reason in told.unused)


def _drift(told: ClockEstimate | Undetermined, clock: MeasuredClock) -> str:
    if isinstance(told, Undetermined) or told.drift_interval == (0.0, 0.0):
        return ""
    low, high = told.drift_interval
    return f", drift {clock.used.drift * 1e6:.4g} ppm ({low * 1e6:.4g} .. {high * 1e6:.4g})"


def seconds(value: float) -> str:
    """Return a time to a microsecond."""
    return f"{value + 0.0:.6f} s"


def of_signal(signal: MeasuredSignal, *, verbose: bool = False) -> Iterator[str]:
    """Yield what there is to say of a signal, a line each."""
    found, matched, unit = signal.statistics, signal.matched, signal.signal.unit
    frames = len(matched.enclosed)
    samples = len(matched.pair.measured_time)
    yield (
        f"{frames - matched.n_unmatched_frames} of {count(frames, 'frame')} have samples around them, "
        f"{samples - matched.n_unmatched_samples} of {count(samples, 'sample')} are at frames"
    )
    if found.count:
        at = float(matched.pair.time[found.frame])
        yield (
            f"residual: bias {shown(found.bias, unit)}, rms {shown(found.rms, unit)}, "
            f"largest {shown(found.largest, unit)} at {wording.seconds(at)}"
        )
        low, middle, high = (shown(value, unit) for value in found.percentiles)
        correlation = f"; correlation {found.correlation:.4f}" if math.isfinite(found.correlation) else ""
        yield f"percentiles 5, 50, 95: {low}, {middle}, {high}{correlation}"
    if found.fit is not None and not signal.matched.pair.steps and signal.fit is None:
        yield f"best fit: {line(found.fit, unit)}"
    if signal.fit is not None:
        yield f"fit, applied: measured = {signal.fit[0]:.6g} simulated {_added(signal.fit[1], unit)}"
    yield from (f"hint: {hint}" for hint in signal.hints)
    alone = matched.only_measured + matched.only_simulated
    if alone and not matched.pair.steps:
        yield (
            f"detected in {matched.both} frames by both, {matched.only_measured} only as measured, "
            f"{matched.only_simulated} only as simulated"
        )
    for item in signal.differences:
        yield from judged(item, signal, verbose=verbose)
    if signal.rule is not None:
        yield wording.rule(signal.rule) if verbose else f"rule {wording.tolerance(signal.rule)}"
    elif signal.differences:
        yield wording.rule(None)


def judged(item: SignalDifference, signal: MeasuredSignal, *, verbose: bool = False) -> Iterator[str]:
    """Yield what the rules say of a difference."""
    total = signal.statistics.count
    if item.event_count:
        total = int(signal.matched.enclosed.sum())
        yield from wording.signal(item, total, events=None if verbose else wording.SHOWN_EVENTS, runs=RUNS)
        return
    if item.outside:
        yield f"{item.outside} of {count(total, 'frame')} outside the tolerance, the first {wording.moment(item.first)}"
    if item.rms is not None:
        above = "more than" if item.spread else "within what"
        yield f"root mean square {shown(item.rms, item.signal.unit)}, {above} the rule accepts"


def line(fit: LineFit, unit: str) -> str:
    """Return the best scale and offset, with their intervals."""
    low, high = fit.scale_interval
    least, most = (shown(value, unit) for value in fit.offset_interval)
    scale = f"({low:.5g} .. {high:.5g})"
    return f"measured = {fit.scale:.6g} {scale} simulated {_added(fit.offset, unit)} ({least} .. {most})"


def _added(offset: float, unit: str) -> str:
    return f"{'-' if offset < 0.0 else '+'} {shown(abs(offset), unit)}"


def shown(value: float, unit: str) -> str:
    """Return a value with four digits, in a unit that suits it."""
    return quantities.shown(value, unit, digits=4)
