"""Kernels compiled before anything is timed: a small scene that needs all that the scenarios of a run need."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from replay.scenario.methods import CapacitiveMethod, DistanceMethod, Model
from replay.scenario.model import Scenario

_SCENE = b"""
version: 1
name: prepare
rate: 10 Hz
duration: 0.9 s
links:
  table:
    shapes:
      top: {type: cuboid, size: [1, 1, 0.1]}
      ball: {type: sphere, radius: 0.2, pose: {xyz: [0, 0, -0.5]}}
      sheet: {type: plane, size: [0.5, 0.5], pose: {xyz: [0, 0.8, 0.3]}}
  bow:
    parent: table
    joint: {type: revolute, axis: [0, 1, 0], lower: -3, upper: 3}
    shapes: {bow: {type: arc, radius: 1, span: 3, width: 0.1, thickness: 0.1, chord_error: 0.01}}
  tool:
    parent: bow
    joint: {type: prismatic, axis: [0, 0, 1], lower: -2, upper: 2, velocity: 1, acceleration: 9}
    shapes: {can: {type: cylinder, radius: 0.1, height: 0.3}, tip: {type: cone, radius: 0.1, height: 0.2}}
  guest:
    joint: {type: free}
    shapes: {body: {type: sphere, radius: 0.3, chord_error: 0.2 mm}}
  corner: {shapes: {SHAPES}}
motion:
  points: {bow: [{time: 0, position: -1}, {time: 0.9, position: 1}]}
  moves: [{to: {tool: 0.5}, speed: 1}]
  free: {guest: [{time: 0, xyz: [2, 0, 0]}, {time: 0.9, xyz: [0, 0, 0.5]}]}
collision: {pairs: PAIRS, margin: 0.2}
sensors: {SENSORS}
"""
_DISTANCE = "distance: {eye: {link: tool, pose: {rpy: [3.1, 0, 0]}, aperture: 1, range: 3}}"
_MESH = "walls: {type: mesh, file: corner.obj, scale: 1, pose: {xyz: [-0.5, -2.5, -0.5]}}"
_CAPACITIVE = "capacitive: {guard: {link: tool, plates: {a: {size: [0.1, 0.1]}}, coupling: 10 pF}}"

_CORNER = b"""
v 0 0 0\nv 4 0 0\nv 4 1 0\nv 1 1 0\nv 1 4 0\nv 0 4 0
v 0 0 1\nv 4 0 1\nv 4 1 1\nv 1 1 1\nv 1 4 1\nv 0 4 1
f 4 2 1\nf 4 3 2\nf 4 1 6\nf 4 6 5\nf 7 8 10\nf 8 9 10\nf 7 10 12\nf 10 11 12
f 1 2 8\nf 1 8 7\nf 2 3 9\nf 2 9 8\nf 3 4 10\nf 3 10 9\nf 4 5 11\nf 4 11 10\nf 5 6 12\nf 5 12 11\nf 6 1 7\nf 6 7 12
"""
"""A closed body like the letter L: what is between its legs is within its hull, and not within the body."""


@dataclass(frozen=True)
class Needs:
    """What scenarios compute, and by which methods; numbers that do not change what is compiled are left out."""

    model: Model
    collision: bool
    distance: bool
    capacitive: bool
    meshes: bool


def needs_of(scenarios: Sequence[Scenario], model: Model | None) -> tuple[Needs, ...]:
    """Return what scenarios need, each combination once."""
    needs = (
        Needs(
            _methods(model or scenario.model),
            collision=scenario.collision.pairs == "all",
            distance=bool(scenario.sensors.distance),
            capacitive=bool(scenario.sensors.capacitive),
            meshes=bool(scenario.provenance.meshes),
        )
        for scenario in scenarios
    )
    return tuple(dict.fromkeys(needs))


def _methods(model: Model) -> Model:
    distance = DistanceMethod(method=model.distance.method, engine=model.distance.engine)
    return Model(
        collision=model.collision, distance=distance, capacitive=CapacitiveMethod(method=model.capacitive.method)
    )


@dataclass(frozen=True)
class PrepareKernels:
    """What a worker calls before its first scenario: compiles kernels, or loads those that are compiled already.

    Attributes:
        needs: what its scenarios compute.
        rrd: they make rerun recordings too, so that library is loaded as well.
        savings: see `simulation.simulate`.
    """

    needs: tuple[Needs, ...]
    rrd: bool = False
    savings: bool = True

    def __call__(self, tell: Callable[[str], None]) -> None:
        """Run the small scene with each combination of methods."""
        from replay.numerics.announcement import announce_by
        from replay.scenario.load import load_sources
        from replay.simulation import simulate

        announce_by(tell)
        for needs in self.needs:
            sensors = [text for text, used in ((_DISTANCE, needs.distance), (_CAPACITIVE, needs.capacitive)) if used]
            text = _SCENE.replace(b"PAIRS", b"all" if needs.collision else b"none")
            text = text.replace(b"{SENSORS}", f"{{{', '.join(sensors)}}}".encode())
            text = text.replace(b"{SHAPES}", f"{{{_MESH if needs.meshes else ''}}}".encode())
            scenario = load_sources("prepare.yaml", {"prepare.yaml": text, "corner.obj": _CORNER})
            for _ in simulate(scenario, model=needs.model, savings=self.savings):
                pass
        if self.rrd:
            importlib.import_module("rerun")
