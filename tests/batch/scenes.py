"""Small scenarios for runs of many, and what a worker does with those that are to fail."""

import os
import time

from replay.batch.case import run_case
from replay.scenario.load import load_sources

TEXT = """
version: 1
name: {name}
rate: 10 Hz
duration: {duration} s
tags: [{tag}]
links:
  wall: {{shapes: {{slab: {{type: cuboid, size: [0.1, 2, 2], pose: {{xyz: [{distance}, 0, 0]}}}}}}}}
  arm:
    joint: {{type: revolute, axis: [0, 1, 0], lower: -100 deg, upper: 100 deg}}
    shapes: {{rod: {{type: cuboid, size: [0.1, 0.1, 1], pose: {{xyz: [0, 0, 0.5]}}}}}}
motion: {{points: {{arm: [{{time: 0, position: 0}}, {{time: 1, position: 60 deg}}]}}}}
sensors: {{distance: {{tip: {{link: arm, pose: {{xyz: [0, 0, 1], rpy: [0, 90 deg, 0]}}, aperture: 20 deg, range: 3}}}}}}
expect: [{{pair: [arm, wall], contact: {contact}}}]
"""


def text(name, *, distance=1.2, duration=1, tag="quick", contact="never"):
    return TEXT.format(name=name, distance=distance, duration=duration, tag=tag, contact=contact)


def scene(name, **values):
    return load_sources(f"{name}.yaml", {f"{name}.yaml": text(name, **values).encode()})


def write(folder, name, **values):
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{name}.yaml"
    path.write_text(text(name, **values))
    return path


def misbehave(order, progress):
    """Run a scenario, unless its name says that it crashes, hangs or eats memory."""
    match order.scenario.name.split("_")[0]:
        case "crash":
            print("about to crash")
            os._exit(139)
        case "raise":
            raise MemoryError("no room for 8 GiB")
        case "hang":
            time.sleep(3600)
        case "eat":
            eaten = []
            while True:
                eaten.append(b"x" * (20 << 20))
                time.sleep(0.01)
    return run_case(order, progress)
