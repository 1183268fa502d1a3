"""The narrow phase in its kernels: what doubles leave is decided by the others, and nobody sees which one did."""

import numpy as np
import pytest

from replay.collision import narrow
from replay.collision.columns import Level
from replay.geometry.primitives import cube, cuboid
from replay.geometry.solid import Solid
from replay.numerics import transforms
from tests.collision import scenes


def shell():
    """Return a cube with a small one inside its upper face: a surface that is collided by its triangles."""
    outer, dent = cube(2.0).triangles, cuboid((0.2, 0.2, 0.2)).triangles[:, ::-1] + np.array([0.0, 0.0, 0.9])
    return Solid(np.concatenate([outer, dent]))


def dwelling(rng):
    """Return poses (40, 3, 4, 4): a cube that nears a face to 1e-17, rests, goes inside a surface, and rests there."""
    poses = np.tile(np.identity(4), (40, 3, 1, 1))
    gap = np.concatenate([10.0 ** -np.arange(1.0, 18.0), np.full(3, 1e-17), np.full(5, 0.0)])
    poses[:25, 1, 0, 3] = 1.0 + 0.05 + gap
    poses[25:, 1, :3, 3] = np.linspace((0.4, 0.1, 0.0), (0.0, 0.1, 0.2), 15)
    poses[30:35, 1] = poses[30, 1]  # at rest while it is held
    poses[:, 2] = transforms.from_translation(rng.normal(size=(40, 3)) * 0.05 + np.array([1.4, 0.0, 0.0]))
    return poses


def columns(**options):
    engine, linkage = scenes.pipeline([shell(), cube(0.1), cuboid((0.3, 0.2, 0.1))], **options)
    found = engine.run(linkage.forward(np.zeros((40, 0)), dwelling(np.random.default_rng(5))))
    return found, engine


@pytest.mark.parametrize("savings", [True, False])
def test_who_decides_does_not_show(monkeypatch, savings):
    found, engine = columns(clearance="always", savings=savings)
    monkeypatch.setattr(narrow, "decide_by_doubles", lambda *arguments: None)
    alone, other = columns(clearance="always", savings=savings)
    for name in ("level", "clearance", "undecided"):
        np.testing.assert_array_equal(getattr(found, name), getattr(alone, name))
    assert engine.counters == other.counters
    assert engine.counters.gjk_exact > 0  # both kinds of what doubles leave are in it
    assert engine.counters.contained > 0


def test_a_pair_is_left_only_where_it_must_be(monkeypatch):
    asked = []
    everything, inside = narrow.decide_all, narrow.look_inside
    monkeypatch.setattr(narrow, "decide_all", lambda *given: (asked.append(given[3].sum()), everything(*given)))
    monkeypatch.setattr(narrow, "look_inside", lambda *given: (asked.append("inside"), inside(*given)))
    found, _ = columns(clearance="always")
    assert asked == [1, "inside"]
    assert (found.level[25:, 0] == Level.CONTACT).all()


def test_scenes_apart_ask_for_doubles_alone(monkeypatch):
    for rare in ("decide_all", "look_inside"):
        monkeypatch.setattr(narrow, rare, None)
    solids = [cube(1.0), cube(1.0)]
    poses = np.tile(np.identity(4), (10, 2, 1, 1))
    poses[:, 1, 0, 3] = np.linspace(1.01, 1.5, 10)
    found = scenes.run(solids, poses, clearance="always")
    np.testing.assert_allclose(found.clearance[:, 0], np.linspace(0.01, 0.5, 10), rtol=0, atol=1e-12)
