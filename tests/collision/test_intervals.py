"""What is said of pairs between their frames: never wrong, and to the microsecond."""

import itertools
import math

import numpy as np
import pytest

from replay.collision.columns import Between, Level
from replay.collision.pairs import CollisionBody, plan_pairs
from replay.collision.pipeline import CollisionPipeline
from replay.geometry.primitives import cube, cuboid, plane, sphere
from replay.kinematics.linkage import Joint, JointType, Link, Linkage
from replay.kinematics.motion import Keyframe, Script, Waypoint, plan
from replay.numerics import transforms
from tests.collision.articulated import BOUNDS, CLEARANCES, check_intervals, random_scene


def at(x, y=0.0, z=0.0):
    return transforms.from_translation(np.array([x, y, z]))


def run(links, solids, script, time, **options):
    """Columns at times [ns] of a solid on each link."""
    linkage = Linkage(links)
    motion = plan(linkage, script)
    bodies = [CollisionBody(f"{name}/s", linkage.link_index(name), solid) for name, solid in solids.items()]
    engine = CollisionPipeline(bodies, plan_pairs(bodies, linkage), linkage, motion=motion, **options)
    states = motion.states(time / 1e9)
    return engine.run(linkage.forward(states.positions, states.free_poses), time=time)


def contacts(columns):
    """(begins, earliest [s], latest [s], frame) of each crossing of level contact."""
    c = columns.crossings
    rows = zip(c.begins.tolist(), (c.earliest / 1e9).tolist(), (c.latest / 1e9).tolist(), c.frame.tolist(), strict=True)
    return [row for row, level in zip(rows, c.level.tolist(), strict=True) if level == Level.CONTACT]


def ticks(rate, count):
    return np.round(np.arange(count) * 1e9 / rate).astype(np.int64)


WALL = Link("wall", None, np.identity(4), Joint("wall"))


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"bounds": "sphere"},
        {"bounds": "aabb"},
        {"clearance": "never"},
        {"clearance": "always"},
        {"savings": False},
        {"narrowphase": "fcl"},
    ],
    ids=str,
)
def test_a_cube_that_flies_through_a_plate_between_two_frames(options):
    """5 cm at 2 m/s through 1 cm at 10 Hz: in contact from 0.46 s to 0.49 s, and clear in every frame."""
    links = [Link("cube", None, np.identity(4), Joint("x", JointType.PRISMATIC, (1.0, 0.0, 0.0))), WALL]
    solids = {"cube": cube(0.05), "wall": cuboid((0.01, 1.0, 1.0)).transformed(at(0.95))}
    script = Script(points={"x": (Waypoint(0.0, 0.0), Waypoint(1.0, 2.0))})
    columns = run(links, solids, script, ticks(10, 11), **options)
    assert (columns.level < Level.CONTACT).all()
    expected = [Between.CLEAR] * 11
    expected[0], expected[5] = Between.NOT_LOOKED, Between.CONTACT
    assert columns.between[:, 0].tolist() == expected
    (begins, earliest, latest, frame), (again, still, ended, last) = contacts(columns)
    assert (begins, frame, again, last) == (True, 5, False, 5)
    assert earliest <= 0.46 <= latest <= earliest + 1.001e-6
    assert still <= 0.49 <= ended <= still + 1.001e-6
    assert columns.clearance_bound[5, 0] == 0.0
    assert (np.delete(columns.clearance_bound[1:, 0], 4) > 0.0).all()


@pytest.mark.parametrize("slowed", [False, True])
@pytest.mark.parametrize("seed", range(24))
def test_nothing_false_on_random_articulated_motions(seed, slowed):
    counts = check_intervals(seed, samples=60, slowed=slowed)
    assert counts[Between.UNDECIDED] == 0


def turning(length, axis=(0.0, 1.0, 0.0)):
    """A rod of no thickness from the axis to `length` along x."""
    rod = cuboid((length, 1e-3 * length, 1e-3 * length)).transformed(at(0.5 * length))
    return Link("rod", None, np.identity(4), Joint("q", JointType.REVOLUTE, axis)), rod


@pytest.mark.parametrize(
    ("seed", "size", "rate"), list(itertools.product(range(3), (1e-3, 1.0, 1e3), (2.0, 60.0, 1000.0)))
)
def test_a_rod_that_turns_into_a_plane(seed, size, rate):
    """The lower edge of its end, at (l, -e), stands h above or below the axis when l sin(q) + e cos(q) = h."""
    rng = np.random.default_rng([seed, int(rate)])
    length = size * rng.uniform(0.5, 1.0)
    speed, start = 10.0 ** rng.uniform(-1, 0.3), rng.uniform(0.0, 0.2)
    link, rod = turning(length, axis=(0.0, -1.0, 0.0))  # positive angles lift it
    height, edge = length * math.sin(rng.uniform(0.3, 1.2)), 0.5e-3 * length
    # the highest corner of the end: l sin(q) + e cos(q) = h
    amplitude, phase = math.hypot(length, edge), math.atan2(edge, length)
    expected = (math.asin(height / amplitude) - phase - start) / speed
    ceiling = cuboid((8.0 * size, 8.0 * size, size)).transformed(at(0.0, 0.0, height + 0.5 * size))
    script = Script(points={"q": (Waypoint(0.0, start), Waypoint(10.0, start + 10.0 * speed))})
    first = math.floor(expected * rate)
    time = ticks(rate, first + 2)[max(first - 3, 0) :]
    if expected <= 0.0 or start >= 0.29:
        return
    columns = run([link, WALL], {"rod": rod, "wall": ceiling}, script, time)
    begins, earliest, latest, _ = contacts(columns)[0]
    assert begins
    assert earliest - 1e-9 <= expected <= latest + 1e-9
    assert latest - earliest <= 1.001e-6
    assert (columns.between[1:-1] == Between.CLEAR).all()


def test_two_moving_bodies_meet_where_they_must():
    """Centres at 3 t and 10 - 2 t, half a metre of cube each side: at 1.8 s."""
    links = [
        Link("a", None, np.identity(4), Joint("a", JointType.PRISMATIC, (1.0, 0.0, 0.0))),
        Link("b", None, at(10.0), Joint("b", JointType.PRISMATIC, (-1.0, 0.0, 0.0))),
    ]
    script = Script(points={"a": (Waypoint(0, 0), Waypoint(9, 27)), "b": (Waypoint(0, 0), Waypoint(9, 18))})
    columns = run(links, {"a": cube(1.0), "b": cube(1.0)}, script, ticks(1, 5))
    (_, earliest, latest, frame), (_, still, ended, last) = contacts(columns)
    assert earliest <= 1.8 <= latest
    assert still <= 2.2 <= ended
    assert (frame, last) == (2, 3)
    assert columns.between[:, 0].tolist() == [3, 0, 1, 1, 0]


def test_in_contact_at_both_ends_is_contact_and_what_cannot_move_is_told_at_once():
    links = [Link("a", None, np.identity(4), Joint("a")), Link("b", None, at(0.5), Joint("b")), WALL]
    solids = {"a": cube(1.0), "b": cube(1.0), "wall": cube(1.0).transformed(at(1.52))}
    columns = run(links, solids, Script(), ticks(10, 4))
    assert columns.between[1:].tolist() == [[Between.CONTACT, Between.CLEAR, Between.CLEAR]] * 3
    assert columns.clearance_bound[1:, 2] == pytest.approx(0.02, abs=1e-12)
    assert columns.clearance_bound[1:, 1] == pytest.approx(0.05, abs=1e-9)  # not nearer than the margin
    assert len(columns.crossings.pair) == 0


def test_a_body_that_tumbles_through_a_gap_in_time():
    """A free cube makes half a turn about its edge-to-edge axis while it stands beside a wall: its corners reach it."""
    s = math.sqrt(0.5)
    keys = (Keyframe(0.0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)), Keyframe(1.0, (0.0, 0.0, 0.0), (0.0, 0.0, s, s)))
    links = [Link("cube", None, np.identity(4), Joint("f", JointType.FREE)), WALL]
    solids = {"cube": cube(1.0), "wall": cuboid((0.1, 4.0, 4.0)).transformed(at(0.65))}
    columns = run(links, solids, Script(free={"f": keys}), ticks(1, 2))
    assert columns.between[1, 0] == Between.CONTACT
    # 0.5 (cos q + sin q) = 0.6, q = pi/2 t
    begin = math.asin(0.6 / math.sqrt(0.5)) - math.pi / 4
    (_, earliest, latest, _), (_, still, ended, _) = contacts(columns)
    assert earliest <= begin / (math.pi / 2) <= latest
    assert still <= 1.0 - begin / (math.pi / 2) <= ended


@pytest.mark.parametrize("gap", [1e-3, 1e-6, 1e-9, 0.0, -1e-9, -1e-6])
def test_a_sphere_that_grazes_an_edge(gap):
    """Its lowest corner passes over an edge, `gap` above it: clear, contact or undecided, each only where true."""
    ball = sphere(0.1, 0.01)
    low = -float(ball.vertices[:, 2].min())
    links = [Link("ball", None, at(-0.5, 0.0, low + gap), Joint("x", JointType.PRISMATIC, (1.0, 0.0, 0.0))), WALL]
    ridge = cuboid((0.2, 0.2, 0.2)).transformed(
        transforms.compose(at(0.0, 0.0, -math.sqrt(0.02)), transforms.from_rpy(np.array([0.0, math.pi / 4, 0.0])))
    )
    script = Script(points={"x": (Waypoint(0.0, 0.0), Waypoint(1.0, 1.0))})
    columns = run(links, {"ball": ball, "wall": ridge}, script, ticks(4, 5))
    worst = columns.between[1:, 0].max()
    if gap >= 1e-6:
        assert worst == Between.CLEAR
    elif gap > 0.0:
        assert worst in (Between.CLEAR, Between.UNDECIDED)
    elif gap < 0.0:
        assert Between.CONTACT in columns.between[1:, 0]


def test_a_block_and_the_frame_before_it_say_what_the_whole_says():
    links = [Link("cube", None, np.identity(4), Joint("x", JointType.PRISMATIC, (1.0, 0.0, 0.0))), WALL]
    linkage = Linkage(links)
    script = Script(points={"x": (Waypoint(0.0, 0.0), Waypoint(1.0, 2.0))})
    motion = plan(linkage, script)
    bodies = [
        CollisionBody("cube/s", 0, cube(0.05)),
        CollisionBody("wall/s", 1, cuboid((0.01, 1.0, 1.0)).transformed(at(0.95))),
    ]
    engine = CollisionPipeline(bodies, plan_pairs(bodies, linkage), linkage, motion=motion)
    time = ticks(10, 11)
    states = motion.states(time / 1e9)
    poses = linkage.forward(states.positions, states.free_poses)
    whole = engine.run(poses, time=time)
    for cut in range(1, 10):
        part = engine.run(poses.slice(cut - 1, 11), lead=1, time=time[cut - 1 :], first=cut)
        np.testing.assert_array_equal(part.between, whole.between[cut:])
        np.testing.assert_array_equal(part.clearance_bound, whole.clearance_bound[cut:])
        kept = whole.crossings.frame >= cut
        np.testing.assert_array_equal(part.crossings.latest, whole.crossings.latest[kept])
        np.testing.assert_array_equal(part.crossings.frame, whole.crossings.frame[kept])


@pytest.mark.parametrize("seed", range(24))
def test_no_column_depends_on_how_frames_are_divided(seed):
    """Random machines, all kinds of bounds and clearances: a frame more or less in a block changes no bit."""
    rng = np.random.default_rng(seed)
    linkage, motion, bodies, pairs, size, span = random_scene(rng)
    pipeline = CollisionPipeline(
        bodies,
        pairs,
        linkage,
        bounds=BOUNDS[seed % 4],
        clearance=CLEARANCES[seed // 4 % 3],
        margin=float(size * 10.0 ** rng.uniform(-2, 0)),
        motion=motion,
    )
    time = (np.linspace(0.0, span, 41) * 1e9).astype(np.int64)
    states = motion.states(time / 1e9)
    poses = linkage.forward(states.positions, states.free_poses)
    whole = pipeline.run(poses, time=time)
    for length in (1, 7, 16):
        for begin in range(0, len(time), length):
            lead, end = min(begin, 1), min(begin + length, len(time))
            part = pipeline.run(poses.slice(begin - lead, end), lead=lead, time=time[begin - lead : end], first=begin)
            for item in whole.present():
                one, all_of_them = getattr(part, item.name), getattr(whole, item.name)[begin:end]
                if lead or end - begin > 1:  # a frame alone has no interval
                    np.testing.assert_array_equal(one, all_of_them, err_msg=item.name)


def test_a_sheet_between_two_frames_is_not_passed_unseen():
    """A plane has no thickness: a cube through it is found as well."""
    links = [Link("cube", None, np.identity(4), Joint("x", JointType.PRISMATIC, (1.0, 0.0, 0.0))), WALL]
    sheet = plane((2.0, 2.0)).transformed(transforms.from_rpy(np.array([0.0, math.pi / 2, 0.0])))
    solids = {"cube": cube(0.1), "wall": sheet.transformed(at(1.0))}
    script = Script(points={"x": (Waypoint(0.0, 0.0), Waypoint(1.0, 2.0))})
    columns = run(links, solids, script, ticks(1, 2))
    (_, earliest, latest, _), (_, still, ended, _) = contacts(columns)
    assert earliest <= 0.475 <= latest
    assert still <= 0.525 <= ended
