"""MJCF, MuJoCo's descriptions, to a `Robot`: read by MuJoCo, which resolves defaults, frames and orientations.

A body of MJCF has any number of joints, one after another, each about its own point (mujoco.readthedocs.io, "Kinematic
tree"): with the pose T of the body, anchors p and motions M, its pose is T trans(p1) M1 trans(-p1) trans(p2) M2 ...; so
each joint but the last moves a link without bodies, and the last one too where its anchor is not the body's origin.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from replay.errors import MissingPackageError, RobotError
from replay.numerics.arrays import Floats
from replay.robots.description import (
    Following,
    Geometry,
    Limits,
    Origin,
    Robot,
    RobotBody,
    RobotChange,
    RobotJoint,
    RobotLink,
    triple,
)
from replay.robots.mjcf_text import MjcfText, rewritten
from replay.robots.srdf import Semantics
from replay.robots.xml_text import XmlElement

_INSTALL = "get it with: pip install 'replay-mechanics[bench]'"
_JOINTS = ("floating", "ball", "prismatic", "revolute")
_LARGEST = 1e12
_NEIGHBOURS = "parent and child, of which MuJoCo tests no contact"
_FILTERED = "their contype and conaffinity exclude contact"


def read(path: Path, root: XmlElement) -> tuple[Robot, Semantics]:
    """Return the robot that an MJCF file describes, with its excluded pairs and its key frames.

    Raises:
        MissingPackageError: mujoco is not installed.
        RobotError: MuJoCo does not read it, or as of `mjcf_text.rewritten`.

    Accuracy: double precision (tests/robots/test_mjcf.py).
    """
    written = rewritten(path, root)
    try:
        import mujoco
    except ImportError:
        raise MissingPackageError("mujoco", f"{path}: a description in MJCF", _INSTALL) from None
    try:
        mujoco.set_mju_user_warning(lambda _: None)  # it would write a log into the current folder
        spec = mujoco.MjSpec.from_string(written.text)
        model = spec.compile()
    except (ValueError, mujoco.FatalError) as error:
        reason = " ".join(re.sub(r",? *line \d+|XML Error:|Error:", "", str(error)).split())[:300]
        raise RobotError(str(path), f"is no model that MuJoCo reads: {reason}") from None
    for values in (model.body_pos, model.geom_pos, model.geom_size, model.jnt_pos, model.jnt_range, model.mesh_scale):
        if not (np.abs(values) <= _LARGEST).all():
            raise root.wrong("has a number that is not between -1e12 and 1e12")
    fitted = {geom.id for geom in spec.geoms if geom.meshname and geom.type != mujoco.mjtGeom.mjGEOM_MESH}
    return _Mjcf(path, root, written, model, fitted).robot()


class _Mjcf:
    def __init__(self, path: Path, root: XmlElement, written: MjcfText, model: Any, fitted: set[int]) -> None:
        self.root, self.written, self.model, self.fitted = root, written, model, fitted
        self.file = path.name
        self.changes = written.changes
        self.name = root.attributes.get("model", "").strip() or path.stem
        self.bodies = ["world", *(model.body(k).name or f"body{k}" for k in range(1, model.nbody))]
        self.joints = [model.joint(k).name or f"joint{k}" for k in range(model.njnt)]
        self.links: dict[str, RobotLink] = {}
        self.tree: dict[str, RobotJoint] = {}

    def robot(self) -> tuple[Robot, Semantics]:
        """Return what the model describes."""
        for body in range(self.model.nbody):
            self._body(body)
        for joint, follows in self._followers():
            self.tree[joint] = RobotJoint(**(vars(self.tree[joint]) | {"mimic": follows}))
        robot = Robot(self.name, self.links, self.tree, self.bodies[0], self.changes)
        return robot, Semantics(dict(self._pairs()), dict(self._states()))

    def _element(self, body: int) -> XmlElement:
        return self.written.bodies.get(self.bodies[body], self.root)

    def _body(self, body: int) -> None:
        name, model, element = self.bodies[body], self.model, self._element(body)
        geoms = [found for geom in np.flatnonzero(model.geom_bodyid == body) if (found := self._geom(int(geom)))]
        collides = tuple(shape for shape, meets in geoms if meets)
        shown = tuple(shape for shape, meets in geoms if not meets)
        if body:
            above = self.bodies[model.body_parentid[body]]
            before = np.array(model.body_pos[body])
            turned = _xyzw(model.body_quat[body])
            first = int(model.body_jntadr[body])
            for joint in range(first, first + int(model.body_jntnum[body])):
                anchor = np.array(model.jnt_pos[joint])
                if model.jnt_type[joint] == 0:  # a free joint is at the body's origin in the world
                    self.changes.append(RobotChange(f"link {name}", "moves freely from where it is"))
                    anchor = np.zeros(3)
                last = joint == first + model.body_jntnum[body] - 1 and not anchor.any()
                at = before + (_rotated(turned, anchor) if joint == first else anchor)
                child = name if last else f"{name}_at_{self.joints[joint]}"
                self._joint(joint, above, child, Origin(triple(at), quat_xyzw=turned), element)
                above, before, turned = child, -anchor, (0.0, 0.0, 0.0, 1.0)
            if above != name and name not in {held.child for held in self.tree.values()}:
                self.tree[f"{name}_fixed"] = RobotJoint(
                    f"{name}_fixed", "fixed", above, name, Origin(triple(before), quat_xyzw=turned), (1, 0, 0), element
                )
        self.links[name] = RobotLink(name, collides, shown, element)

    def _joint(self, joint: int, parent: str, child: str, origin: Origin, element: XmlElement) -> None:
        name, model = self.joints[joint], self.model
        kind = _JOINTS[model.jnt_type[joint]]
        if kind == "ball":
            self.changes.append(
                RobotChange(f"joint {name}", "is a ball joint and becomes free: it may slide too", True)
            )
            kind = "floating"
        limits = Limits()
        if kind in ("prismatic", "revolute"):
            shift = float(model.qpos0[model.jnt_qposadr[joint]])
            if shift:
                rule = f"has its ref at {shift:g}, where its position here is 0"
                self.changes.append(RobotChange(f"joint {name}", rule))
            if model.jnt_limited[joint]:
                lower, upper = (float(bound) - shift for bound in model.jnt_range[joint])
                limits = Limits(lower, upper)
            elif kind == "revolute":
                kind = "continuous"
        if child not in self.bodies:
            self.links[child] = RobotLink(child, (), (), element)
        axis = triple(model.jnt_axis[joint])
        self.tree[name] = RobotJoint(name, kind, parent, child, origin, axis, element, limits)

    def _geom(self, geom: int) -> tuple[RobotBody, bool] | None:
        """Return a geom as a body, and whether it collides; None, and the loss told, of what a part cannot hold."""
        import mujoco

        model, body = self.model, int(self.model.geom_bodyid[geom])
        place = f"link {self.bodies[body]}"
        kind = mujoco.mjtGeom(model.geom_type[geom]).name.removeprefix("mjGEOM_").lower()
        a, b, c = (float(value) for value in model.geom_size[geom])
        pos, quat = np.array(model.geom_pos[geom]), np.array(model.geom_quat[geom])
        element, mesh = self._element(body), int(model.geom_dataid[geom])
        geometry = None
        if kind == "mesh":
            element = self.written.meshes[model.mesh(mesh).name]
            pos, quat = _unsolid(model, mesh, pos, quat)
            geometry = Geometry("mesh", file=element.attributes["file"], scale=triple(model.mesh_scale[mesh]))
            if not geometry.file or {"refpos", "refquat"} & set(element.attributes):
                lost = "a mesh without a file" if not geometry.file else "a mesh with refpos or refquat"
                self.changes.append(RobotChange(place, f"{lost} is left out", True))
                return None
        elif geom in self.fitted or kind not in ("box", "sphere", "cylinder", "capsule", "ellipsoid", "plane") or not a:
            lost = (
                f"a {kind} fitted to a mesh"
                if geom in self.fitted
                else f"a {kind}{' without end' if kind == 'plane' else ''}"
            )
            self.changes.append(RobotChange(place, f"{lost} is left out", True))
            return None
        else:
            sizes = {"box": (2 * a, 2 * b, 2 * c), "plane": (2 * a, 2 * b), "sphere": (a,), "ellipsoid": (a, b, c)}
            geometry = Geometry(kind, sizes.get(kind, (a, 2 * b)))
        rgba = model.geom_rgba[geom] if model.geom_matid[geom] < 0 else model.mat_rgba[model.geom_matid[geom]]
        color = "#" + "".join(f"{round(255 * min(max(float(share), 0.0), 1.0)):02x}" for share in rgba)
        name = model.geom(geom).name
        meets = bool(model.geom_contype[geom] or model.geom_conaffinity[geom])
        origin = Origin(triple(pos), quat_xyzw=_xyzw(quat))
        return RobotBody(name, origin, geometry, color.removesuffix("ff") if len(color) == 9 else color, element), meets

    def _followers(self) -> Iterator[tuple[str, Following]]:
        """Yield joints that equalities make follow others: q1 = a0 + a1 q2, both from their refs on."""
        import mujoco

        model = self.model
        leads: dict[int, int] = {}
        for k in np.flatnonzero(model.eq_type == int(mujoco.mjtEq.mjEQ_JOINT)):
            first, second = int(model.eq_obj1id[k]), int(model.eq_obj2id[k])
            place, chain = f"joint {self.joints[first]}", second
            while chain in leads and chain != first:
                chain = leads[chain]
            if second < 0 or first in leads or chain == first or model.eq_data[k, 2:5].any() or not model.eq_active0[k]:
                self.changes.append(RobotChange(place, "an equality that is not q1 = a0 + a1 q2 is dropped", True))
                continue
            leads[first] = second
            yield self.joints[first], Following(self.joints[second], *map(float, model.eq_data[k, 1::-1]))

    def _pairs(self) -> Iterator[tuple[frozenset[str], str]]:
        """Yield pairs that MuJoCo does not test: excluded, neighbours, or by the bits of all their geoms."""
        model, weld = self.model, self.model.body_weldid
        kinds = {
            body: {(int(model.geom_contype[g]), int(model.geom_conaffinity[g])) for g in np.flatnonzero(at)}
            for body in range(model.nbody)
            if (at := (model.geom_bodyid == body) & ((model.geom_contype != 0) | (model.geom_conaffinity != 0))).any()
        }
        excluded = set(model.exclude_signature.tolist())
        for a, b in itertools.combinations(sorted(kinds), 2):
            pair = frozenset((self.bodies[a], self.bodies[b]))
            above = {int(weld[model.body_parentid[weld[k]]]) for k in (a, b) if weld[k]}
            if {(a << 16) + b, (b << 16) + a} & excluded:
                yield pair, f"excluded in {self.file}"
            elif not any(s & v or t & u for s, u in kinds[a] for t, v in kinds[b]):
                yield pair, _FILTERED
            elif weld[a] and weld[b] and weld[a] != weld[b] and {int(weld[a]), int(weld[b])} & above:
                yield pair, _NEIGHBOURS

    def _states(self) -> Iterator[tuple[str, dict[str, float]]]:
        model = self.model
        scalar = [k for k in range(model.njnt) if self.tree[self.joints[k]].moves]
        scalar = [k for k in scalar if self.tree[self.joints[k]].mimic is None]
        for key in range(model.nkey):
            values = model.key_qpos[key] - model.qpos0
            state = {self.joints[k]: float(values[model.jnt_qposadr[k]]) for k in scalar}
            for joint, value in list(state.items()):
                limits = self.tree[joint].limits
                if not limits.lower <= value <= limits.upper:
                    beyond = f"{value:g} is beyond its limits {limits.lower:g} and {limits.upper:g}"
                    self.changes.append(RobotChange(f"key frame {key}", f"joint {joint} at {beyond}: left out"))
                    del state[joint]
            if state:
                yield model.key(key).name or f"key{key}", state


def _xyzw(quat: Floats) -> tuple[float, ...]:
    """Return a quaternion of MuJoCo, wxyz, as the language has it."""
    return tuple(map(float, quat[[1, 2, 3, 0]]))


def _rotated(quat_xyzw: tuple[float, ...], vector: Floats) -> Floats:
    x, y, z, w = quat_xyzw
    axis = np.array([x, y, z])
    turned: Floats = vector + 2.0 * np.cross(axis, np.cross(axis, vector) + w * vector)
    return turned


def _unsolid(model: Any, mesh: int, pos: Floats, quat: Floats) -> tuple[Floats, Floats]:
    """Return the pose (position, wxyz) of a mesh's file, whose place and axes MuJoCo moved to those of the solid."""
    import mujoco

    back, at, turned = np.zeros(4), np.zeros(3), np.zeros(4)
    mujoco.mju_negQuat(back, model.mesh_quat[mesh])
    mujoco.mju_mulQuat(turned, quat, back)
    mujoco.mju_rotVecQuat(at, model.mesh_pos[mesh], turned)
    return pos - at, turned
