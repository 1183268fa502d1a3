"""A made-up run in which the flags agree with the numbers, and ways to change one thing in it."""

from __future__ import annotations

import copy
import dataclasses
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from replay.collision.columns import CollisionColumns
from replay.numerics import transforms
from replay.recording.events import Events
from replay.recording.provenance import Provenance, describe
from replay.recording.reader import Recording
from replay.recording.scene_view import BodyView, SceneView
from replay.recording.writer import McapWriter
from replay.sensing.capacitive.columns import CapacitiveColumns
from replay.sensing.distance.columns import DistanceColumns
from replay.simulation import BLOCK_FRAMES, FrameBlock, Layout

LAYOUT = Layout(
    links=("arm", "stand"),
    joints=("lift", "turn"),
    joint_units=("m", "rad"),
    shapes=("arm/beam", "stand/base", "stand/column"),
    pairs=("arm/beam|stand/base", "arm/beam|stand/column"),
    objects=("stand/base", "stand/column"),
    sensors={"distance": ("left", "right"), "capacitive": ("guard",)},
)
FILES = {"run.yaml": b"version: 1\nname: made_up\n", "meshes/beam.stl": b"solid beam"}
CONTACT = slice(40, 60)
"""Frames in which pair 0 is in contact; the bounds overlap in 30 to 69, clearance is evaluated in 20 to 79."""
RATE = 60
TRIANGLES = np.array([[[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 0, 0], [0, 1, 0], [0, 0, 1]]], dtype=np.float64)


def recording(frames: int = 100, layout: Layout = LAYOUT, name: str = "made_up") -> Recording:
    """Return a run of at least 90 frames: an arm comes near, touches, and goes; the sensors see it for a while."""
    t = np.arange(frames)
    count = {key: len(getattr(layout, key)) for key in ("links", "joints", "pairs", "objects")}
    sensors, plates = len(layout.distance_sensors), len(layout.capacitive_sensors)
    wave = np.sin(t / 17.0)[:, None]
    poses = transforms.from_rpy(0.3 * np.sin(t / 29.0)[:, None, None] * np.ones((frames, count["links"], 3)))
    poses[..., :3, 3] = wave[:, :, None] * np.arange(1, 4)
    level = np.zeros((frames, count["pairs"]), dtype=np.uint8)
    level[30:70, 0] = 1
    level[CONTACT, 0] = 2
    evaluated = np.zeros((frames, count["pairs"]), dtype=bool)
    evaluated[20:80, 0] = True
    clearance = np.where(evaluated, np.where(level == 2, 0.0, 0.01 + np.abs(t - 50)[:, None] * 1e-3), np.nan)
    seen = np.zeros((frames, sensors), dtype=bool)
    seen[10:90] = True
    reading = np.where(seen, 0.5 + 0.1 * wave, np.nan)
    index = np.where(seen, 1, -1).astype(np.int32)
    capacitance = (2.0 + wave) * 1e-12 * np.ones((1, plates))
    voltage = 2.5 * 10e-12 / (10e-12 + capacitance)
    return Recording(
        path=Path(f"{name}.mcap"),
        provenance=describe(name, "run.yaml", FILES, frames=frames, layout=layout, model={"capacitive": "tree@1"}),
        time=(t.astype(np.int64) * 10**9) // RATE,
        joint_positions=wave * np.ones((1, count["joints"])),
        joint_velocities=np.cos(t / 17.0)[:, None] * np.ones((1, count["joints"])),
        link_poses=poses,
        link_quaternions=transforms.to_quaternion(poses),
        collision=CollisionColumns(level, clearance, evaluated, np.zeros_like(evaluated)),
        readings={
            "distance": DistanceColumns(
                status=seen.astype(np.uint8),
                distance=reading,
                point=reading[:, :, None] * np.array([1.0, 0.5, 0.0]),
                point_sensor=reading[:, :, None] * np.array([0.0, 0.0, 1.0]),
                normal=np.where(seen, 1.0, np.nan)[:, :, None] * np.array([0.0, 0.0, 1.0]),
                shape=index,
                triangle=np.where(seen, t[:, None] // 10, -1).astype(np.int32),
                case=np.where(seen, 1, 0).astype(np.uint8),
            ),
            "capacitive": CapacitiveColumns(
                capacitance=capacitance,
                per_object=capacitance[:, :, None] * np.linspace(0.4, 0.6, count["objects"]),
                output_voltage=voltage,
                delta_output=2.5 - voltage,
                saturated=np.zeros((frames, plates), dtype=bool),
                touching=np.zeros((frames, plates), dtype=bool),
            ),
        },
        events=Events.none(),
        files=FILES,
        loss=None,
        lost_frames=0,
    )


def altered(original: Recording, change: Callable[[Recording], None]) -> Recording:
    """Return a copy of a recording after a change of its arrays in place."""
    result = copy.deepcopy(original)
    change(result)
    return result


def with_provenance(original: Recording, **values: Any) -> Recording:
    """Return a recording whose provenance differs."""
    return dataclasses.replace(original, provenance=dataclasses.replace(original.provenance, **values))


def with_names(original: Recording, **names: tuple[str, ...]) -> Recording:
    """Return a recording whose layout differs; `distance_sensors` are the sensors of that kind."""
    sensors = {key.removesuffix("_sensors"): names.pop(key) for key in list(names) if key.endswith("_sensors")}
    layout = dataclasses.replace(original.layout, sensors={**original.layout.sensors, **sensors}, **names)
    return with_provenance(original, layout=layout)


def only_frames(original: Recording, frames: Any) -> Recording:
    """Return a recording of some of the frames."""

    def cut(columns: Any) -> Any:
        return type(columns)(**{field.name: getattr(columns, field.name)[frames] for field in columns.present()})

    arrays = ("time", "joint_positions", "joint_velocities", "link_poses", "link_quaternions")
    return dataclasses.replace(
        original,
        **{name: getattr(original, name)[frames] for name in arrays},
        collision=cut(original.collision),
        readings={kind: cut(columns) for kind, columns in original.readings.items()},
    )


def write(made: Recording, path: Path, *, files: Mapping[str, bytes] | None = None, size: float = 1.0) -> Path:
    """Write a recording as a file, with its own files or others; its bodies have triangles of a size."""
    shapes = made.layout.shapes
    bodies = tuple(
        BodyView(shape, made.layout.links.index(shape.split("/")[0]), size * TRIANGLES, (200, 200, 210, 255))
        for shape in shapes
    )
    scene = SceneView(made.provenance.scenario, "", made.layout.links, bodies, (), {})
    path.parent.mkdir(parents=True, exist_ok=True)
    provenance: Provenance = made.provenance
    writer = McapWriter(path, provenance, scene, made.files if files is None else files, overwrite=True)
    for first in range(0, len(made.time), BLOCK_FRAMES):
        rows = slice(first, first + BLOCK_FRAMES)
        part = only_frames(made, rows)
        writer.write(
            FrameBlock(
                made.layout,
                first,
                part.time,
                part.joint_positions,
                part.joint_velocities,
                part.link_poses,
                part.collision,
                part.readings,
            )
        )
    writer.commit()
    return path
