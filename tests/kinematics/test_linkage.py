"""Forward kinematics and relative poses against plain matrix products in high precision."""

import mpmath
import numpy as np
import pytest

from replay.errors import InvalidValue
from replay.kinematics.linkage import Joint, JointType, Link, Linkage, Mimic
from replay.numerics import transforms


def random_pose(rng, spread=1.0):
    pose = transforms.from_quaternion(rng.normal(size=4))
    pose[:3, 3] = rng.normal(size=3) * spread
    return pose


def random_tree(rng, size=12, root_pose=None):
    links = []
    for k in range(size):
        axis = rng.normal(size=3)
        kind = [JointType.FIXED, JointType.REVOLUTE, JointType.PRISMATIC, JointType.FREE][k % 4]
        joint = Joint(f"joint_{k:02}", kind, tuple(axis / np.linalg.norm(axis)))
        parent = None if k == 0 else f"link_{rng.integers(k):02}"
        links.append(
            Link(f"link_{k:02}", parent, root_pose if k == 0 and root_pose is not None else random_pose(rng), joint)
        )
    rng.shuffle(links)
    return Linkage(links)


def random_state(rng, linkage, frames=5):
    positions = rng.normal(size=(frames, len(linkage.joints)))
    free = np.array([[random_pose(rng) for _ in linkage.free_joints] for _ in range(frames)])
    return positions, free


def test_world_poses_are_products_along_the_chain():
    rng = np.random.default_rng(0)
    linkage = random_tree(rng)
    poses = linkage.forward(*random_state(rng, linkage))
    for k in range(len(linkage.links)):
        expected = np.eye(4)
        for link in reversed(linkage.ancestors(k)):
            expected = expected @ poses.local[:, link]
        np.testing.assert_allclose(poses.world[:, k], expected, atol=1e-13)


def test_revolute_and_prismatic_joints_in_closed_form():
    turn = Joint("turn", JointType.REVOLUTE, (0.0, 0.0, 1.0))
    slide = Joint("slide", JointType.PRISMATIC, (1.0, 0.0, 0.0))
    arm = Link("arm", "base", transforms.from_translation(np.array([0.0, 0.0, 1.0])), turn)
    hand = Link("hand", "arm", transforms.identity(), slide)
    linkage = Linkage([Link("base", None, transforms.identity(), Joint("base")), arm, hand])
    poses = linkage.forward(np.array([[2.0, np.pi / 2]]), np.empty((1, 0, 4, 4)))  # joints sorted: slide, turn
    np.testing.assert_allclose(poses.world[0, linkage.link_index("hand"), :3, 3], [0.0, 2.0, 1.0], atol=1e-15)


def test_relative_poses_do_not_see_where_the_tree_stands():
    rng = np.random.default_rng(3)
    state = rng.bit_generator.state
    near = random_tree(rng, root_pose=transforms.identity())
    rng.bit_generator.state = state
    far = random_tree(rng, root_pose=transforms.from_translation(np.array([1e6, -1e6, 1e5])))
    positions, free = random_state(np.random.default_rng(9), near)
    here, there = near.forward(positions, free), far.forward(positions, free)
    for a in range(len(near.links)):
        for b in range(len(near.links)):
            if "link_00" not in (near.link_names[a], near.link_names[b]):
                np.testing.assert_array_equal(here.relative(a, b), there.relative(a, b))
            np.testing.assert_allclose(
                here.relative(a, b), np.linalg.inv(here.world[:, a]) @ here.world[:, b], atol=1e-12
            )


def test_relative_poses_between_trees_against_high_precision():
    rng = np.random.default_rng(5)
    pose_a, pose_b = random_pose(rng, 10.0), random_pose(rng, 10.0)
    linkage = Linkage([Link("a", None, pose_a, Joint("a")), Link("b", None, pose_b, Joint("b"))])
    relative = linkage.forward(np.empty((1, 0)), np.empty((1, 0, 4, 4))).relative(0, 1)[0]
    with mpmath.workdps(40):
        R, t = mpmath.matrix(pose_a[:3, :3].tolist()), mpmath.matrix((pose_b[:3, 3] - pose_a[:3, 3]).tolist())
        expected = R.T * t
    np.testing.assert_allclose(relative[:3, 3], [float(v) for v in expected], atol=4e-15)  # 20 m * 2^-53, three terms


def test_the_way_counts_every_step_and_the_place_of_each_joint():
    slide = Joint("slide", JointType.PRISMATIC, (1.0, 0.0, 0.0))
    base = Link("base", None, transforms.from_translation(np.array([9.0, 9.0, 9.0])), Joint("base"))
    arm = Link("arm", "base", transforms.from_translation(np.array([3.0, -0.5, 0.0])), slide)
    hand = Link("hand", "arm", transforms.from_translation(np.array([0.0, 0.0, -4.0])), Joint("hand"))
    far = Link("far", None, transforms.from_translation(np.array([0.0, 100.0, 0.0])), Joint("far"))
    linkage = Linkage([base, arm, hand, far])
    poses = linkage.forward(np.array([[0.0], [-3.0], [1.0]]), np.empty((3, 0, 4, 4)))
    a, b, c, d = (linkage.link_index(name) for name in ("base", "arm", "hand", "far"))
    # at -3 the slide brings the arm back to where the base is: rounding is of what was added and taken away
    assert poses.way(a, b).tolist() == [3.5 + 3.5, 0.5 + 3.5, 4.5 + 3.5]
    assert poses.way(a, c).tolist() == (poses.way(a, b) + 8.0).tolist() == poses.way(c, a).tolist()
    assert poses.way(a, d).tolist() == [2.0 * (27.0 + 100.0)] * 3
    assert poses.way(b, b).tolist() == [0.0] * 3


def test_structure_questions():
    names = [("base", None, "fixed"), ("arm", "base", "revolute"), ("hand", "arm", "fixed"), ("wall", None, "fixed")]
    linkage = Linkage([Link(n, p, transforms.identity(), Joint(n, JointType(t))) for n, p, t in names])
    arm, base, hand, wall = (linkage.link_index(n) for n in ("arm", "base", "hand", "wall"))
    assert linkage.are_adjacent(base, arm) and not linkage.are_adjacent(base, hand)
    assert not linkage.moves_between(arm, hand) and not linkage.moves_between(base, wall)
    assert linkage.moves_between(hand, wall) and linkage.moves_between(base, hand)


@pytest.mark.parametrize(
    ("links", "message"),
    [
        ([("a", "b"), ("b", "a")], "own ancestors"),
        ([("a", None), ("a", None)], "must be unique"),
        ([("a", "z")], "must be one of"),
    ],
)
def test_links_that_form_no_trees_are_refused(links, message):
    with pytest.raises(InvalidValue, match=message):
        Linkage(
            [Link(name, parent, transforms.identity(), Joint(f"{name}{k}")) for k, (name, parent) in enumerate(links)]
        )


def test_joints_follow_in_chains():
    """a leads, b = 0.5 a + 0.2, c = 2 b + 0.1: 0.9 where a is 0.4; a reader that forgets b's offset says 0.5."""
    joints = [
        Joint("a", JointType.REVOLUTE),
        Joint("b", JointType.PRISMATIC, lower=0.0, upper=0.6, mimic=Mimic("a", 0.5, 0.2)),
        Joint("c", JointType.REVOLUTE, lower=-1.0, mimic=Mimic("b", 2.0, 0.1)),
    ]
    machine = Linkage([Link(joint.name, None, transforms.identity(), joint) for joint in joints])
    assert machine.followers == {"b": Mimic("a", 0.5, 0.2), "c": Mimic("a", 1.0, 0.5)}
    np.testing.assert_allclose(machine.followed(np.array([[0.4, 7.0, 7.0]])), [[0.4, 0.4, 0.9]], rtol=1e-15)
    lower, upper = machine.ranges()["a"]
    assert (lower, upper) == pytest.approx((-0.4, 0.8), rel=1e-15)


@pytest.mark.parametrize(
    ("mimics", "rule"),
    [
        ({"a": "b", "b": "a"}, "follow each other in a circle"),
        ({"a": "a"}, "follow each other in a circle"),
        ({"a": "c"}, "must be one of the joints with a position"),
    ],
)
def test_joints_that_cannot_be_followed_are_refused(mimics, rule):
    joints = [Joint(name, JointType.REVOLUTE, mimic=Mimic(mimics[name]) if name in mimics else None) for name in "ab"]
    with pytest.raises(InvalidValue, match=rule):
        Linkage([Link(joint.name, None, transforms.identity(), joint) for joint in joints])
