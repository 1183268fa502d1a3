"""The signal chain against a reference that goes frame by frame, and closed forms of its steps."""

from __future__ import annotations

import math
from decimal import Decimal
from fractions import Fraction

import numpy as np
import pytest
from scipy import stats
from scipy.signal import lfilter

from replay.sensing.signal.chain import Chain
from replay.sensing.signal.noise import noise_key, random_numbers
from replay.sensing.signal.part import LengthSignal, VoltageSignal

RATE = Fraction(60)


def told(
    readings: np.ndarray, blocks: tuple[int, ...] = (10**6,), substitute: float = 9.0, **written: object
) -> np.ndarray:
    """Return what a chain makes of readings that come in blocks of these lengths, over and over."""
    chain = Chain("distance", "tip", LengthSignal.model_validate(written), RATE, substitute)
    state, first, parts, k = chain.begin(), 0, [], 0
    while first < len(readings):
        part = readings[first : first + blocks[k % len(blocks)]]
        found, _, state = chain.run(first, part, np.zeros(len(part), dtype=bool), state)
        parts.append(found)
        first, k = first + len(part), k + 1
    return np.concatenate(parts)


def reference(readings: np.ndarray, rate: Fraction, delay: int, substitute: float, written: dict) -> list[float]:
    """Go frame by frame, with all that is remembered in lists; `delay` in samples."""
    every = int(RATE / rate)
    noise = written.get("noise", {})
    key = noise_key(noise.get("seed", 0), "distance", "tip")
    smooth, samples, found = None, [], []
    for k, reading in enumerate(readings.tolist()):
        x = substitute if math.isnan(reading) else reading
        if "low_pass" in written:
            tau = 1.0 / (2.0 * math.pi * written["low_pass"])
            smooth = x if smooth is None else smooth + (1.0 - math.exp(-float(1 / RATE) / tau)) * (x - smooth)
        else:
            smooth = x
        if k % every == 0:
            normal, uniform = (values[0] for values in random_numbers(key, len(samples), 1))
            y = smooth + written.get("bias", 0.0) + noise.get("std", 0.0) * normal
            if "range" in written:
                low, high = written["range"]
                y = min(max(y, low), high)
            steps = written.get("quantisation", {})
            if "step" in steps:
                y = round(y / steps["step"]) * steps["step"]
            if "bits" in steps:
                step = (high - low) / (2 ** steps["bits"] - 1)
                y = low + round((y - low) / step) * step
            gone = uniform < written.get("dropout", 0.0) or math.isnan(reading)
            samples.append(math.nan if gone else y)
        place = len(samples) - 1 - delay
        found.append(samples[place] if place >= 0 else math.nan)
    return found


@pytest.mark.parametrize("seed", range(200))
def test_chains_are_what_the_reference_says_in_blocks_of_any_length(seed: int) -> None:
    rng = np.random.default_rng(seed)
    readings = 0.5 + 0.3 * np.cumsum(rng.normal(size=int(rng.integers(1, 150)))) / 10.0
    readings[rng.random(len(readings)) < rng.choice([0.0, 0.2, 1.0], p=[0.5, 0.4, 0.1])] = np.nan
    rate = RATE / int(rng.integers(1, 8))
    delay = int(rng.integers(0, 6))
    written: dict = {}
    options = {
        "low_pass": float(rng.uniform(0.5, 80.0)),
        "bias": float(rng.normal()),
        "noise": {"std": float(rng.uniform(0.0, 0.3)), "seed": int(rng.integers(0, 100))},
        "dropout": float(rng.uniform(0.0, 0.5)),
        "range": (0.1, 0.9),
        "quantisation": {"step": 0.01},
    }
    written = {key: value for key, value in options.items() if rng.random() < 0.5}
    if "range" in written and rng.random() < 0.5:
        written["quantisation"] = {"bits": int(rng.integers(1, 13))}
    wanted = reference(readings, rate, delay, 2.0, written)
    text = {"rate": f"{rate} Hz", "delay": f"{delay / rate} s"}
    whole = told(readings, substitute=2.0, **written, **text)
    np.testing.assert_allclose(whole, wanted, rtol=0.0, atol=1e-14)
    for blocks in ((1,), (7,), (1, 30, 3)):
        assert told(readings, blocks, 2.0, **written, **text).tobytes() == whole.tobytes()


def test_nothing_written_is_the_reading_itself() -> None:
    readings = np.array([0.3, np.nan, 0.1 + 0.2])
    assert told(readings).tobytes() == readings.tobytes()


def test_the_filter_is_the_exact_response_to_held_readings() -> None:
    readings = np.random.default_rng(1).normal(size=400)
    gain = 1.0 - math.exp(-2.0 * math.pi * 3.0 / 60.0)
    other = lfilter([gain], [1.0, gain - 1.0], readings, zi=[(1.0 - gain) * readings[0]])[0]
    np.testing.assert_allclose(told(readings, low_pass=3.0), other, atol=1e-13)
    step = told(np.r_[0.0, np.ones(60)], low_pass=3.0)
    np.testing.assert_allclose(step[1:], 1.0 - np.exp(-2.0 * np.pi * 3.0 * np.arange(1, 61) / 60.0), atol=1e-13)


def test_the_delay_is_whole_samples_to_the_frame() -> None:
    readings = np.arange(60.0)
    late = told(readings, rate=20.0, delay="0.1 s")
    assert np.isnan(late[:6]).all()
    assert np.array_equal(late[6:], np.repeat(np.arange(0.0, 54.0, 3.0), 3))


def test_values_are_the_nearest_multiples_half_to_even_and_bits_span_the_range() -> None:
    readings = np.array([0.125, 0.375, 1.0, -0.125, 0.124])  # halves of the step are doubles
    written = told(readings, quantisation={"step": 0.25})
    assert written.tolist() == [0.0, 0.5, 1.0, 0.0, 0.0]
    readings = np.linspace(-0.5, 3.0, 100_001)
    chain = Chain("capacitive", "side", VoltageSignal(range=(0.0, 2.5), quantisation={"bits": 12}), RATE, 0.0)
    values, _, _ = chain.run(0, readings, np.zeros(len(readings), dtype=bool), chain.begin())
    assert len(np.unique(values)) == 4096
    assert (values.min(), values.max()) == (0.0, 2.5)
    step = Decimal("2.5") / 4095
    exact = [(Decimal(v) / step).to_integral_value() * step for v in np.clip(readings, 0.0, 2.5).tolist()[::997]]
    np.testing.assert_allclose(values[::997], [float(v) for v in exact], atol=1e-15)


def test_samples_drop_out_as_often_as_written() -> None:
    gone = int(np.isnan(told(np.ones(100_000), dropout="1 %")).sum())
    low, high = stats.binom.ppf([1e-4, 1.0 - 1e-4], 100_000, 0.01)
    assert low <= gone <= high


def test_what_is_too_near_stays_so_through_samples_and_delay() -> None:
    chain = Chain("distance", "tip", LengthSignal(rate="30 Hz", delay="1/30 s"), RATE, 1.0)
    near = np.arange(12) // 4 % 2 == 1
    told_, beyond, _ = chain.run(0, np.ones(12), near, chain.begin())
    assert np.isnan(told_).tolist() == [True] * 2 + [False] * 10
    assert beyond.tolist() == [False] * 6 + [True] * 4 + [False] * 2
