"""The stream of blocks: complete, independent of each other, and only what the scene asks for."""

import dataclasses

import numpy as np
import pytest

import replay
from replay import simulation
from replay.scenario.methods import BUILTIN_MODELS
from replay.scenario.scene import build
from replay.simulation import BLOCK_FRAMES, Simulation, block_frames
from tests.amounts import COMPILED

RATE, BLOCK = (100, BLOCK_FRAMES) if COMPILED else (8, 20)
"""Frames a second, and in a block: two blocks and a part of one."""
FRAMES = 6 * RATE + 1

SCENE = """
version: 1
name: swing
rate: RATE
duration: 6 s
links:
  room: {pose: {xyz: ROOM}}
  wall: {parent: room, shapes: {slab: {type: cuboid, size: [0.1, 2, 2], pose: {xyz: [1.1, 0, 0]}}}}
  arm:
    parent: room
    joint: {name: swing, type: revolute, axis: [0, 1, 0], lower: -100 deg, upper: 100 deg, velocity: 1, acceleration: 2}
    shapes: {rod: {type: cylinder, radius: 0.05, height: 1, pose: {xyz: [0, 0, 0.5]}}}
motion:
  moves: [{to: {swing: 90 deg}, start: 1 s}, {to: {swing: 20 deg}}]
"""
SENSORS = """
sensors:
  distance: {tip: {link: arm, pose: {xyz: [0, 0, 1], rpy: [0, 90 deg, 0]}, aperture: 20 deg, range: 3}}
  capacitive:
    pad: {link: arm, plates: {p: {pose: {xyz: [0, 0, 1.1]}, size: [0.1, 0.1]}}, coupling: 10 pF, side: both}
"""


def scenario(tmp_path, text, room="[0, 0, 0]"):
    path = tmp_path / "swing.yaml"
    path.write_text(text.replace("ROOM", room).replace("RATE", str(RATE)))
    return replay.load(path)


def columns(block):
    """All arrays of a block by name, those of its groups included."""
    found = {}
    for field in dataclasses.fields(block):
        value = getattr(block, field.name)
        if isinstance(value, np.ndarray):
            found[field.name] = value
        elif dataclasses.is_dataclass(value) and field.name != "layout":
            found |= {f"{field.name}.{name}": array for name, array in vars(value).items()}
    return found


@pytest.fixture
def swing(tmp_path, monkeypatch):
    monkeypatch.setattr(simulation, "BLOCK_FRAMES", BLOCK)
    return scenario(tmp_path, SCENE + SENSORS)


def test_blocks_hold_all_frames_once_and_in_order(swing):
    blocks = list(replay.simulate(swing))
    assert [len(block.time) for block in blocks] == [BLOCK, BLOCK, FRAMES - 2 * BLOCK]
    assert [block.first for block in blocks] == [0, BLOCK, 2 * BLOCK]
    assert np.concatenate([block.time for block in blocks]).tolist() == [k * 10**9 // RATE for k in range(FRAMES)]


@pytest.mark.parametrize(("pairs", "frames"), [(0, 256), (319, 256), (8_192, 256), (179_700, 11), (10**8, 1)])
def test_blocks_of_many_pairs_have_fewer_frames(pairs, frames):
    assert block_frames(pairs) == frames


def test_a_block_is_the_same_whoever_computes_it_and_in_whatever_order(swing):
    streamed = list(Simulation(build(swing)).blocks())
    for k in (2, 0, 1):
        alone = columns(Simulation(build(swing)).block(streamed[k].first))
        for name, values in columns(streamed[k]).items():
            np.testing.assert_array_equal(alone[name], values, err_msg=name)


def test_only_what_the_scene_asks_for_is_computed(tmp_path):
    block = next(replay.simulate(scenario(tmp_path, SCENE)))
    assert block.collision is not None
    assert block.distance is None
    assert block.capacitive is None
    empty = next(replay.simulate(scenario(tmp_path, SCENE + "collision: {pairs: none}\n")))
    assert empty.collision is None


def test_a_machine_far_from_the_origin_reads_the_same(tmp_path):
    here = list(replay.simulate(scenario(tmp_path, SCENE + SENSORS)))
    far = list(replay.simulate(scenario(tmp_path, SCENE + SENSORS, room="[1e6, -3e5, 1e3]")))
    for near, away in zip(here, far, strict=True):
        np.testing.assert_array_equal(near.collision.clearance, away.collision.clearance)
        np.testing.assert_array_equal(near.distance.distance, away.distance.distance)
        np.testing.assert_array_equal(near.capacitive.capacitance, away.capacitive.capacitance)


def test_a_model_replaces_the_scenarios_own(swing):
    own = np.concatenate([block.capacitive.capacitance for block in replay.simulate(swing)])
    thesis = BUILTIN_MODELS["thesis2015"]
    other = np.concatenate([block.capacitive.capacitance for block in replay.simulate(swing, model=thesis)])
    named = np.concatenate([block.capacitive.capacitance for block in replay.simulate(swing, model="thesis2015")])
    np.testing.assert_array_equal(named, other)
    assert not np.array_equal(own, other)
    finite = np.isfinite(own) & np.isfinite(other)
    assert finite.any()
    # midpoint splitting with n = 4 is a quadrature of 256 points a triangle: near the plates a few per cent
    np.testing.assert_allclose(other[finite], own[finite], rtol=0.1)


def test_the_levels_follow_the_geometry(swing):
    blocks = list(replay.simulate(swing))
    level = np.concatenate([block.collision.level[:, 0] for block in blocks])
    angle = np.concatenate([block.joint_positions[:, 0] for block in blocks])
    clearance = np.concatenate([block.collision.clearance[:, 0] for block in blocks])
    evaluated = np.concatenate([block.collision.evaluated[:, 0] for block in blocks])
    # the rod's end disk, 1 m from the pivot, leans towards a wall whose face is at x = 1.05 and never gets there
    reach = np.sin(angle) + 0.05 * np.cos(angle)
    assert (level < 2).all()
    near = evaluated & (angle < 1.5)
    assert near.any()
    # the disk's rim is tessellated: its chords stay inside the circle by at most 1 mm
    assert np.all(clearance[near] - (1.05 - reach[near]) <= 1e-3)
    assert np.all(clearance[near] - (1.05 - reach[near]) >= -1e-12)
