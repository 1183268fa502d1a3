"""A swinging arm, its log as another machine would write it, and the truth behind both in closed form."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
from mcap.writer import Writer

SCENARIO = """
version: 1
name: swing
rate: 100 Hz
duration: 2 s
links:
  wall: {shapes: {slab: {type: cuboid, size: [0.1, 4, 4], pose: {xyz: [1.55, 0, 0]}}}}
  arm:
    joint: {name: swing, type: revolute, axis: [0, 1, 0], lower: -100 deg, upper: 100 deg}
    shapes: {rod: {type: cuboid, size: [0.1, 0.1, 1], pose: {xyz: [0, 0, 0.5]}}}
motion:
  points:
    swing:
      - {time: 0, position: 0, velocity: 0}
      - {time: 1.2, position: 50 deg, velocity: 0}
      - {time: 2, position: 20 deg, velocity: 0}
sensors:
  distance: {tip: {link: arm, pose: {xyz: [0, 0, 1], rpy: [0, 90 deg, 0]}, aperture: 20 deg, range: 1.4}}
"""
RULES = """
rules_version: 1
rules:
  - {signal: "/measured/distance/*", abs: 6e-3, time: 40 ms, reason: noise of 1 mm}
  - {signal: "/joint_states/*", rms: 2e-3, reason: an encoder of 0.05 deg}
  - {signal: "/events/*", time: 40 ms, reason: it samples at 50 Hz}
"""
OFFSET = -1.25
"""[s] What is added to times of the logs to get those of the scenario."""


def position(time):
    """Return the joint's position [rad]: cubics from rest to rest."""
    first, second = np.clip(time / 1.2, 0, 1), np.clip((time - 1.2) / 0.8, 0, 1)
    blend = [s * s * (3 - 2 * s) for s in (first, second)]
    return np.radians(50 * blend[0] - 30 * blend[1])


def distance(time):
    """Return what the tip's sensor reads [m], NaN where the wall is out of its range.

    The cone's axis is at the angle q below the horizontal, its half aperture is 10 deg, the wall is the plane x = 1.5:
    the nearest point in the cone lies along its axis turned up to 10 deg towards the wall's normal.
    """
    q = position(time)
    off = np.maximum(q - math.radians(10), 0.0)
    found = (1.5 - np.sin(q)) / np.cos(off)
    return np.where(found <= 1.4, found, np.nan)


def times(rate=50.0, jitter=2e-3, seed=3):
    """Return times of a machine's samples [s] on the scenario's clock, before it to after it."""
    rng = np.random.default_rng(seed)
    time = np.arange(-0.4, 2.5, 1.0 / rate)
    return time + rng.uniform(-jitter, jitter, len(time))


def csv_log(path: Path, offset=OFFSET, scale=1.0, factor=1000.0, gap=None) -> Path:
    """Write a log in CSV: separated by semicolons, milliseconds and millimetres, -1 for nothing."""
    rng = np.random.default_rng(4)
    lines = ["t_ms;d1_mm;angle [deg];near"]
    for time in times().tolist():
        if gap is not None and gap[0] < time < gap[1]:
            continue
        d = float(distance(time))
        there = math.isfinite(d)
        shown = f"{factor * (scale * d + rng.normal(0, 1e-3)):.3f}" if there else "-1"
        angle = math.degrees(float(position(time))) + rng.normal(0, 0.05)
        lines.append(f"{(time - offset) * 1000:.4f};{shown};{angle:.4f};{str(there).lower()}")
    path.write_text("\n".join(lines) + "\n")
    return path


def mcap_log(path: Path, begin=1_700_000_000 * 10**9) -> Path:
    """Write a log of JSON messages with the values in a list, and joint states beside it, from 1970 on."""
    rng = np.random.default_rng(5)
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        schema = writer.register_schema("guard", "jsonschema", b"{}")
        guard = writer.register_channel("/bodyguard", "json", schema)
        for time in times(80.0, seed=6).tolist():
            d = float(distance(time))
            value = None if math.isnan(d) else 1000 * d + rng.normal(0, 1)
            angle = float(position(time)) + rng.normal(0, 1e-3)
            message = {"data": [0, value], "state": {"name": ["lift", "swing"], "position": [0.0, angle]}}
            stamp = begin + round((time + 0.5) * 1e9)
            writer.add_message(guard, stamp, json.dumps(message).encode(), stamp)
        writer.finish()
    return path


OF_CSV = """
  time: {column: t_ms, unit: ms}
  signals:
    /distance/tip/distance: {column: d1_mm, unit: mm, nothing: -1}
    /joint_states/position/swing: {column: "angle [deg]"}
    /events/detection/tip: {column: near}
  max_gap: 60 ms
"""
OF_MCAP = """
  signals:
    /distance/tip/distance: {topic: /bodyguard, field: "data[1]", unit: mm}
    /joint_states/position/swing: {topic: /bodyguard, field: "state.position[swing]"}
  max_gap: 50 ms
"""


def map_of(text: str) -> str:
    """Return what `measured` holds as a map file."""
    return "\n".join(line.removeprefix("  ") for line in text.splitlines())
