"""How far a recording is from the machine as numbers of a night, so that a trend shows them."""

from __future__ import annotations

from collections.abc import Iterator

from replay.comparison.measured.result import MeasuredComparison, MeasuredSignal
from replay.scenario.measures import Measure, finite


def measures_of(found: MeasuredComparison) -> tuple[Measure, ...]:
    """Return the offset of each clock, and of each signal bias, root mean square and largest magnitude of the residual.

    Names are such as `measured.offset` and `measured.distance.tip.distance.rms`.
    """
    return (*_clocks(found), *(measure for signal in found.signals for measure in _of(signal)))


def _clocks(found: MeasuredComparison) -> Iterator[Measure]:
    for clock in found.clocks:
        name = ".".join(filter(None, ["measured", clock.name, "offset"]))
        yield Measure(name, finite(clock.used.offset), "s", subject=found.log)


def _of(signal: MeasuredSignal) -> Iterator[Measure]:
    numbers, unit = signal.statistics, signal.signal.unit
    name = f"measured{signal.signal.full_name.replace('/', '.')}"
    largest = None if numbers.frame < 0 else float(signal.matched.pair.time[numbers.frame])
    yield Measure(f"{name}.bias", finite(numbers.bias), unit)
    yield Measure(f"{name}.rms", finite(numbers.rms), unit)
    yield Measure(f"{name}.largest", finite(abs(numbers.largest)), unit, largest)
    yield Measure(f"{name}.frames", float(numbers.count), "")
