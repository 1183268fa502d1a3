"""MJCF as the model that MuJoCo is handed: what bodies, joints and geoms are, and nothing that reaches beyond it.

MuJoCo resolves defaults, frames and orientations, but trusts what it reads: a few lines make it load any file, or fill
the memory. So it gets a text that is written anew from elements and attributes that are known here, includes put in
their place, and a small solid in the place of each mesh, whose file MuJoCo never sees.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from xml.sax.saxutils import quoteattr

from replay import limits
from replay.robots.description import RobotChange
from replay.robots.packages import Packages
from replay.robots.xml_text import XmlElement, parse

_POSE = " pos quat axisangle euler xyaxes zaxis"
_KEPT = {
    "mujoco": "model",
    "compiler": "angle eulerseq autolimits coordinate",
    "default": "class",
    "asset": "",
    "material": "name class rgba",
    "mesh": "name class scale",
    "worldbody": "",
    "body": f"name childclass mocap{_POSE}",
    "frame": f"name childclass{_POSE}",
    "geom": f"name class type size fromto mesh contype conaffinity rgba material{_POSE}",
    "freejoint": "name",
    "joint": "name class type pos axis range limited ref joint1 joint2 polycoef active",
    "contact": "",
    "exclude": "name body1 body2",
    "equality": "",
    "keyframe": "",
    "key": "name qpos",
}
_BODIES = ("attach", "composite", "flexcomp", "replicate", "flex")
"""Elements that stand for bodies or geoms."""
_MASSES = 'boundmass="1" boundinertia="1" balanceinertia="true"'
"""MuJoCo refuses bodies without mass, of which nothing is asked here."""
_SOLID = "0 0 0 1 0 0 0 1 0 0 0 1"


@dataclass
class MjcfText:
    """A description as MuJoCo is to read it.

    Attributes:
        text: the model.
        meshes: the element, with `file` as a path from the description on, by the name of the mesh.
        bodies: the element by the name of the body.
        changes: what is not in the model.
    """

    text: str = ""
    meshes: dict[str, XmlElement] = field(default_factory=dict)
    bodies: dict[str, XmlElement] = field(default_factory=dict)
    changes: list[RobotChange] = field(default_factory=list)


def rewritten(path: Path, root: XmlElement) -> MjcfText:
    """Return a description with its includes as MuJoCo is to read it.

    Raises:
        RobotError: a file that it includes is not to be found, is outside of its tree, is no MJCF, or comes twice; a
            number is none; it has more elements than are read.
    """
    writer = _Writer(path)
    lines = writer.lines(root)
    found = writer.found
    found.text = "\n".join([*lines[:-1], f"<compiler {_MASSES}/>", lines[-1]])
    for tag, times in sorted(writer.dropped.items()):
        lost = tag in _BODIES
        found.changes.append(RobotChange(f"{times} x <{tag[:100]}>", "is not read" if lost else "is not used", lost))
    for name, mesh in found.meshes.items():
        folder = writer.folders.get("meshdir") or writer.folders.get("assetdir", "")
        inside = mesh.attributes.get("file", "")
        inside = inside.rpartition("/")[2] if writer.strip else inside
        file = f"{folder.rstrip('/')}/{inside}" if folder and inside and not inside.startswith("/") else inside
        found.meshes[name] = XmlElement(mesh.tag, mesh.attributes | {"file": file}, mesh.file, mesh.line)
    return found


class _Writer:
    def __init__(self, path: Path) -> None:
        self.found = MjcfText()
        self.dropped: Counter[str] = Counter()
        self.folders: dict[str, str] = {}
        self.strip = False
        self._packages = Packages(path, {}, {})
        self._included = {path.resolve()}
        self._count = self._depth = 0

    def lines(self, element: XmlElement) -> list[str]:
        """Return an element, and what is in it, as lines."""
        self._count += 1
        if self._count > limits.ROBOT_ELEMENTS or self._depth > limits.ROBOT_DEPTH:
            rule = f"{limits.ROBOT_ELEMENTS} elements, {limits.ROBOT_DEPTH} deep, that are read"
            raise element.wrong(f"with what it includes it has more than the {rule}")
        tag, given = element.tag, dict(element.attributes)
        kept = {name: self._value(element, name) for name in _KEPT[tag].split() if name in given}
        if tag == "compiler":
            self.folders |= {name: given[name] for name in ("meshdir", "assetdir") if name in given}
            self.strip = given.get("strippath", "false") == "true"
        if tag == "mesh" and ("file" in given or "name" in given):
            kept |= {"name": given.get("name") or Path(given["file"]).stem, "vertex": _SOLID}
            self.found.meshes[kept["name"]] = element
        if tag == "body" and "name" in given:
            self.found.bodies[given["name"]] = element
        inner = [line for child in element.children for line in self._child(child)]
        head = f"<{tag}{''.join(f' {name}={quoteattr(value)}' for name, value in kept.items())}"
        return [f"{head}>", *inner, f"</{tag}>"] if inner or tag == "mujoco" else [f"{head}/>"]

    def _child(self, element: XmlElement) -> list[str]:
        self._depth += 1
        try:
            if element.tag == "include":
                return [line for child in self._file(element).children for line in self._child(child)]
            if element.tag in _KEPT and element.tag != "mujoco":
                return self.lines(element)
            self.dropped[element.tag] += 1
            return []
        finally:
            self._depth -= 1

    def _file(self, include: XmlElement) -> XmlElement:
        """Return the root element of a file that is included."""
        path = self._packages.find(include.text("file"), include).path
        if path in self._included or len(self._included) > limits.ROBOT_DEPTH:
            raise include.wrong(f"{path.name} is included twice, or after {limits.ROBOT_DEPTH} others")
        self._included.add(path)
        try:
            with path.open("rb") as file:
                return parse(path, file.read(limits.ROBOT_XML + 1), root=("mujoco", "mujocoinclude"))
        except OSError as error:
            raise include.wrong(f"{path} cannot be read: {error.strerror}") from None

    def _value(self, element: XmlElement, name: str) -> str:
        value = element.attributes[name]
        if name not in ("name", "class", "childclass") and any(
            word.lower().lstrip("+-") in ("nan", "inf", "infinity") for word in value.split()
        ):
            raise element.wrong(f"<{element.tag}> has {name}={value[:60]!r}, which is no number")
        return value
