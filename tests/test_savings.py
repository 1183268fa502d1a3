"""With every saving switched off the results are the same."""

from pathlib import Path

import numpy as np
import pytest

from replay.collision.columns import Crossings
from replay.collision.pairs import CollisionBody, PairRules
from replay.collision.pipeline import CollisionPipeline
from replay.errors import InvalidValue
from replay.geometry.primitives import cuboid
from replay.recording.reader import read
from replay.recording.record import record
from replay.scenario.load import load, load_cases
from replay.scenario.methods import CollisionMethod, Model
from replay.scenario.scene import build
from replay.sensing.capacitive.part import CapacitiveMethod
from replay.sensing.distance.part import DistanceMethod
from replay.simulation import Simulation
from tests.collision.scenes import free_links

SHIPPED = sorted(path for path in Path("scenarios").glob("*.yaml") if path.name != "rules.yaml")


def thinned(scenario, frames):
    """The same motion with so many frames, or with as many as its signals have samples."""
    sensors = [sensor for kind in ("distance", "capacitive") for sensor in scenario.sensors.of(kind).values()]
    sampled = [sensor.signal.rate for sensor in sensors if sensor.signal is not None and sensor.signal.rate]
    return scenario.model_copy(update={"rate": max([(frames - 1) / scenario.duration, *sampled])})


def both(scenario, model=None):
    """All columns of a run with savings and of one without."""
    found = []
    for savings in (True, False):
        simulation = Simulation(build(scenario, model=model, savings=savings))
        blocks = list(simulation.blocks())
        columns = {}
        for group in ("collision", "distance", "capacitive"):
            if getattr(blocks[0], group) is not None:
                names = [field.name for field in getattr(blocks[0], group).present()]
                for name in names:
                    columns[f"{group}.{name}"] = np.concatenate([getattr(getattr(b, group), name) for b in blocks])
            if group == "collision":
                crossings = Crossings.joined([block.collision.crossings for block in blocks])
                columns |= {f"crossings.{name}": values for name, values in vars(crossings).items()}
        found.append((simulation, columns))
    return found


def compare(columns, others, rtol=0.0):
    """Bit for bit, but for what a tree summed."""
    assert columns.keys() == others.keys()
    for name, values in columns.items():
        if rtol and name.startswith("capacitive.") and values.dtype == np.float64:
            # a voltage is smoother than its capacitance; the delta output is at most as sensitive as it, relative to it
            np.testing.assert_allclose(values, others[name], rtol=rtol, atol=0.0, err_msg=name)
        else:
            np.testing.assert_array_equal(values, others[name], err_msg=name)


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
@pytest.mark.compiled
def test_shipped_scenarios_read_the_same(path):
    for scenario in load_cases(path):
        # 6 Hz, with what stands still for longer than that
        (saving, columns), (full, others) = both(thinned(scenario, 37))
        compare(columns, others, saving.scene.model.capacitive.options().get("rtol", 1e-12))
        assert (full.collision.counters.narrow, full.collision.counters.repeated) == (
            columns["collision.level"].size,
            0,
        )
        assert saving.collision.counters.narrow < 0.5 * full.collision.counters.narrow


DWELLS = """
version: 1
name: dwells
rate: 20 Hz
duration: 3 s
links:
  room: {pose: {xyz: [5, 2, 0]}}
  wall:
    parent: room
    shapes:
      slab: {type: cuboid, size: [0.1, 2, 2], pose: {xyz: [1.1, 0, 0]}}
      bow: {type: arc, radius: 1, span: 2, width: 0.1, thickness: 0.1, chord_error: 0.01, pose: {xyz: [0, 0, 1]}}
  shelf: {parent: room, shapes: {board: {type: cuboid, size: [1, 0.3, 0.05], pose: {xyz: [1.1, 0, -0.4]}}}}
  arm:
    parent: room
    joint: {name: swing, type: revolute, axis: [0, 1, 0], lower: -100 deg, upper: 100 deg, velocity: 2, acceleration: 4}
    shapes: {rod: {type: cylinder, radius: 0.05, height: 1, pose: {xyz: [0, 0, 0.5]}}}
motion:
  moves: [{to: {swing: 95 deg}, start: 1 s}]
collision: {margin: 0.3}
sensors:
  distance:
    tip: {link: arm, pose: {xyz: [0, 0, 1], rpy: [0, 90 deg, 0]}, aperture: 20 deg, range: 3}
    still: {link: shelf, pose: {xyz: [0.2, 0, 0]}, aperture: 60 deg, range: 3, ignore: [arm]}
  capacitive:
    pad: {link: arm, plates: {p: {pose: {xyz: [0, 0, 1.1]}, size: [0.1, 0.1]}}, coupling: 10 pF, side: both}
    still: {link: shelf, plates: {p: {pose: {xyz: [0.2, 0, 0.1]}, size: [0.1, 0.1]}}, coupling: 10 pF, ignore: [arm]}
"""


@pytest.fixture
def dwells(tmp_path):
    path = tmp_path / "dwells.yaml"
    path.write_text(DWELLS)
    return load(path)


MODELS = {
    "defaults": Model(),
    "exact, all clearances": Model(
        collision=CollisionMethod(bounds="aabb", clearance="always"), capacitive=CapacitiveMethod(method="exact")
    ),
    "spheres, no clearances": Model(collision=CollisionMethod(bounds="sphere", pieces="convex", clearance="never")),
    "other engines": Model(
        collision=CollisionMethod(narrowphase="fcl"),
        distance=DistanceMethod(method="rays", count=61),
        capacitive=CapacitiveMethod(method="midpoint", splits=2),
    ),
    "thesis": Model(distance=DistanceMethod(method="thesis")),
}


@pytest.mark.parametrize("name", MODELS)
def test_models_read_the_same(dwells, name):
    model = MODELS[name]
    (_, columns), (_, others) = both(dwells, model)
    compare(columns, others, model.capacitive.options().get("rtol", 0.0))
    assert (columns["collision.level"] == 2).any()
    assert (columns["collision.level"] == 0).any()
    assert np.isfinite(columns["distance.distance"][:, 1]).all()


def test_what_is_left_out_is_counted(dwells):
    (saving, columns), (full, _) = both(dwells)
    frames = len(columns["collision.level"])
    turns = np.diff(np.concatenate([block.joint_positions[:, 0] for block in Simulation(saving.scene).blocks()]))
    dwell = int((turns == 0.0).sum())
    assert dwell > 20
    # two of the pairs, shelf with bow and slab, cannot move; the readings of the still sensors repeat in all frames
    collision, distance, capacitive = saving.collision.counters, saving.distance.counters, saving.capacitive.counters
    assert (collision.static, full.collision.counters.static) == (2 * frames, 0)
    assert distance.readings == frames * (3 + 2)
    assert distance.repeated == 2 * (frames - 1) + 3 * dwell
    assert distance.computed < distance.looked_at < distance.triangles
    assert full.distance.counters.computed == full.distance.counters.triangles
    assert capacitive.integrals == frames * (3 + 2)
    assert capacitive.repeated >= 2 * (frames - 1) + 3 * dwell
    assert 0 < capacitive.in_clusters < capacitive.triangles
    assert full.capacitive.counters.repeated == 0


def test_the_recording_says_that_savings_were_off(dwells, tmp_path):
    paths = [record(dwells, tmp_path / name, savings=on, rrd=False).mcap for name, on in (("a", True), ("b", False))]
    models = [dict(read(path).provenance.model) for path in paths]
    assert models[1].pop("savings") == "off"
    assert models[0] == models[1]


def test_rules_cannot_be_without_savings():
    linkage = free_links(2)
    bodies = [CollisionBody(f"l{k}/s", k, cuboid((1.0, 1.0, 1.0))) for k in range(2)]
    with pytest.raises(InvalidValue, match="savings"):
        CollisionPipeline(bodies, PairRules(bodies, linkage), linkage, savings=False)
