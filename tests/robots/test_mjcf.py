"""MJCF: poses, bodies, pairs and key frames of the part against MuJoCo's own, and models that mean harm."""

import mujoco
import numpy as np
import pytest

from replay.cli.exit_codes import ExitCode
from replay.cli.main import run as command
from replay.errors import MissingPackageError, RobotError
from replay.robots import checking
from replay.robots.importing import Options, run
from replay.robots.meshes import _stl
from replay.robots.mjcf_text import rewritten
from replay.robots.xml_text import parse
from replay.scenario.scene import build
from replay.scenario.script import linkage

ARM = """<mujoco model="arm"><compiler angle="degree" eulerseq="zyx" meshdir="cad"/>
<default><geom rgba="1 0 0 1"/>
  <default class="thin"><geom size="0.01" rgba="0 0 1 1"/><joint range="-90 45"/></default></default>
<asset><mesh name="m" file="a.stl" scale="0.1 -0.2 0.3"/></asset>
<worldbody>
  <geom name="table" type="box" size="1 2 0.1" pos="0 0 -0.5"/>
  <body name="shoulder" pos="0.1 0.2 0.3" euler="10 20 30">
    <joint name="pan" axis="0 1 2" pos="0.1 0 0.2" range="-100 60"/>
    <joint name="lift" class="thin" axis="1 0 0" pos="0 0.3 0" ref="20"/>
    <joint name="slide" type="slide" axis="0 0 1" range="-0.1 0.4"/>
    <geom name="link" class="thin" type="capsule" fromto="0 0 0 0.1 0.2 0.6"/>
    <frame pos="0 0 0.3" axisangle="1 1 0 40">
      <geom name="egg" type="ellipsoid" size="0.1 0.2 0.3" pos="0.3 0 0"/></frame>
    <body name="hand" pos="0 0 0.6" zaxis="1 2 3">
      <joint name="turn" axis="0 0 1" pos="0 0 0.1"/>
      <geom name="cad" type="mesh" mesh="m" pos="0.2 0.1 0" quat="1 2 3 4"/>
      <geom name="shown" type="sphere" size="0.1" contype="0" conaffinity="0"/>
      <body name="finger" pos="0 0.1 0"><joint name="follows" axis="0 1 0"/>
        <geom name="tip" type="cylinder" size="0.02 0.05"/></body>
      <body name="tool" pos="0 -0.1 0"><geom name="bit" type="sphere" size="0.02"/></body>
    </body>
  </body>
</worldbody>
<contact><exclude body1="shoulder" body2="finger"/></contact>
<equality><joint joint1="follows" joint2="turn" polycoef="0.1 -2 0 0 0"/></equality>
<keyframe><key name="home" qpos="0.2 0.5 0.1 0.4 -0.7"/></keyframe>
<actuator><motor joint="pan"/></actuator></mujoco>"""


def imported(tmp_path, text, **options):
    (tmp_path / "cad").mkdir(exist_ok=True)
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 2, 0], [0, 0, 3]])
    (tmp_path / "cad" / "a.stl").write_bytes(_stl(corners[[[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]]))
    (tmp_path / "r.xml").write_text(text)
    return run(tmp_path / "r.xml", tmp_path / "p.yaml", Options(overwrite=True, **options))


@pytest.fixture
def arm(tmp_path):
    done = imported(tmp_path, ARM)
    machine = linkage(checking.valid(done.file.read_text(), done.file, {}))
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "r.xml"))
    return done, machine, model, mujoco.MjData(model)


def placed(machine, model, data, positions):
    """Put MuJoCo's joints where ours are, which count from their ref."""
    for name, value in zip(machine.joint_names, positions, strict=True):
        at = model.joint(name).qposadr[0]
        data.qpos[at] = model.qpos0[at] + value
    mujoco.mj_kinematics(model, data)


def test_bodies_are_where_mujoco_has_them(arm):
    _, machine, model, data = arm
    positions = checking.random_positions(machine, 50)
    world = machine.forward(positions, np.zeros((50, 0, 4, 4))).world
    for sample in range(50):
        placed(machine, model, data, positions[sample])
        for body in range(model.nbody):
            found = world[sample, machine.link_names.index(model.body(body).name)]
            np.testing.assert_allclose(found[:3, 3], data.xpos[body], rtol=0, atol=1e-14)
            np.testing.assert_allclose(found[:3, :3], data.xmat[body].reshape(3, 3), rtol=0, atol=1e-14)


def test_geoms_are_as_mujoco_has_them(arm, tmp_path):
    """Corners of the boxes around them in the world, of the mesh to the single precision in which MuJoCo keeps it."""
    done, machine, model, data = arm
    meshes = {"cad/a.stl": tmp_path / "cad" / "a.stl"}
    scene = build(checking.valid(done.file.read_text(), done.file, meshes, deep=True))
    placed(machine, model, data, np.zeros(len(machine.joint_names)))
    world = machine.forward(np.zeros((1, len(machine.joint_names))), np.zeros((1, 0, 4, 4))).world[0]
    seen = set()
    for body in scene.bodies:
        geom = model.geom(body.name.rpartition("/")[2])
        seen.add(geom.name)
        corners = body.solid.triangles.reshape(-1, 3) @ world[body.link, :3, :3].T + world[body.link, :3, 3]
        local = (corners - data.geom_xpos[geom.id]) @ data.geom_xmat[geom.id].reshape(3, 3)
        center, half = model.geom_aabb[geom.id, :3], model.geom_aabb[geom.id, 3:]
        np.testing.assert_allclose(local.min(axis=0), center - half, rtol=0, atol=1e-3)  # the chord error of round ones
        np.testing.assert_allclose(local.max(axis=0), center + half, rtol=0, atol=1e-3)
        if geom.name == "cad":
            start, count = model.mesh_vertadr[0], model.mesh_vertnum[0]
            own = np.unique(local.round(6), axis=0)
            np.testing.assert_allclose(
                own, np.unique(model.mesh_vert[start : start + count].round(6), axis=0), atol=2e-6
            )
    assert seen == {"table", "link", "egg", "cad", "tip", "bit"}


def test_pairs_followers_limits_and_states_are_taken_over(arm):
    done, machine, _, _ = arm
    disabled = {frozenset((a, b)): reason for a, b, reason in done.part.disabled}
    assert disabled[frozenset(("shoulder", "finger"))] == "excluded in r.xml"
    neighbours = "parent and child, of which MuJoCo tests no contact"
    assert disabled[frozenset(("shoulder", "hand"))] == disabled[frozenset(("tool", "finger"))] == neighbours
    assert disabled[frozenset(("hand", "finger"))] == disabled[frozenset(("tool", "shoulder"))] == neighbours
    assert not any("world" in pair for pair in disabled)
    lift = next(joint for joint in machine.joints if joint.name == "lift")
    np.testing.assert_allclose([lift.lower, lift.upper], np.deg2rad([-110.0, 25.0]), rtol=1e-14)
    follows = machine.followers["follows"]
    assert (follows.joint, follows.multiplier, follows.offset) == ("turn", -2.0, 0.1)
    home = {"pan": 0.2, "lift": 0.5 - np.deg2rad(20.0), "slide": 0.1, "turn": 0.4}
    assert done.part.poses["home"] == pytest.approx(home, abs=1e-15)
    assert "1 x <motor>" not in done.file.read_text() and "1 x <actuator>: is not used" in done.file.read_text()
    assert not done.lossy and done.part.links["hand"]["shapes"]["cad"]["scale"] == [0.1, -0.2, 0.3]


@pytest.mark.parametrize(
    ("body", "lost"),
    [
        ('<geom type="plane" size="0 0 1"/>', "link world: a plane without end is left out"),
        (
            '<body name="b"><joint name="j" type="ball"/><geom size="1"/></body>',
            "joint j: is a ball joint and becomes free",
        ),
        ('<composite type="grid"/>', "1 x <composite>: is not read"),
        ('<geom type="box" mesh="m"/>', "link world: a box fitted to a mesh is left out"),
    ],
)
def test_what_a_part_cannot_hold_is_a_loss(body, lost, tmp_path):
    asset = '<asset><mesh name="m" file="cad/a.stl"/></asset>'
    done = imported(tmp_path, f"<mujoco>{asset}<worldbody>{body}</worldbody></mujoco>")
    assert done.lossy and any(str(change).startswith(lost) for change in done.changes)


def model(body="", before=""):
    return f"<mujoco>{before}<worldbody>{body}</worldbody></mujoco>"


BOMB = "".join(f'<!ENTITY e{k} "{f"&e{k - 1};" * 10 if k else "lol"}">' for k in range(10))
WRONG = {
    "an entity bomb": (f"<!DOCTYPE mujoco [{BOMB}]><mujoco model='&e9;'/>", "has a DOCTYPE"),
    "itself": (model('<include file="r.xml"/>'), "r.xml is included twice"),
    "a file of the system": (model('<include file="/etc/passwd"/>'), "leads out of the robot's own folders"),
    "a file that is not there": (model('<include file="x.xml"/>'), "is not to be found"),
    "no number": (model('<geom size="nan"/>'), "<geom> has size='nan', which is no number"),
    "beyond a double": (model('<geom size="1e400"/>'), "number is too large in attribute 'size'"),
    "beyond what is read": (model('<body pos="1e300 0 0"/>'), "a number that is not between -1e12 and 1e12"),
    "a negative size": (model('<geom size="-1"/>'), "is no model that MuJoCo reads"),
    "a name twice": (model('<body name="a"/><body name="a"/>'), "repeated name 'a' in body"),
    "a mesh that nobody has": (model('<geom type="mesh" mesh="x"/>'), "mesh 'x' not found"),
    "a mesh out of the tree": (
        model('<geom type="mesh" mesh="p"/>', '<asset><mesh name="p" file="/etc/p.stl"/></asset>'),
        "leads out of the robot's own folders",
    ),
    "bodies in bodies": (model("<body>" * 200 + "</body>" * 200), "elements more than 100 deep"),
    "half a million bodies": (model("<body/>" * 500_000), "elements that are read"),
    "an unknown pair": (
        model(before='<contact><exclude body1="a" body2="b"/></contact>'),
        "is no model that MuJoCo reads",
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_a_model_that_is_wrong_is_one_line(case, tmp_path, capfd):
    text, rule = WRONG[case]
    (tmp_path / "r.xml").write_text(text)
    assert command(["import", str(tmp_path / "r.xml"), "-o", str(tmp_path / "p.yaml")]) is ExitCode.INVALID
    said = capfd.readouterr().err
    assert said.count("\n") == 1 and said.startswith(f"replay: error: {tmp_path}/r.xml") and rule in said
    assert sorted(path.name for path in tmp_path.iterdir()) == ["r.xml"]


def test_includes_deep_in_each_other_are_refused(tmp_path):
    for k in range(150):
        (tmp_path / f"i{k}.xml").write_text(
            f'<mujocoinclude><body><include file="i{k + 1}.xml"/></body></mujocoinclude>'
        )
    (tmp_path / "r.xml").write_text(model('<include file="i0.xml"/>'))
    with pytest.raises(RobotError, match=r"100 deep, that are read"):
        run(tmp_path / "r.xml", tmp_path / "p.yaml", Options())


def test_mujoco_is_handed_nothing_that_names_a_file_or_takes_memory(tmp_path):
    asset = '<asset><mesh name="m" file="a.stl"/><texture builtin="flat" width="99999" height="99999"/></asset>'
    reach = '<size memory="999G" nuser_body="9"/><extension><plugin plugin="x"/></extension><compiler meshdir="/etc"/>'
    body = (
        '<replicate count="1000000000"><geom size="1"/></replicate><geom type="mesh" mesh="m" user="1" fitscale="2"/>'
    )
    path = tmp_path / "r.xml"
    found = rewritten(path, parse(path, model(body, asset + reach).encode(), root="mujoco"))
    assert not any(
        word in found.text for word in ("a.stl", "texture", "size", "plugin", "etc", "replicate", "fitscale")
    )
    assert found.meshes["m"].attributes["file"] == "/etc/a.stl"
    assert [str(change) for change in found.changes if change.physical] == ["1 x <replicate>: is not read"]


def test_a_missing_mujoco_is_told(tmp_path, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "mujoco", None)
    with pytest.raises(MissingPackageError, match=r"pip install 'replay-mechanics\[bench\]'"):
        imported(tmp_path, model())
