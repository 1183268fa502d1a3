"""What a part says of a robot: bodies, names, limits, disabled pairs, poses, and what was lost."""

import json

import numpy as np
import pytest

from replay.cli.exit_codes import ExitCode
from replay.cli.main import run as command
from replay.errors import RecordingExistsError, RobotError
from replay.robots.importing import Options, run
from replay.robots.part import _chord
from replay.scenario.load import load
from replay.scenario.scene import build
from replay.scenario.shapes import SpherePart
from tests.robots import made

STL = (
    b"".ljust(80)
    + (1).to_bytes(4, "little")
    + np.array([0] * 3 + [0, 0, 0, 1, 0, 0, 0, 1, 0], "<f4").tobytes()
    + b"\0\0"
)
TURN = '<axis xyz="0 0 1"/><limit lower="0.5" upper="3" velocity="1" effort="1"/>'
BOX = '<box size="0.1 0.2 0.3"/>'


def imported(folder, *parts, srdf=None, **options):
    (folder / "r.urdf").write_text(made.robot(*parts))
    if srdf is not None:
        (folder / "r.srdf").write_text(f"<robot name='r'>{srdf}</robot>")
        options["srdf"] = folder / "r.srdf"
    return run(folder / "r.urdf", folder / "part.yaml", Options(**options))


def loaded(folder, more=""):
    (folder / "s.yaml").write_text(
        f"version: 1\nname: s\nrate: 10 Hz\nduration: 1 s\ninclude: [part.yaml]\n{more}", encoding="utf-8"
    )
    return load(folder / "s.yaml")


def told(done):
    return "\n".join(str(change) for change in done.changes)


def test_bodies_keep_their_sizes_places_scales_and_colours(tmp_path):
    (tmp_path / "a.stl").write_bytes(STL)
    bodies = [
        '<box size="0.1 0.2 0.3"/>',
        '<cylinder radius="0.1" length="0.2"/>',
        '<sphere radius="0.002"/>',
        '<capsule radius="0.1" length="0.2"/>',
        '<capsule radius="0.1" length="0"/>',
        '<mesh filename="a.stl" scale="0.001 -0.001 0.001"/>',
        '<mesh filename="a.stl" scale="0.5 0.5 0.5"/>',
    ]
    link = made.link("a", *bodies).replace(
        "</link>",
        f'<visual><geometry>{BOX}</geometry><material name="m"><color rgba="1 0.5 0 1"/></material></visual></link>',
    )
    imported(tmp_path, link)
    shapes = loaded(tmp_path).links["a"].shapes
    assert list(shapes) == ["box", "cylinder", "sphere", "capsule", "capsule_2", "a", "a_2"]
    assert shapes["box"].size == (0.1, 0.2, 0.3) and shapes["box"].color == "#ff8000"
    assert (shapes["cylinder"].radius, shapes["cylinder"].height) == (0.1, 0.2)
    assert (shapes["capsule"].type, shapes["capsule"].radius, shapes["capsule"].height) == ("capsule", 0.1, 0.2)
    assert (shapes["capsule_2"].type, shapes["capsule_2"].radius) == ("sphere", 0.1)
    assert shapes["sphere"].chord_error == pytest.approx(4e-5)
    assert shapes["a"].scale == (0.001, -0.001, 0.001) and shapes["a_2"].scale == 0.5
    scene = build(loaded(tmp_path))
    mirrored = next(shape for shape in scene.shapes if shape.name == "a/a")
    np.testing.assert_allclose(mirrored.solid.triangles.min(axis=(0, 1)), [0, -0.001, 0])


def test_joints_keep_their_limits_axes_and_leaders(tmp_path):
    limit = '<limit lower="-1e400" upper="2" velocity="0" acceleration="3" deceleration="4" effort="0"/>'
    done = imported(
        tmp_path,
        *(made.link(name) for name in "abcdef"),
        made.joint("turns", "a", "b", "revolute", TURN),
        made.joint("slides", "b", "c", "prismatic", limit),
        made.joint("follows", "a", "d", "continuous", '<mimic joint="slides" multiplier="-2"/>'),
        made.joint("floats", "a", "e", "floating"),
        made.joint("glides", "a", "f", "planar", '<axis xyz="0 0 1"/>'),
        acceleration=("2 rad/s^2",),
    )
    links = loaded(tmp_path).links
    turns, slides, follows = (links[name].joint for name in "bcd")
    assert (turns.name, turns.axis, turns.lower, turns.upper) == ("turns", (0, 0, 1), 0.5, 3)
    assert (turns.velocity, turns.acceleration, turns.initial) == (1, 2, None)
    assert (slides.axis, slides.lower, slides.velocity, slides.acceleration) == ((1, 0, 0), -np.inf, np.inf, 3)
    assert slides.deceleration == 4
    assert (follows.mimic.joint, follows.mimic.multiplier, follows.acceleration) == ("slides", -2, 2)
    assert links["e"].joint.type == links["f"].joint.type == "free"
    assert "joint slides: a limit of velocity of 0, by which nothing moves, is left out" in told(done)
    assert "joint glides: is planar and becomes free" in told(done) and done.lossy


def test_names_become_names_of_the_language_and_yaml(tmp_path):
    done = imported(
        tmp_path,
        *(made.link(name, BOX) for name in ("null", "left arm", "left/arm", "1", "world")),
        made.joint("yes", "null", "left arm", "revolute", TURN),
        made.joint("0x1f", "null", "left/arm"),
        made.joint("k", "null", "1"),
        made.joint("w", "null", "world"),
        prefix="",
    )
    scenario = loaded(tmp_path)
    assert list(scenario.links) == ["null", "left_arm", "left_arm_2", "1", "world"]
    assert scenario.links["left_arm"].joint.name == "yes"
    assert "link left/arm: is called left_arm_2" in told(done)
    imported(tmp_path, made.link("a", BOX), made.link("b"), made.joint("j", "a", "b", "continuous"), prefix="one_")
    assert list(loaded(tmp_path).links) == ["one_a", "one_b"]
    assert loaded(tmp_path).links["one_b"].joint.name == "one_j"


def test_the_root_stands_where_it_is_told_to(tmp_path):
    imported(tmp_path, made.link("a"), root_pose="1 0 90cm 0, 0, 90deg")
    pose = loaded(tmp_path).links["a"].pose
    assert (pose.xyz, pose.rpy) == ((1.0, 0.0, 0.9), (0.0, 0.0, np.pi / 2))
    for wrong in ("1 2", "1 2 3 4 5 6 7", "1 2 30deg", "a b c", "0 0 0 0 0 1e999"):
        with pytest.raises(RobotError, match="--root-pose"):
            imported(tmp_path, made.link("a"), root_pose=wrong)


def test_pairs_in_one_rigid_part_and_of_the_srdf_are_disabled(tmp_path):
    done = imported(
        tmp_path,
        *(made.link(name, BOX) for name in ("a", "b", "c", "d")),
        made.link("bare"),
        made.joint("ab", "a", "b"),
        made.joint("bc", "b", "c"),
        made.joint("cd", "c", "d", "revolute", TURN),
        made.joint("ae", "a", "bare"),
        srdf='<disable_collisions link1="d" link2="a" reason="Never"/><disable_collisions link1="a" link2="bare"/>'
        '<disable_collisions link1="a" link2="x"/><group_state name="home" group="g"><joint name="cd" value="1"/>'
        '<joint name="ab" value="0"/></group_state><group_state name="out" group="g"><joint name="cd" value="9"/>'
        "</group_state>",
    )
    assert done.part.disabled == [("a", "d", "Never"), ("a", "c", "rigid to each other")]
    scenario = loaded(tmp_path, "motion: {initial: home}\n")
    assert {name: pose["cd"].value for name, pose in scenario.poses.items()} == {"home": 1}
    assert [pair.name for pair in build(scenario).pairs] == ["b/box|d/box"]
    assert "line 1 of the SRDF: <disable_collisions> names 'x', which is no link: left out" in told(done)
    assert "state out: joint cd at 9 is beyond its limits 0.5 and 3: left out" in told(done)


def test_the_only_two_bodies_of_a_robot_may_be_a_disabled_pair(tmp_path):
    done = imported(
        tmp_path,
        *(made.link(name, BOX) for name in ("a", "b")),
        made.joint("ab", "a", "b", "revolute", TURN),
        srdf='<disable_collisions link1="b" link2="a" reason="Never"/>',
    )
    assert done.part.disabled == [("a", "b", "Never")]
    assert "without bodies" not in told(done)


def test_a_joint_that_follows_one_without_a_position_is_held_where_that_puts_it(tmp_path):
    """A fixed joint has no position, so what mimics it is at its offset: 0.7 rad, between its limits, or at 0."""
    done = imported(
        tmp_path,
        *(made.link(name, BOX) for name in ("a", "b", "c", "d", "e")),
        made.joint("stiff", "a", "b"),
        made.joint("turned", "a", "c", "revolute", f'{TURN}<mimic joint="stiff" multiplier="2" offset="0.7"/>'),
        made.joint("spun", "a", "d", "continuous", '<mimic joint="stiff"/>'),
        made.joint("glued", "a", "e", "fixed", '<mimic joint="turned"/>'),
    )
    links = loaded(tmp_path).links
    for name, held in (("c", 0.7), ("d", 0.0)):
        joint = links[name].joint
        assert (joint.type, joint.lower, joint.upper, joint.mimic) == ("revolute", held, held, None)
    for line in (
        "joint turned: mimics stiff, which has no position: it is held at 0.7",
        "joint spun: mimics stiff, which has no position: it is held at 0",
        "joint glued: is fixed: <mimic> is dropped",
    ):
        assert line in told(done)


def test_limits_of_moveit_replace_those_of_the_description(tmp_path):
    (tmp_path / "limits.yaml").write_text(
        "joint_limits:\n"
        "  j: {has_velocity_limits: true, max_velocity: 0.5, has_acceleration_limits: true, max_acceleration: 4,\n"
        "      has_deceleration_limits: true, max_deceleration: -3, has_position_limits: false, max_position: 9}\n"
        "  other: {has_velocity_limits: true, max_velocity: 1}\n"
    )
    parts = (made.link("a"), made.link("b"), made.joint("j", "a", "b", "revolute", TURN))
    done = imported(tmp_path, *parts, limits=tmp_path / "limits.yaml")
    joint = loaded(tmp_path).links["b"].joint
    assert (joint.velocity, joint.acceleration, joint.deceleration, joint.upper) == (0.5, 4, 3, 3)
    assert "joint other: of limits.yaml is no joint of the robot: left out" in told(done)
    (tmp_path / "limits.yaml").write_text("joint_limits: {j: {has_velocity_limits: true}}\n")
    with pytest.raises(RobotError, match=r"limits\.yaml:1:.*max_velocity is missing"):
        imported(tmp_path, *parts, limits=tmp_path / "limits.yaml")
    most = f"joint_limits: {{j: {{has_velocity_limits: true, max_velocity: 1{'0' * 399}}}}}\n"  # no double holds it
    (tmp_path / "limits.yaml").write_text(most)
    with pytest.raises(RobotError, match=r"limits\.yaml:1:.*max_velocity must be a number between"):
        imported(tmp_path, *parts, limits=tmp_path / "limits.yaml")
    for wrong in (("2",), ("2 rad",), ("0 m/s^2",), ("1 m/s^2", "2 m/s^2")):
        with pytest.raises(RobotError, match="--acceleration"):
            imported(tmp_path, *parts, acceleration=wrong)


def test_links_that_are_only_shown_collide_when_asked_to(tmp_path):
    shown = f'<link name="a"><visual><geometry>{BOX}</geometry></visual></link>'
    done = imported(tmp_path, shown)
    assert done.lossy and not loaded(tmp_path).links["a"].shapes
    done = imported(tmp_path, shown, collision="visual")
    assert not done.lossy and list(loaded(tmp_path).links["a"].shapes) == ["box"]


def test_a_report_of_very_many_changes_is_short_and_soon_made(tmp_path):
    """Were each unknown name looked for among those before it, this would take minutes."""
    pairs = (f'<disable_collisions link1="x{k}" link2="y{k}"/>' for k in range(40_000))
    done = imported(tmp_path, made.link("a", BOX), srdf="".join(pairs))
    assert len(done.changes) == 1001 and str(done.changes[-1]) == "and more: 79000 others are not told"
    assert not done.lossy


def test_limits_that_leave_a_leader_no_position_are_dropped_with_a_loss(tmp_path):
    follower = '<limit lower="5" upper="6" velocity="1" effort="1"/><mimic joint="j"/>'
    done = imported(
        tmp_path,
        *(made.link(name) for name in "abc"),
        made.joint("j", "a", "b", "revolute", TURN),
        made.joint("k", "a", "c", "revolute", follower),
    )
    assert done.lossy and "they leave nowhere to go to j, which it follows" in told(done)
    assert loaded(tmp_path).links["c"].joint.lower == -np.inf


def test_limits_that_leave_a_leader_one_position_are_dropped_with_a_loss(tmp_path):
    """A gripper as some describe it: its tips turn against it, with the limits of the fingers."""
    follower = '<limit lower="0" upper="1" velocity="1" effort="1"/><mimic joint="j" multiplier="-1"/>'
    done = imported(
        tmp_path,
        *(made.link(name) for name in "abc"),
        made.joint("j", "a", "b", "revolute", '<limit lower="0" upper="1" velocity="1" effort="1"/>'),
        made.joint("k", "b", "c", "revolute", follower),
    )
    assert done.lossy and "its limits 0 and 1 are dropped: they leave nowhere to go to j" in told(done)
    links = loaded(tmp_path).links
    assert (links["c"].joint.lower, links["b"].joint.lower, links["b"].joint.upper) == (-np.inf, 0.0, 1.0)


def test_a_rate_below_zero_limits_nothing(tmp_path):
    turn = '<limit lower="0" upper="1" velocity="-1" effort="-1"/>'
    done = imported(tmp_path, made.link("a"), made.link("b"), made.joint("j", "a", "b", "revolute", turn))
    assert "joint j: a limit of velocity of -1, by which nothing moves, is left out" in told(done)


def test_macros_that_were_not_expanded_are_told_and_what_they_may_stand_for_is_a_loss(tmp_path):
    shown = f"<visual><geometry>{BOX}</geometry><xacro:grey/></visual>"
    done = imported(tmp_path, f'<link name="a">{shown}<collision><geometry>{BOX}</geometry></collision></link>')
    assert not done.lossy and "link a: <xacro:grey> of a <visual> is not used" in told(done)
    done = imported(tmp_path, made.link("a", BOX), "<xacro:sensors/>")
    assert done.lossy and "1 x <xacro:sensors>: is a macro of xacro that was not expanded" in told(done)


def test_a_part_that_was_changed_by_hand_is_not_replaced(tmp_path):
    imported(tmp_path, made.link("a"))
    imported(tmp_path, made.link("a"))  # as the import left it
    text = (tmp_path / "part.yaml").read_text()
    (tmp_path / "part.yaml").write_text(text + "# mine\n")
    with pytest.raises(RecordingExistsError):
        imported(tmp_path, made.link("a"))
    imported(tmp_path, made.link("a"), overwrite=True)
    assert (tmp_path / "part.yaml").read_text() == text


def test_random_poses_show_which_pairs_never_and_always_touch(tmp_path):
    def place(x):
        return f'<origin xyz="{x} 0 0"/><axis xyz="0 0 1"/>'

    done = imported(
        tmp_path,
        *(made.link(name, '<sphere radius="0.1"/>') for name in ("a", "c", "far", "same", "near")),
        made.link("bare"),
        made.joint("j", "a", "bare", "continuous", place(0)),
        made.joint("k", "bare", "c", "continuous", place(0.05)),
        made.joint("l", "c", "far", "continuous", place(9)),
        made.joint("m", "bare", "same", "continuous", place(0)),
        made.joint("n", "same", "near", "prismatic", '<axis xyz="1 0 0"/><limit lower="0" upper="1" velocity="1"/>'),
        samples=40,
    )
    found = {frozenset(pair): what for *pair, what in done.checked}
    assert found[frozenset(("a", "far"))] == "never in contact in 40 random poses"
    assert found[frozenset(("a", "c"))] == "adjacent, in contact in 40 of 40 random poses"
    assert found[frozenset(("c", "same"))].startswith("adjacent")  # only a link without bodies is between
    assert frozenset(("a", "near")) not in found  # sometimes: it stays tested
    assert [(a, b) for a, b, _ in done.part.disabled] == [(a, b) for a, b, _ in done.checked]
    assert loaded(tmp_path).collision.disable[0].reason == done.checked[0][2]


def test_pairs_are_looked_at_in_random_poses_when_that_is_asked_for(tmp_path):
    links = [made.link(name, BOX) for name in ("a", "b", "c")]
    far = '<origin xyz="9 0 0"/><axis xyz="0 0 1"/>'
    joints = [made.joint(f"to_{b}", a, b, "continuous", far) for a, b in (("a", "b"), ("b", "c"))]
    (tmp_path / "r.urdf").write_text(made.robot(*links, *joints))
    words = ["import", str(tmp_path / "r.urdf"), "-o", str(tmp_path / "p.yaml"), "--overwrite"]
    assert command(words) is ExitCode.FINE
    assert "random poses" not in (tmp_path / "p.yaml").read_text()
    assert command([*words, "--check-collisions", "7"]) is ExitCode.FINE
    assert "never in contact in 7 random poses" in (tmp_path / "p.yaml").read_text()


def test_the_command_says_what_was_lost_and_leaves_with_3(tmp_path, capsys):
    (tmp_path / "r.urdf").write_text(made.robot(made.link("a", BOX)))
    words = ["import", str(tmp_path / "r.urdf"), "-o", str(tmp_path / "p.yaml")]
    assert command(words) is ExitCode.FINE
    assert capsys.readouterr().out.startswith(f"r: {tmp_path}/p.yaml: 1 link, 0 moving joints, 1 shape, 0 poses, ")
    shown = f'<link name="a"><visual><geometry>{BOX}</geometry></visual></link>'
    (tmp_path / "r.urdf").write_text(made.robot(shown))
    assert command([*words, "--format", "json"]) is ExitCode.LOSSES
    report = json.loads(capsys.readouterr().out)
    assert report["lossy"] and report["links"] == 1
    assert report["changes"][0]["place"] == "link a" and report["changes"][0]["physical"]
    assert "#   link a: shows a body" in (tmp_path / "p.yaml").read_text()


@pytest.mark.parametrize(
    ("radius", "chord"),
    [(1e-3, 2e-5), (0.0499, 9.98e-4), (0.05, None), (1.0, None), (100.0, None), (100.1, 0.01), (1e4, 1.0)],
)
def test_round_bodies_of_any_size_are_as_fine_as_the_language_takes_them(radius, chord):
    told = _chord(radius)
    assert told == ({} if chord is None else {"chord_error": pytest.approx(chord, rel=6e-3)})
    assert SpherePart.model_validate({"type": "sphere", "radius": radius, **told}).chord_error <= 0.03 * radius
