"""Descriptions that mean harm, or nothing: one line that names the file, exit code 2, nothing written."""

import pytest

from replay.cli.exit_codes import ExitCode
from replay.cli.main import run
from tests.robots import made

A, B = made.link("a"), made.link("b")
BOMB = "".join(f'<!ENTITY e{k} "{f"&e{k - 1};" * 10 if k else "lol"}">' for k in range(10))
FAR = '<mesh filename="{}"/>'
TURN = '<limit lower="0" upper="1" velocity="1" effort="1"/>'


def many(count):
    return made.robot(*(f'<link name="l{k}"/>' for k in range(count)))


def star(count, body):
    links = (made.link(f"l{k}", *([body] if body else [])) for k in range(count))
    return made.robot(*links, *(made.joint(f"j{k}", "l0", f"l{k}") for k in range(1, count)))


WRONG = {
    "an entity bomb": (f"<!DOCTYPE robot [{BOMB}]><robot name='r'><link name='&e9;'/></robot>", "has a DOCTYPE"),
    "an external entity": (
        '<!DOCTYPE robot [<!ENTITY x SYSTEM "file:///etc/passwd">]><robot name="r"><link name="&x;"/></robot>',
        "has a DOCTYPE",
    ),
    "an entity that nobody declares": ("<robot name='r'><link name='&x;'/></robot>", "is not XML: undefined entity"),
    "no XML": ("robot", "is not XML"),
    "nothing": ("", "is not XML: no element found"),
    "a page": ("<html/>", "begins with <html>, not with <robot>"),
    "nothing but a macro": (
        "<robot name='r'><xacro:make_pelvis/></robot>",
        "the robot has no link, but <xacro:make_pelvis>, which is a macro of xacro that was not expanded",
    ),
    "no link": ("<robot name='r'/>", "the robot has no link"),
    "a million links": (many(10**6), "elements that are read"),
    "more links than a part may have": (star(30_000, ""), "would not be a valid part"),
    "more rigid pairs than are written": (star(1000, '<box size="1 1 1"/>'), "more than the 20000 pairs of links"),
    "elements in elements": ("<robot name='r'>" + "<a>" * 1000, "elements more than 100 deep"),
    "two roots": (made.robot(A, B), "2 links have no parent, 'a', 'b'; a robot has one root"),
    "a circle": (
        made.robot(A, B, made.joint("j", "a", "b"), made.joint("k", "b", "a")),
        "no link is without a parent: the links go in a circle",
    ),
    "a circle beside a tree": (
        made.robot(A, B, made.link("c"), made.joint("j", "c", "b"), made.joint("k", "b", "c")),
        "is its own ancestor",
    ),
    "two parents": (
        made.robot(A, B, made.joint("j", "a", "b"), made.joint("k", "a", "b")),
        "link 'b' is the child of joint 'k' and of 'j'",
    ),
    "a link twice": (made.robot(A, A), "link 'a' is there twice; the first is in line 2"),
    "a joint twice": (
        made.robot(A, B, made.link("c"), made.joint("j", "a", "b"), made.joint("j", "a", "c")),
        "joint 'j' is there twice",
    ),
    "a parent that is not there": (made.robot(A, B, made.joint("j", "x", "b")), "has the parent 'x', which is no link"),
    "a link without a name": ("<robot name='r'><link/></robot>", "<link> has no name"),
    "a joint without ends": (
        "<robot name='r'><link name='a'/><joint name='j' type='fixed'/></robot>",
        "joint 'j' has no <parent>",
    ),
    "an unknown joint": (made.robot(A, B, made.joint("j", "a", "b", "hinge")), "is of type 'hinge'; URDF has"),
    "a negative size": (
        made.robot(made.link("a", '<sphere radius="-1"/>')),
        "<sphere> has radius=-1, which is below 0",
    ),
    "a negative edge": (made.robot(made.link("a", '<box size="1 -1 1"/>')), "which is below 0"),
    "no number": (made.robot(made.link("a", '<sphere radius="nan"/>')), "has radius='nan', which is no number"),
    "numbers that are too few": (made.robot(made.link("a", '<box size="1 1"/>')), "which are not 3 numbers"),
    "a mesh without extent": (made.robot(made.link("a", '<mesh filename="a.stl" scale="1 0 1"/>')), "no extent"),
    "an axis of zero": (
        made.robot(A, B, made.joint("j", "a", "b", "revolute", f'<axis xyz="0 0 0"/>{TURN}')),
        "has the axis 0 0 0, which has no direction",
    ),
    "limits out of order": (
        made.robot(A, B, made.joint("j", "a", "b", "revolute", '<limit lower="1" upper="0" velocity="1"/>')),
        "has the lower limit 1 above the upper one 0",
    ),
    "a leader that is not there": (
        made.robot(A, B, made.joint("j", "a", "b", "revolute", f'{TURN}<mimic joint="x"/>')),
        "joint 'j' mimics 'x', which is no joint",
    ),
    "a joint that follows itself": (
        made.robot(A, B, made.joint("j", "a", "b", "revolute", f'{TURN}<mimic joint="j"/>')),
        "joint 'j' mimics itself",
    ),
    "a path out of the tree": (made.robot(made.link("a", FAR.format("../" * 9 + "etc/passwd.stl"))), "leads out of"),
    "a path out of a package": (
        made.robot(made.link("a", FAR.format("package://r/../../x.stl"))),
        "is not of the form",
    ),
    "an absolute path": (made.robot(made.link("a", FAR.format("file:///etc/x.stl"))), "leads out of"),
    "a URL": (made.robot(made.link("a", FAR.format("http://host/x.stl"))), "is a URL"),
    "a file that is not there": (made.robot(made.link("a", FAR.format("x.stl"))), "is not to be found; looked for"),
    "a package that is not there": (
        made.robot(made.link("a", FAR.format("package://nobody/x.stl"))),
        "no package 'nobody' in",
    ),
    "another format": (made.robot(made.link("a", FAR.format("r.urdf"))), "ends in '.urdf'; meshes are read from"),
    "a xacro program": (
        '<robot name="r" xmlns:xacro="http://ros.org/wiki/xacro"><xacro:arg name="a"/><link name="${x}"/></robot>',
        "is a xacro program, which replay does not run; expand it: xacro ",
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_a_description_that_is_wrong_is_one_line(case, tmp_path, capsys):
    text, rule = WRONG[case]
    (tmp_path / "r.urdf").write_text(text)
    assert run(["import", str(tmp_path / "r.urdf"), "-o", str(tmp_path / "p.yaml")]) is ExitCode.INVALID
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and said.startswith(f"replay: error: {tmp_path}/") and rule in said
    assert sorted(path.name for path in tmp_path.iterdir()) == ["r.urdf"]


@pytest.mark.parametrize(
    ("text", "rule"),
    [
        (f"<!DOCTYPE robot [{BOMB}]><robot/>", "has a DOCTYPE"),
        ("<robot><disable_collisions link1='a'/></robot>", "<disable_collisions> has no link2"),
        ("<robot><group_state name='g'><joint name='j' value='x'/></group_state></robot>", "is no number"),
        ("<robot", "is not XML"),
    ],
)
def test_an_srdf_that_is_wrong_is_one_line(text, rule, tmp_path, capsys):
    (tmp_path / "r.urdf").write_text(made.robot(A, B, made.joint("j", "a", "b", "revolute", TURN)))
    (tmp_path / "r.srdf").write_text(text)
    words = ["import", str(tmp_path / "r.urdf"), "-o", str(tmp_path / "p.yaml"), "--srdf", str(tmp_path / "r.srdf")]
    assert run(words) is ExitCode.INVALID
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and said.startswith(f"replay: error: {tmp_path}/r.srdf") and rule in said
    assert not (tmp_path / "p.yaml").exists()


def test_a_link_that_leads_out_of_the_tree_is_refused(tmp_path, capsys):
    deep = tmp_path / "1" / "2" / "3" / "4" / "5" / "6"
    deep.mkdir(parents=True)
    (tmp_path / "secret.stl").write_bytes(b"solid\nendsolid\n")
    (deep / "x.stl").symlink_to(tmp_path / "secret.stl")
    (deep / "r.urdf").write_text(made.robot(made.link("a", FAR.format("x.stl"))))
    assert run(["import", str(deep / "r.urdf"), "-o", str(deep / "p.yaml"), "--copy-meshes"]) is ExitCode.INVALID
    assert "leads out of the robot's own folders" in capsys.readouterr().err
