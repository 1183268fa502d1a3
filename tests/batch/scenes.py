"""Small scenarios for runs of many, and what a worker does with those that are to fail."""

import os
import time

from replay.batch.case import CaseResult, run_case
from replay.batch.run import Execution
from replay.scenario.load import load_sources

TWO = Execution(workers=2)

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

MESHES = """
version: 1
name: meshes
rate: 10 Hz
duration: 2 s
links:
  ring: {shapes: {body: {type: mesh, file: ring.stl, scale: 1}}}
  open: {pose: {xyz: [0, 0, 1]}, shapes: {body: {type: mesh, file: open.stl, scale: 1}}}
  slide:
    joint: {type: prismatic, axis: [1, 0, 0], lower: -1, upper: 1, velocity: 1, acceleration: 2}
    shapes: {ball: {type: mesh, file: ball.stl, scale: 1}, rod: {type: cone, radius: 0.1, height: 0.4}}
  turn:
    parent: slide
    joint: {type: continuous}
    shapes: {bow: {type: arc, radius: 1, span: 2, width: 0.1, thickness: 0.1}}
  guest: {joint: {type: free}, shapes: {body: {type: cylinder, radius: 0.2, height: 1}}}
motion:
  moves: [{to: {slide: 0.6}}]
  free: {guest: [{time: 0, xyz: [2, 0, 0]}, {time: 2, xyz: [0, 0, 0.5], rpy: [0, 0, 1]}]}
sensors:
  distance: {eye: {link: slide, aperture: 40 deg, range: 2}}
  capacitive: {guard: {link: slide, plates: {p: {size: [0.1, 0.1]}}, coupling: 10 pF}}
"""


def text(name, *, distance=1.2, duration=1, tag="quick", contact="never"):
    return TEXT.format(name=name, distance=distance, duration=duration, tag=tag, contact=contact)


def scene(name, **values):
    return load_sources(f"{name}.yaml", {f"{name}.yaml": text(name, **values).encode()})


def with_meshes():
    """Every kind of sensor and joint, and a ball that goes into a ring, both from files, one of them with a hole."""
    import trimesh

    ring, ball = trimesh.creation.annulus(0.3, 0.5, 0.3), trimesh.creation.icosphere(2, 0.1)
    files = {"ring.stl": ring.export(file_type="stl"), "ball.stl": ball.export(file_type="stl")}
    ring.update_faces(range(1, len(ring.faces)))
    return load_sources(
        "meshes.yaml", {**files, "open.stl": ring.export(file_type="stl"), "meshes.yaml": MESHES.encode()}
    )


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
            eaten = b"x" * (800 << 20)
            time.sleep(3600)
            del eaten
    return run_case(order, progress)


def look_and_misbehave(order, progress):
    """Return what the folder holds when a scenario begins."""
    return CaseResult(order.scenario.name, frames=1, notes=tuple(sorted(file.name for file in order.folder.iterdir())))
