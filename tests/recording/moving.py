"""A made-up machine that moves past a body, for pictures and for tests of what is drawn."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from replay.collision.columns import CollisionColumns
from replay.numerics import transforms
from replay.numerics.arrays import Floats
from replay.recording.scene_view import BodyView, SceneView
from replay.sensing.capacitive import CapacitiveSensor, Plate
from replay.sensing.capacitive.columns import CapacitiveColumns
from replay.sensing.distance import DistanceSensor
from replay.sensing.distance.columns import DistanceColumns
from replay.simulation import BLOCK_FRAMES, FrameBlock, Layout
from tests.recording.synthetic import drawn

LAYOUT = Layout(
    links=("head", "room", "table"),
    joints=("lift",),
    joint_units=("m",),
    shapes=("head/housing", "room/stand", "table/body", "table/top"),
    pairs=("head/housing|table/body", "head/housing|table/top"),
    objects=("table/body",),
    sensors={"distance": ("down",), "capacitive": ("guard",)},
)


def _down(x: float, z: float) -> Floats:
    place = transforms.from_rpy(np.array([np.pi, 0.0, 0.0]))
    place[:3, 3] = [x, 0.0, z]
    return place


CONE = DistanceSensor("down", 0, _down(0.0, -0.1), np.radians(40), 1.0)
GUARD = CapacitiveSensor("guard", 0, (Plate("front", _down(0.15, -0.101), np.array([0.05, 0.15])),), 1e-11)


def box(size: tuple[float, float, float], center: tuple[float, float, float]) -> Floats:
    """Return the 12 triangles of an axis-aligned box, outward counter-clockwise."""
    corners = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
    quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    triangles = [[q[0], q[1], q[2]] for q in quads] + [[q[0], q[2], q[3]] for q in quads]
    return (corners * size + center)[np.array(triangles)]


def barrel(radius: float, length: float, segments: int = 32) -> Floats:
    """Return the triangles of a lying cylinder along y."""
    turn = np.linspace(0, 2 * np.pi, segments + 1)
    ring = np.stack([radius * np.cos(turn), np.zeros_like(turn), radius * np.sin(turn)], axis=1)
    half = np.array([0, length / 2, 0])
    near, far = ring - half, ring + half
    ends = np.array([[0, -length / 2, 0], [0, length / 2, 0]])
    triangles = []
    for k in range(segments):
        triangles += [[near[k], far[k], near[k + 1]], [near[k + 1], far[k], far[k + 1]]]
        triangles += [[ends[0], near[k], near[k + 1]], [ends[1], far[k + 1], far[k]]]
    return np.array(triangles)


def scene() -> SceneView:
    """Return a housing with a sensor and a plate below it, above a barrel on a table."""
    shift = transforms.from_translation(np.array([0.0, 0.0, 0.25]))
    bodies = (
        BodyView("head/housing", 0, box((0.45, 0.45, 0.2), (0, 0, 0)), (222, 226, 230, 255)),
        BodyView("room/stand", 1, box((0.3, 0.3, 1.8), (0, -1.0, 0.9)), (150, 160, 172, 255)),
        BodyView("table/body", 2, transforms.apply(shift, barrel(0.2, 0.9)), (224, 172, 140, 255)),
        BodyView("table/top", 2, box((0.6, 2.0, 0.06), (0, 0, 0)), (120, 140, 165, 255)),
    )
    return SceneView(
        "moving",
        "A housing comes down on a barrel.",
        LAYOUT.links,
        bodies,
        (drawn("distance", CONE), drawn("capacitive", GUARD)),
        {"moving.yaml": "version: 1\nname: moving\n"},
    )


def blocks(frames: int = 300) -> Iterator[FrameBlock]:
    """Yield a run in which the housing comes down to the barrel and goes up again."""
    k = np.arange(frames)
    height = 1.55 + 0.5 * np.cos(2 * np.pi * k / frames)
    gap = height - 0.1 - 1.25
    contact, bounds = gap <= 0, gap <= 0.1
    poses = transforms.identity(frames, 3)
    poses[:, 0, 2, 3] = height
    poses[:, 2, 2, 3] = 0.8
    level = np.zeros((frames, 2), dtype=np.uint8)
    level[:, 0] = bounds.astype(np.uint8) + contact
    near = gap < 0.4
    clearance = np.full((frames, 2), np.nan)
    clearance[near, 0] = np.maximum(gap[near], 0)
    evaluated = np.isfinite(clearance)
    seen = gap < 0.5
    point = np.full((frames, 1, 3), np.nan)
    point[seen, 0] = [0.0, 0.0, 1.25]
    volts = 0.05 / np.maximum(gap + 0.15, 0.05)
    for first in range(0, frames, BLOCK_FRAMES):
        s = slice(first, first + BLOCK_FRAMES)
        n = len(k[s])
        yield FrameBlock(
            LAYOUT,
            first,
            k[s].astype(np.int64) * 50_000_000 // 3,
            height[s, None],
            np.zeros((n, 1)),
            poses[s],
            CollisionColumns(level[s], clearance[s], evaluated[s], np.zeros((n, 2), dtype=np.bool_)),
            {
                "distance": DistanceColumns(
                    status=seen[s, None].astype(np.uint8),
                    distance=np.where(seen, np.maximum(gap, 0), np.nan)[s, None],
                    point=point[s],
                    point_sensor=point[s],
                    normal=point[s],
                    shape=np.where(seen, 2, -1)[s, None].astype(np.int32),
                    triangle=np.where(seen, 0, -1)[s, None].astype(np.int32),
                    case=seen[s, None].astype(np.uint8),
                ),
                "capacitive": CapacitiveColumns(
                    capacitance=volts[s, None] * 1e-12,
                    per_object=volts[s, None, None] * 1e-12,
                    output_voltage=2.5 - volts[s, None],
                    delta_output=volts[s, None],
                    saturated=np.zeros((n, 1), dtype=np.bool_),
                    touching=contact[s, None],
                ),
            },
        )
