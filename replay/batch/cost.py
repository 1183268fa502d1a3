"""How long a scenario is expected to take, for the order in which scenarios begin: the longest first."""

from __future__ import annotations

from replay.scenario.model import Scenario
from replay.scenario.shapes import MeshPart
from replay.sensing.kinds import KINDS

_BYTES_PER_TRIANGLE = 50  # of a binary STL file
_TRIANGLES_OF_A_PRIMITIVE = 100


def expected_cost(scenario: Scenario) -> float:
    """Return a rough estimate: frames times pairs and sensors, and what every triangle costs once.

    Only the order of the estimates matters, and no result depends on it.
    """
    shapes = [(link, name, shape) for link, entry in scenario.links.items() for name, shape in entry.shapes.items()]
    colliding = sum(shape.collide for *_, shape in shapes) if scenario.collision.pairs == "all" else 0
    meshes = {
        scenario.provenance.meshes.get((link, name), "") for link, name, shape in shapes if isinstance(shape, MeshPart)
    }
    triangles = len(shapes) * _TRIANGLES_OF_A_PRIMITIVE
    triangles += sum(len(scenario.sources.get(mesh, b"")) for mesh in meshes) // _BYTES_PER_TRIANGLE
    pairs = colliding * (colliding - 1) / 2
    sensors = (
        kind.cost(sensor, triangles) for kind in KINDS.values() for sensor in scenario.sensors.of(kind.name).values()
    )
    frame = 10.0 + pairs + sum(sensors)
    return scenario.frames * frame + 10.0 * triangles
