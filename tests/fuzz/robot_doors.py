"""The doors that a robot comes in by: its description, what stands beside it, and its meshes."""

from __future__ import annotations

from pathlib import Path

import trimesh

from tests.fuzz import damage
from tests.fuzz.door import Door, command
from tests.robots import made
from tests.robots.test_dae_file import dae

URDF = made.robot(
    '<material name="grey"><color rgba="0.5 0.5 0.5 1"/></material>',
    made.link("base", '<mesh filename="a.stl" scale="1 1 1"/>', '<box size="1 2 3"/>'),
    made.link("hand", '<mesh filename="package://arm/b.dae"/>', '<sphere radius="0.1"/>'),
    made.link("finger", '<cylinder radius="0.1" length="0.5"/>', '<capsule radius="0.1" length="0.5"/>'),
    '<link name="tip"><visual><origin xyz="0 0 1" rpy="0 0 1"/><geometry><sphere radius="1"/></geometry></visual>',
    "</link>",
    made.joint(
        "turn", "base", "hand", "revolute", '<axis xyz="0 0 1"/><limit lower="-1" upper="1" velocity="2" effort="1"/>'
    ),
    made.joint(
        "grip", "hand", "finger", "continuous", '<axis xyz="0 1 0"/><mimic joint="turn" multiplier="0.5" offset="0.1"/>'
    ),
    made.joint("end", "finger", "tip", "fixed", '<origin xyz="0 0 0.5" rpy="0 1.5 0"/>'),
).encode()
SRDF = b"""<robot name="r">
<group name="arm"><joint name="turn"/></group>
<group_state name="home" group="arm"><joint name="turn" value="0.5"/></group_state>
<disable_collisions link1="base" link2="finger" reason="Never"/>
<disable_default_collisions link="tip"/>
<enable_collisions link1="tip" link2="base"/>
</robot>
"""
LIMITS = b"""joint_limits:
  turn: {has_velocity_limits: true, max_velocity: 1.5, has_acceleration_limits: true, max_acceleration: 3.0}
  grip: {has_position_limits: true, min_position: -1.0, max_position: 1.0}
"""


def robot_doors() -> dict[str, Door]:
    """Return the doors of `replay import`, by name; all files are whole but the one that the door is for."""
    whole = {"r.urdf": URDF, "r.srdf": SRDF, "limits.yaml": LIMITS, "a.stl": _box(), "b.dae": dae()}

    def door(weight: int, name: str) -> Door:
        wound = damage.of_text if name == "limits.yaml" else damage.of_xml
        return Door(weight, lambda rng: whole | {name: wound(whole[name], rng)}, _enter)

    return {
        "urdf": door(4, "r.urdf"),
        "srdf": door(1, "r.srdf"),
        "limits": door(1, "limits.yaml"),
        "dae": door(2, "b.dae"),
    }


def _box() -> bytes:
    data = trimesh.creation.box().export(file_type="stl")
    assert isinstance(data, bytes)
    return data


def _enter(folder: Path) -> object:
    return command(
        *("import", str(folder / "r.urdf"), "--srdf", str(folder / "r.srdf"), "--limits", str(folder / "limits.yaml")),
        *("--package", f"arm={folder}", "--copy-meshes", "-o", str(folder / "part.yaml")),
    )
