"""Bounds along directions: what looks plausible and is false is not what is used."""

import math

import numpy as np
import pytest

from replay.collision.columns import Between
from replay.collision.pairs import CollisionBody, plan_pairs
from replay.collision.pipeline import CollisionPipeline
from replay.geometry.primitives import cube, cuboid, cylinder
from replay.kinematics.linkage import Joint, JointType, Link, Linkage
from replay.kinematics.motion import Keyframe, Script, Waypoint, plan
from replay.numerics import transforms

PRISMATIC, REVOLUTE = JointType.PRISMATIC, JointType.REVOLUTE
WALL = Link("wall", None, np.identity(4), Joint("wall"))


def at(x, y=0.0, z=0.0):
    return transforms.from_translation(np.array([x, y, z]))


def look(links, solids, script, frames=2, rate=1.0, **options):
    """(columns, counters) of frames at `rate`."""
    linkage = Linkage(links)
    motion = plan(linkage, script)
    bodies = [CollisionBody(f"{name}/s", linkage.link_index(name), solid) for name, solid in solids.items()]
    engine = CollisionPipeline(bodies, plan_pairs(bodies, linkage), linkage, motion=motion, **options)
    time = np.round(np.arange(frames) * 1e9 / rate).astype(np.int64)
    states = motion.states(time / 1e9)
    return engine.run(linkage.forward(states.positions, states.free_poses), time=time), engine.counters


def test_a_bound_along_a_direction_is_not_half_of_the_proof():
    """A point goes round the corner of a 1 m cube from (2, .5): 1.5 m along -x, then 1.5 m along y, through the cube.

    From its first place it is 1 m apart along x, from its last one 1 m along y, and neither bound is false; added up
    against half of the way each they would prove it clear.
    """
    links = [
        Link("slide", None, at(2.0, 0.5), Joint("x", PRISMATIC, (-1.0, 0.0, 0.0))),
        Link("dot", "slide", np.identity(4), Joint("y", PRISMATIC, (0.0, 1.0, 0.0))),
        WALL,
    ]
    script = Script(
        points={
            "x": (Waypoint(0.0, 0.0), Waypoint(0.5, 1.5), Waypoint(1.0, 1.5)),
            "y": (Waypoint(0.0, 0.0), Waypoint(0.5, 0.0), Waypoint(1.0, 1.5)),
        }
    )
    solids = {"dot": cube(1e-6), "wall": cube(1.0).transformed(at(0.5, 0.5))}
    columns, _ = look(links, solids, script)
    assert columns.between[1, 0] == Between.CONTACT
    # it comes to x = 1 after 1 m of the first 1.5
    first = columns.crossings.latest[columns.crossings.level == 2][0]
    assert first == pytest.approx(1e9 / 3.0, abs=1e3)


@pytest.mark.parametrize("reach", [0.1, 0.13, 0.2])
def test_cross_terms_of_joints_count(reach):
    """A turn by 0.5 rad about z and a slide by 0.3 m along the turned x: to y = 0.3 sin .5 = 0.1438 beside the x axis.

    To first order at the start nothing moves along y.
    """
    links = [
        Link("arm", None, np.identity(4), Joint("turn", REVOLUTE, (0.0, 0.0, 1.0))),
        Link("tip", "arm", np.identity(4), Joint("push", PRISMATIC, (1.0, 0.0, 0.0))),
        WALL,
    ]
    script = Script(points={"turn": (Waypoint(0, 0), Waypoint(1, 0.5)), "push": (Waypoint(0, 0), Waypoint(1, 0.3))})
    small = 1e-6
    solids = {"tip": cube(small), "wall": cuboid((4.0, 1.0, 1.0)).transformed(at(0.0, reach + 0.5))}
    columns, _ = look(links, solids, script)
    meets = reach < 0.3 * math.sin(0.5)
    assert columns.between[1, 0] == (Between.CONTACT if meets else Between.CLEAR)
    if not meets:
        assert columns.clearance_bound[1, 0] <= reach - 0.3 * math.sin(0.5)


GAPS = (1e-3, 1e-6, 1e-9)


@pytest.mark.parametrize("gap", GAPS)
@pytest.mark.parametrize("bounds", ["obb", "aabb"])
def test_a_slide_just_above_a_plane_takes_few_queries(gap, bounds):
    links = [Link("block", None, at(-0.5, 0.0, 0.05 + gap), Joint("x", PRISMATIC, (1.0, 0.0, 0.0))), WALL]
    solids = {"block": cube(0.1), "wall": cuboid((2.0, 2.0, 0.1)).transformed(at(0.0, 0.0, -0.05))}
    script = Script(points={"x": (Waypoint(0.0, 0.0), Waypoint(1.0, 1.0))})
    columns, counters = look(links, solids, script, bounds=bounds)
    assert columns.between[1, 0] == Between.CLEAR
    assert gap * (1.0 - 1e-3) <= columns.clearance_bound[1, 0] <= gap * (1.0 + 1e-12)
    assert counters.moments <= 8


@pytest.mark.parametrize("gap", GAPS)
def test_a_turntable_just_below_a_block_takes_few_queries(gap):
    links = [Link("table", None, np.identity(4), Joint("q", REVOLUTE, (0.0, 0.0, 1.0))), WALL]
    disc = cylinder(0.5, 0.1, 1e-3).transformed(at(0.0, 0.0, -0.05))
    script = Script(points={"q": (Waypoint(0.0, 0.0), Waypoint(1.0, 3.0))})
    columns, counters = look(links, {"table": disc, "wall": cube(0.1).transformed(at(0.3, 0.0, 0.05 + gap))}, script)
    assert columns.between[1, 0] == Between.CLEAR
    assert counters.moments <= 8


@pytest.mark.parametrize("gap", GAPS)
def test_a_rod_that_swings_past_below_takes_few_queries(gap):
    links = [Link("rod", None, np.identity(4), Joint("q", REVOLUTE, (0.0, 0.0, 1.0))), WALL]
    solids = {"rod": cuboid((2.0, 0.02, 0.02)), "wall": cube(0.1).transformed(at(0.6, 0.5, 0.06 + gap))}
    script = Script(points={"q": (Waypoint(0.0, 0.0), Waypoint(1.0, 3.0))})
    columns, counters = look(links, solids, script)
    assert columns.between[1, 0] == Between.CLEAR
    assert counters.moments <= 8


@pytest.mark.parametrize("gap", GAPS)
def test_a_free_body_that_slides_and_spins_above_a_plane_takes_few_queries(gap):
    """Over three key frames, so that an interval holds two stretches."""
    s = math.sqrt(0.5)
    keys = (
        Keyframe(0.0, (-0.5, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)),
        Keyframe(0.55, (0.0, 0.3, 0.0), (0.0, 0.0, s, s)),
        Keyframe(1.0, (0.5, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0)),
    )
    links = [Link("top", None, at(0.0, 0.0, 0.05 + gap), Joint("f", JointType.FREE)), WALL]
    solids = {"top": cube(0.1), "wall": cuboid((4.0, 4.0, 0.1)).transformed(at(0.0, 0.0, -0.05))}
    columns, counters = look(links, solids, Script(free={"f": keys}), frames=3, rate=2.0)
    assert columns.between[1:, 0].tolist() == [Between.CLEAR] * 2
    assert counters.moments <= 20


@pytest.mark.parametrize("turn", [0.0, 3.0])
@pytest.mark.parametrize("gap", GAPS)
def test_the_way_of_a_free_body_lies_in_its_joints_place_however_that_is_turned(gap, turn):
    """The place is turned about no axis of its own, so each of its nine numbers counts; the way is along the world's x.

    A cube spins about z just above a plane, then just so deep that it touches: as in a place that is not turned.
    """
    axis = np.array([1.0, -2.0, 3.0]) / math.sqrt(14.0)
    place = transforms.from_axis_angle(axis, np.array(0.7))
    for height, expected in ((gap, Between.CLEAR), (-gap, Between.CONTACT)):
        keys = []
        for time, x, angle in ((0.0, -0.5, 0.0), (1.0, 0.5, turn)):
            pose = transforms.from_axis_angle(np.array([0.0, 0.0, 1.0]), np.array(angle))
            pose[:3, 3] = x, 0.2 * x, 0.05 + height
            inside = transforms.compose(transforms.invert(place), pose)
            keys.append(Keyframe(time, tuple(inside[:3, 3]), tuple(transforms.to_quaternion(inside))))
        links = [Link("top", None, place, Joint("f", JointType.FREE)), WALL]
        solids = {"top": cube(0.1), "wall": cuboid((0.2, 4.0, 0.1)).transformed(at(0.0, 0.0, -0.05))}
        columns, counters = look(links, solids, Script(free={"f": tuple(keys)}))
        assert columns.between[1, 0] == expected
        if expected == Between.CLEAR:
            assert gap * (1.0 - 1e-3) - 1e-15 <= columns.clearance_bound[1, 0] <= gap * (1.0 + 1e-6)
            assert counters.moments <= 12
