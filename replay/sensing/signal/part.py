"""A signal chain as it is written, for sensors that tell a voltage or a length."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from typing import Annotated, Self

from pydantic import Field, StrictInt, model_validator

from replay.language.fields import Part, rejected
from replay.language.units import (
    FREQUENCY,
    VOLTAGE,
    Delay,
    Distance,
    Length,
    Probability,
    Quantity,
    Rate,
    Size,
    Voltage,
)

LowPass = Annotated[float, Quantity("LowPass", FREQUENCY, above=0.0, at_most=1e9)]
VoltageSpread = Annotated[float, Quantity("VoltageSpread", VOLTAGE, at_least=0.0, at_most=1e6)]
VoltageStep = Annotated[float, Quantity("VoltageStep", VOLTAGE, at_least=1e-12, at_most=1e6)]


class NoisePart(Part):
    """White noise of a normal distribution, added to every sample."""

    std: float
    """Standard deviation, in the reading's unit."""
    seed: Annotated[StrictInt, Field(ge=0, lt=1 << 63)] = 0
    """Chooses the numbers; those of different sensors are independent under one seed."""


class QuantisationPart(Part):
    """Values that samples are rounded to, half to even: multiples of a step, or 2^bits values over the range."""

    step: float | None = None
    """The step, in the reading's unit."""
    bits: Annotated[StrictInt, Field(ge=1, le=32)] | None = None
    """2^bits values from one end of the range to the other, both of them included."""

    @model_validator(mode="after")
    def _one_of_two(self) -> Self:
        if (self.bits is None) == (self.step is None):
            raise rejected("needs either step or bits")
        return self


class SignalPart(Part):
    """What electronics make of a reading, in the order of these keys; what is left out does nothing."""

    low_pass: LowPass | None = None
    """Cut-off frequency of a first-order filter [Hz], which begins settled at the first reading."""
    rate: Rate | None = None
    """Samples per second [Hz]; it divides the scenario's rate, and a sample is held until the next one."""
    bias: float = 0.0
    """Added to every sample, in the reading's unit."""
    noise: NoisePart | None = None
    """White noise."""
    dropout: Probability = 0.0
    """Probability that a sample is missing."""
    range: tuple[float, float] | None = None
    """What samples are clipped to, in the reading's unit."""
    quantisation: QuantisationPart | None = None
    """Values that samples are rounded to."""
    delay: Delay = Fraction(0)
    """How late samples come [s]: a whole number of them."""

    @model_validator(mode="after")
    def _range_in_order(self) -> Self:
        if self.range is not None and not self.range[0] < self.range[1]:
            raise rejected(f"must be above the lower end, {self.range[0]:.6g}", at=("range", 1))
        if self.quantisation is not None and self.quantisation.bits is not None and self.range is None:
            raise rejected("needs a range beside it, over which the values are spread", at=("quantisation", "bits"))
        return self


class VoltageNoise(NoisePart):
    """White noise of a normal distribution, added to every sample."""

    std: VoltageSpread
    """Standard deviation [V]."""


class VoltageQuantisation(QuantisationPart):
    """Values that samples are rounded to, half to even: multiples of a step, or 2^bits values over the range."""

    step: VoltageStep | None = None
    """The step [V]."""


class VoltageSignal(SignalPart):
    """What electronics make of a voltage, in the order of these keys; what is left out does nothing."""

    bias: Voltage = 0.0
    """Added to every sample [V]."""
    noise: VoltageNoise | None = None
    """White noise."""
    range: tuple[Voltage, Voltage] | None = None
    """What samples are clipped to [V]."""
    quantisation: VoltageQuantisation | None = None
    """Values that samples are rounded to."""


class LengthNoise(NoisePart):
    """White noise of a normal distribution, added to every sample."""

    std: Distance
    """Standard deviation [m]."""


class LengthQuantisation(QuantisationPart):
    """Values that samples are rounded to, half to even: multiples of a step, or 2^bits values over the range."""

    step: Size | None = None
    """The step [m]."""


class LengthSignal(SignalPart):
    """What electronics make of a length, in the order of these keys; what is left out does nothing."""

    bias: Length = 0.0
    """Added to every sample [m]."""
    noise: LengthNoise | None = None
    """White noise."""
    range: tuple[Length, Length] | None = None
    """What samples are clipped to [m]."""
    quantisation: LengthQuantisation | None = None
    """Values that samples are rounded to."""


def sampling_problems(signal: SignalPart, frame_rate: Fraction) -> Iterator[tuple[str, str]]:
    """Yield the keys of a signal that do not go with a scenario's frame rate [Hz], and what would work."""
    rate = frame_rate if signal.rate is None else Fraction(signal.rate)
    every = frame_rate / rate
    if every.denominator != 1:
        near = max(1, every.numerator // every.denominator)
        best = min((near, near + 1), key=lambda frames: abs(frame_rate / frames - rate))
        yield "rate", f"must divide the scenario's rate, {frame_rate} Hz; the nearest is '{frame_rate / best} Hz'"
        return
    late = Fraction(signal.delay) * rate
    if late.denominator != 1:
        rule = f"must be a whole number of samples, which are {1 / rate} s apart"
        yield "delay", f"{rule}; the nearest is '{round(late) / rate} s'"
