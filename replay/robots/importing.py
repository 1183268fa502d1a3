"""From the files that describe a robot to a part of the language with its meshes, and what was lost on the way."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import replay
from replay import limits
from replay.errors import RecordingExistsError, RobotError, count
from replay.language.units import ANGLE, LENGTH, quantity_rule
from replay.logs.part_file import write_file
from replay.robots import checking, joint_limits, part_text, srdf, urdf
from replay.robots.description import Origin, RobotChange, Triple
from replay.robots.meshes import RobotMeshes
from replay.robots.packages import Packages, given
from replay.robots.part import RobotPart, make

_MADE = "# SHA-256 of what follows: "
_MOST_CHANGES = 1000
"""How many changes are told."""


@dataclass(frozen=True)
class Options:
    """What an import is told beside the description; see `replay import --help`."""

    srdf: Path | None = None
    packages: Sequence[str] = ()
    acceleration: Sequence[str] = ()
    limits: Path | None = None
    collision: str = "collision"
    prefix: str = ""
    root_pose: str = ""
    copy_meshes: bool = False
    up_axis: str = "apply"
    samples: int = 0
    overwrite: bool = False


@dataclass
class Imported:
    """What was written.

    Attributes:
        name: of the robot.
        file: the part.
        part: what it holds.
        meshes: files that were written beside it.
        changes: what is not as the description says.
        checked: pairs of links by what random poses showed of them.
    """

    name: str
    file: Path
    part: RobotPart
    meshes: tuple[Path, ...]
    changes: tuple[RobotChange, ...]
    checked: tuple[tuple[str, str, str], ...] = field(default=())

    @property
    def lossy(self) -> bool:
        """Whether something physical was lost."""
        return any(change.physical for change in self.changes)

    def lines(self) -> list[str]:
        """Return the report as lines."""
        counts = ", ".join(count(number, noun) for noun, number in self._counts().items())
        found = [f"{self.name}: {self.file}: {counts}"]
        found += [f"  {'lost: ' if change.physical else ''}{change}" for change in self.changes]
        return found + [f"  {a}, {b}: {what}" for a, b, what in self.checked]

    def data(self) -> dict[str, Any]:
        """Return the report as JSON holds it."""
        return {
            "robot": self.name,
            "part": str(self.file),
            **{f"{noun.replace(' ', '_')}s": number for noun, number in self._counts().items()},
            "meshes": [str(path) for path in self.meshes],
            "lossy": self.lossy,
            "changes": [{"place": c.place, "what": c.what, "physical": c.physical} for c in self.changes],
            "checked": [{"pair": [a, b], "what": what} for a, b, what in self.checked],
        }

    def _counts(self) -> dict[str, int]:
        links = self.part.links.values()
        joints = (entry["joint"]["type"] for entry in links if "joint" in entry)
        return {
            "link": len(links),
            "moving joint": sum(kind != "fixed" for kind in joints),
            "shape": sum(len(entry.get("shapes", {})) for entry in links),
            "pose": len(self.part.poses),
            "disabled pair": len(self.part.disabled),
        }


def run(description: Path, output: Path, options: Options) -> Imported:
    """Read a robot and write it as a part.

    Args:
        description: a URDF file.
        output: the part.
        options: see there.

    Raises:
        RobotError: the description, or what is beside it, cannot be used: nothing is written.
        MissingPackageError: a mesh needs a package that is not installed.
        ScenarioError: the joint limits are not YAML, or a mesh cannot be used where collisions are checked.
        RecordingExistsError: the part is there, was changed by hand, and may not be overwritten.
        WriteError: a file cannot be written.
    """
    if output.suffix.lower() not in (".yaml", ".yml"):
        raise RobotError(str(output), "is to be a part, whose name ends in .yaml")
    _may_write(output, options.overwrite)
    data = _read(description)
    robot = urdf.read(description, data)
    semantics = srdf.Semantics() if options.srdf is None else srdf.read(options.srdf, _read(options.srdf), robot)
    if options.limits is not None:
        joint_limits.limited(robot, options.limits, _read(options.limits))
    joint_limits.accelerated(robot, joint_limits.accelerations(options.acceleration))
    meshes = RobotMeshes(
        Packages(description, given(options.packages)), output, options.copy_meshes, options.up_axis == "apply"
    )
    part = make(
        robot,
        semantics,
        meshes,
        prefix=options.prefix,
        root_pose=_pose(options.root_pose) if options.root_pose else None,
        visual=options.collision == "visual",
    )
    changes = _alike([*robot.changes, *semantics.changes, *part.changes, *meshes.changes])
    head = [f"Robot {robot.name}, imported from {description.name} by replay {replay.__version__}."]
    head += [f"{path.name} has the SHA-256 {digest}." for path, digest in _digests(description, data, options).items()]
    text = part_text.text(part, head, changes)
    checked: tuple[tuple[str, str, str], ...] = ()
    scenario = checking.valid(text, output, meshes.sources, deep=options.samples > 0)
    if options.samples:
        checked = tuple(checking.needless_pairs(scenario, part, options.samples))
        part.disabled.extend(checked)
        text = part_text.text(part, head, changes)
        checking.valid(text, output, meshes.sources)
    meshes.save()
    sealed = f"{_MADE}{hashlib.sha256(text.encode()).hexdigest()}\n{text}"
    write_file(output, sealed.encode(), overwrite=True, named=True)
    return Imported(robot.name, output, part, tuple(meshes.written), tuple(changes), checked)


def _may_write(output: Path, overwrite: bool) -> None:
    """Refuse to replace a part that is not as an import has left it: somebody's work is in it."""
    if overwrite or not output.exists():
        return
    try:
        with output.open("rb") as file:
            head, _, body = file.read(limits.YAML_BYTES + 1).partition(b"\n")
    except OSError:
        raise RecordingExistsError(str(output)) from None
    if head.decode(errors="replace") != _MADE + hashlib.sha256(body).hexdigest():
        raise RecordingExistsError(str(output))


def _read(path: Path) -> bytes:
    try:
        with path.open("rb") as file:
            return file.read(limits.ROBOT_XML + 1)
    except OSError as error:
        raise RobotError(str(path), f"cannot be read: {error.strerror or error}") from None


def _digests(description: Path, data: bytes, options: Options) -> Mapping[Path, str]:
    others = [path for path in (options.srdf, options.limits) if path is not None]
    read = {description: data, **{path: _read(path) for path in others}}
    return {path: hashlib.sha256(content).hexdigest() for path, content in read.items()}


def _pose(text: str) -> Origin:
    """Return a pose written as X Y Z, or X Y Z ROLL PITCH YAW, each with its unit or in m and rad."""
    words = text.replace(",", " ").split()
    if len(words) not in (3, 6):
        raise RobotError("--root-pose", f"{text!r} is not X Y Z [ROLL PITCH YAW], such as '0 0 90cm 0 0 90deg'")
    values = []
    for word, dimension in zip(words, (LENGTH,) * 3 + (ANGLE,) * 3, strict=False):
        result = quantity_rule(word if word[-1].isalpha() else f"{word} {dimension.si}", (dimension,))
        if isinstance(result, str):
            raise RobotError("--root-pose", f"{word!r} {result}")
        if abs(result[0]) > 10**12:
            raise RobotError("--root-pose", f"{word!r} must be between -1e12 and 1e12 {dimension.si}")
        values.append(float(result[0]))
    x, y, z, *turns = values
    roll, pitch, yaw = turns or (0.0, 0.0, 0.0)
    xyz: Triple = (x, y, z)
    return Origin(xyz, (roll, pitch, yaw))


def _alike(changes: Sequence[RobotChange]) -> list[RobotChange]:
    """Return changes with those that say the same of several links or joints as one, the physical ones first."""
    places: dict[tuple[str, bool], dict[str, None]] = {}
    for change in changes:
        places.setdefault((change.what, change.physical), {})[change.place] = None
    merged = []
    for (what, physical), named in places.items():
        kinds = {place.partition(" ")[0] for place in named}
        shown = list(named)
        if len(named) > 1 and len(kinds) == 1:
            first, *others = (place.partition(" ")[2] for place in named)
            shown = [f"{kinds.pop()}s {first}", *others]
        more = f", and {len(named) - 8} more" if len(named) > 8 else ""
        merged.append(RobotChange(", ".join(shown[:8]) + more, what, physical))
    merged.sort(key=lambda change: not change.physical)
    rest = merged[_MOST_CHANGES:]
    if rest:
        merged[_MOST_CHANGES:] = [RobotChange("and more", f"{len(rest)} others are not told", rest[0].physical)]
    return merged
