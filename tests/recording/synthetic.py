"""A made-up run with every kind of column, for tests of recordings: nothing here is simulated."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from replay.collision.columns import CollisionColumns, Crossings
from replay.numerics import transforms
from replay.recording import provenance
from replay.recording.scene_view import BodyView, SceneView, SensorView
from replay.sensing.capacitive import CapacitiveSensor, Plate
from replay.sensing.capacitive.columns import CapacitiveColumns
from replay.sensing.distance import DistanceSensor
from replay.sensing.distance.columns import DistanceColumns
from replay.sensing.kinds import KINDS
from replay.simulation import BLOCK_FRAMES, FrameBlock, Layout

LAYOUT = Layout(
    links=("arm", "patient", "stand"),
    joints=("lift", "rotation"),
    joint_units=("m", "rad"),
    shapes=("arm/beam", "patient/body", "stand/column"),
    pairs=("arm/beam|patient/body", "patient/body|stand/column"),
    objects=("patient/body", "stand/column"),
    sensors={**dict.fromkeys(KINDS, ()), "distance": ("left", "right ä"), "capacitive": ("guard",)},
)
FILES = {"run.yaml": b"version: 1\nname: made_up\n", "parts/body.stl": bytes(range(256)) * 20}
BOX = np.array(
    [
        [[0, 0, 0], [1, 0, 0], [0, 1, 0]],
        [[0, 0, 0], [0, 1, 0], [0, 0, 1]],
        [[0, 0, 0], [0, 0, 1], [1, 0, 0]],
        [[1, 0, 0], [0, 0, 1], [0, 1, 0]],
    ],
    dtype=np.float64,
)


def drawn(kind: str, sensor: Any) -> SensorView:
    """Return a sensor as it is drawn."""
    return SensorView(kind, sensor.name, sensor.link, KINDS[kind].drawing(sensor))


def scene() -> SceneView:
    """Return three tetrahedra, a cone each sensor and a plate."""
    bodies = tuple(
        BodyView(name, link, 0.3 * BOX, (200, 200 - 40 * link, 210, 255)) for link, name in enumerate(LAYOUT.shapes)
    )
    cones = tuple(
        DistanceSensor(name, 0, transforms.from_translation(np.array([0.1 * k, 0.0, 0.0])), 0.6, (1.5, np.inf)[k])
        for k, name in enumerate(LAYOUT.distance_sensors)
    )
    guard = CapacitiveSensor("guard", 0, (Plate("front", transforms.identity(), np.array([0.05, 0.1])),), 1e-11)
    sensors = (*(drawn("distance", cone) for cone in cones), drawn("capacitive", guard))
    return SceneView("made_up", "tetrahedra", LAYOUT.links, bodies, sensors, {"run.yaml": "version: 1\n"})


def blocks(frames: int, *, seed: int = 1, wild: bool = True) -> Iterator[FrameBlock]:
    """Yield blocks with random numbers; `wild` ones include NaN with payloads, signed zeros, infinities, subnormals."""
    for first in range(0, frames, BLOCK_FRAMES):
        yield _block(np.random.default_rng([seed, first]), first, min(BLOCK_FRAMES, frames - first), wild)


def _block(rng: np.random.Generator, first: int, n: int, wild: bool) -> FrameBlock:
    d, c, p, o = (len(x) for x in (LAYOUT.distance_sensors, LAYOUT.capacitive_sensors, LAYOUT.pairs, LAYOUT.objects))

    def numbers(*shape: int) -> np.ndarray:
        if not wild:
            return rng.normal(size=shape)
        any_bits = rng.integers(0, 2**64, size=shape, dtype=np.uint64, endpoint=False).view(np.float64)
        corner = rng.choice(np.array([np.nan, -0.0, 0.0, np.inf, -np.inf, 5e-324]), size=shape)
        return np.where(rng.random(shape) < 0.3, corner, any_bits)

    poses = transforms.from_rpy(rng.uniform(-3, 3, size=(n, len(LAYOUT.links), 3)))
    poses[..., :3, 3] = rng.normal(size=(n, len(LAYOUT.links), 3)) * 1e3
    status = rng.integers(0, 3, size=(n, d)).astype(np.uint8)
    level = rng.integers(0, 3, size=(n, p)).astype(np.uint8)
    time = ((first + np.arange(n, dtype=np.int64)) * 50_000_000_000) // 3
    return FrameBlock(
        layout=LAYOUT,
        first=first,
        time=time,
        joint_positions=numbers(n, 2),
        joint_velocities=numbers(n, 2),
        link_poses=poses,
        collision=CollisionColumns(
            level=level,
            clearance=numbers(n, p),
            evaluated=rng.random((n, p)) < 0.5,
            undecided=rng.random((n, p)) < 0.02,
            between=rng.integers(0, 4, size=(n, p)).astype(np.uint8),
            clearance_bound=numbers(n, p),
            crossings=_crossings(np.random.default_rng([first, n]), first, time, level),
        ),
        readings={
            "distance": DistanceColumns(
                status=status,
                distance=numbers(n, d),
                point=numbers(n, d, 3),
                point_sensor=numbers(n, d, 3),
                normal=numbers(n, d, 3),
                shape=rng.integers(-1, 3, size=(n, d)).astype(np.int32),
                triangle=rng.integers(-1, 2**31 - 1, size=(n, d)).astype(np.int32),
                case=rng.integers(0, 6, size=(n, d)).astype(np.uint8),
            ),
            "capacitive": CapacitiveColumns(
                capacitance=numbers(n, c),
                per_object=numbers(n, c, o),
                output_voltage=numbers(n, c),
                delta_output=numbers(n, c),
                saturated=rng.random((n, c)) < 0.1,
                touching=rng.random((n, c)) < 0.1,
            ),
        },
    )


def _crossings(rng: np.random.Generator, first: int, time: np.ndarray, level: np.ndarray) -> Crossings:
    """Return a bracket for each change of a level after the first frame, and for a few that frames do not show."""
    rows = []
    for threshold in (1, 2):
        reached = level >= threshold
        for frame, pair in np.argwhere(np.ones_like(reached[1:])).tolist():
            was, is_ = bool(reached[frame, pair]), bool(reached[frame + 1, pair])
            unseen = was == is_ and rng.random() < 0.1
            moments = np.sort(rng.integers(time[frame], time[frame + 1], size=4, endpoint=True)).tolist()
            changes = [not was] if was != is_ else [not was, was] if unseen else []
            for k, begins in enumerate(changes):
                rows.append((moments[2 * k + 1], pair, threshold, begins, moments[2 * k], first + frame + 1))
    rows.sort(key=lambda row: row[:2])
    latest, pair, threshold, begins, earliest, frame = np.array(rows, dtype=np.int64).reshape(-1, 6).T
    return Crossings(pair, threshold.astype(np.uint8), begins > 0, earliest, latest, frame)


def described(frames: int) -> provenance.Provenance:
    """Return the provenance of a made-up run."""
    model = {"distance": {"method": "exact", "revision": 1}}
    return provenance.describe("made_up", "run.yaml", FILES, frames=frames, layout=LAYOUT, model=model)
