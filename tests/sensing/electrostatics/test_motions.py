"""Readings over scripted motions: frames between those that are solved beside all of them solved, and the reference."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import replay
from replay.sensing.capacitive.columns import CapacitiveColumns

Floats = NDArray[np.float64]

TOLERANCE = 1e-2
"""Of `field`: a third of `accuracy`."""

SMOOTH = 2e-3
"""What of a step to the next frame the motion need not explain."""

SCENE = """
version: 1
name: motion
rate: {rate} Hz
duration: {duration} s
links:
  sensor: {{shapes: {{sheet: {{type: plane, size: [18 cm, 12 cm], pose: {{xyz: [0, 0, -5 mm]}}}}}}}}
  rail: {{joint: {{name: slide, type: prismatic, axis: [1, 0, 0], lower: -1, upper: 1}}}}
  arm: {{parent: rail, joint: {{name: lift, type: prismatic, axis: [0, 0, 1], lower: -1, upper: 1}}}}
  hand:
    parent: arm
    earth: {earth}
    joint: {{name: turn, type: revolute, axis: [0.6, 0.8, 0], lower: -3, upper: 3}}
    shapes:
      hand: {hand}
  wall: {{shapes: {{wall: {{type: cuboid, size: [2 cm, 30 cm, 20 cm], pose: {{xyz: [20 cm, 0, 5 cm]}}}}}}}}
motion:
  points:
    slide: {slide}
    lift: {lift}
    turn: {turn}
sensors:
  capacitive:
    left: {{link: sensor, plates: {{a: {{size: [5 cm, 6 cm], pose: {{xyz: [-5 cm, 0, 0]}}}}}}, coupling: 10 pF{own}}}
    right: {{link: sensor, plates: {{a: {{size: [5 cm, 6 cm], pose: {{xyz: [5 cm, 0, 0]}}}}}}, coupling: 10 pF{own}}}
model: {{capacitive: {{method: {method}}}}}
"""

SHAPES = (
    "{type: cuboid, size: [8 cm, 12 cm, 4 cm]}",
    "{type: sphere, radius: 4 cm, chord_error: 2 mm}",
    "{type: cylinder, radius: 3 cm, height: 20 cm, chord_error: 2 mm, pose: {rpy: [90 deg, 0, 0]}}",
    "{type: plane, size: [10 cm, 14 cm]}",
)


def points(times: Floats, positions: Floats) -> str:
    rows = [f"{{time: {t:.4f} s, position: {p:.5f}}}" for t, p in zip(times, positions, strict=True)]
    return "[" + ", ".join(rows) + "]"


def scene(seed: int) -> dict[str, Any]:
    """Return a random motion of a hand before two plates: smooth, with stops, kinks, or repeats."""
    random = np.random.default_rng(seed)
    duration = float(random.uniform(2.0, 8.0))
    given: dict[str, Any] = {"duration": duration, "rate": 30, "hand": SHAPES[seed % len(SHAPES)], "method": "field"}
    given["earth"] = ("grounded", "floating", "100 pF")[seed % 3]
    given["own"] = (", back: [sheet]", "")[seed // 2 % 2]
    for name, low, high in (("slide", -0.25, 0.1), ("lift", 0.065, 0.3), ("turn", -0.5, 0.5)):
        if name != "lift" and random.random() < 0.3:
            times, positions = np.zeros(1), np.zeros(1)
        else:
            n = int(random.integers(2, 6))
            times = np.sort(random.uniform(0.1, 0.9, n)) * duration
            positions = random.uniform(low, high, n)
            if n > 2 and random.random() < 0.5:
                positions[n // 2] = positions[n // 2 - 1]
        given[name] = points(times, positions)
    return given


def read(folder: Path, given: dict[str, Any], *, savings: bool = True) -> CapacitiveColumns:
    path = folder / "motion.yaml"
    path.write_text(SCENE.format(**given))
    (block,) = replay.simulate(replay.load(path), savings=savings)
    found: CapacitiveColumns = block.capacitive
    return found


def check_tolerance(folder: Path, given: dict[str, Any]) -> None:
    """Hold frames between keys against all frames solved."""
    between, every = read(folder, given), read(folder, given, savings=False)
    found, truth, error = between.increase, every.increase, between.error
    assert found is not None and truth is not None and error is not None
    assert (between.saturated == every.saturated).all()
    assert between.unresolved is not None and (between.unresolved == every.unresolved).all()
    known = np.isfinite(truth).all(axis=1)
    miss = np.abs(found - truth)[known]
    assert (miss <= TOLERANCE * (truth + 5e-3 * truth.max(axis=1, keepdims=True))[known]).all()
    assert (miss <= error[known])[~np.isnan(error[known])].all()
    assert jump(found[known], truth[known]) <= 3 * SMOOTH  # a kink beside; most motions are within a third of it


def jump(found: Floats, truth: Floats) -> float:
    """Return the largest step of a reading's logarithm to the next frame beyond that of readings that are true."""
    step = np.abs(np.diff(np.log(found), axis=0) - np.diff(np.log(truth), axis=0))
    return float(step[truth[1:] > 5e-3 * truth.max()].max(initial=0.0))


@pytest.mark.parametrize("seed", [1, 5])
def test_a_random_motion_keeps_the_tolerance(tmp_path: Path, seed: int) -> None:
    check_tolerance(tmp_path, scene(seed))


@pytest.mark.soak
@pytest.mark.parametrize("seed", range(50))
def test_fifty_random_motions_keep_the_tolerance(tmp_path: Path, seed: int) -> None:
    check_tolerance(tmp_path, scene(seed))


MOTIONS = {
    "approach": {"lift": ([0.0, 2.0], [0.3, 0.03])},
    "slide": {"lift": ([0.0], [0.045]), "slide": ([0.0, 2.0], [-0.25, 0.12])},
    "tilt": {"lift": ([0.0], [0.1]), "turn": ([0.0, 2.0], [-0.9, 0.9])},
}


@pytest.mark.soak
@pytest.mark.parametrize("motion", sorted(MOTIONS))
def test_a_motion_is_near_the_reference_in_twenty_one_frames(tmp_path: Path, motion: str) -> None:
    given: dict[str, Any] = {"duration": 2.0, "earth": "floating", "hand": SHAPES[0], "own": ", back: [sheet]"}
    for name in ("slide", "lift", "turn"):
        times, positions = MOTIONS[motion].get(name, ([0.0], [0.0]))
        given[name] = points(np.array(times), np.array(positions))
    fast = read(tmp_path, given | {"method": "field", "rate": 100})
    reference = read(tmp_path, given | {"method": "bem", "rate": 10}, savings=False)
    found, truth = fast.increase, reference.increase
    assert found is not None and truth is not None
    found = found[::10]
    counts = truth > 0.1 * truth.max(axis=1, keepdims=True)
    assert (np.abs(found / truth - 1.0)[counts] <= 3.5e-2).all()
    assert np.median(np.abs(found / truth - 1.0)[counts]) <= 1e-2
    assert jump(found, truth) <= 10 * SMOOTH
