"""Why a reading is what it is: poses, what is closest or who adds how much, the method, and what other methods say."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from replay.collision.closest_triangles import closest_triangles
from replay.collision.columns import Between, Level
from replay.comparison import quantities
from replay.errors import InvalidValue, RecordingError, ReplayError, count
from replay.kinematics.linkage import LinkPoses
from replay.numerics import transforms
from replay.numerics.arrays import Floats
from replay.numerics.columns import Field
from replay.numerics.constants import SECOND
from replay.recording.reader import Recording, read
from replay.recording.slim import attached_files
from replay.scenario.layout import Layout
from replay.scenario.load import load_sources
from replay.scenario.methods import METHOD_REVISIONS, Model
from replay.scenario.scene import Scene, build
from replay.sensing.kinds import KINDS

_SHARES = 8
"""Objects whose shares are told, the largest first."""
_COLLISION: Final = "/collision"


@dataclass(frozen=True, eq=False)
class _Moment:
    """One frame of a recording, with the scene that it is of.

    Attributes:
        row: of the recording's columns; `poses` those of the links there, (1, L).
    """

    recording: Recording
    scene: Scene
    row: int
    poses: LinkPoses

    def pose(self, link: int) -> Floats:
        """Return T_world_link, (4, 4)."""
        world: Floats = self.poses.world[0, link]
        return world


def explain(path: Path, signal: str, at: float, *, slow: bool = False) -> list[str]:
    """Return lines that say why a signal of a recording is what it is at a moment.

    Args:
        path: of the recording, whole or slim.
        signal: topic of a sensor ("/distance/tip"), a pair ("/collision/arm/rod|table/top"), or the full name of one of
            their signals, as `replay diff` tells it.
        at: moment [s]; the frame at or before it is looked at.
        slow: ask methods that take seconds a frame too.

    Raises:
        RecordingError: the recording cannot be read, or lacks a file of its scenario.
        InvalidValue: it has no such signal or moment.
        ScenarioError: this version cannot read its scenario.
    """
    recording = read(path)
    kind, name = _asked(recording, signal)
    end = float(recording.time[-1]) / SECOND
    if not 0.0 <= at <= end + 1e-9:
        raise InvalidValue("--at", f"{at:g} s", f"is no moment of the recording, which ends at {end:.6g} s")
    scenario_name, root, files = attached_files(path)
    scene = build(load_sources(root, files, case=scenario_name))
    _check(path, recording.layout, scene.layout)
    row = int(np.searchsorted(recording.time, round(at * SECOND), side="right")) - 1
    moment = _Moment(recording, scene, row, _poses(scene, recording, row))
    lines = [f"{signal} at frame {row} ({recording.time[row] / SECOND:.9g} s)"]
    lines += _pair(moment, name) if kind == "" else _sensor(moment, kind, name, slow)
    return lines


def _check(path: Path, recorded: Layout, built: Layout) -> None:
    """Raise RecordingError unless the attached scenario has the names behind the recording's columns."""
    sensors = {(kind, name) for kind, names in recorded.sensors.items() for name in names}
    there = {(kind, name) for kind, names in built.sensors.items() for name in names}
    moved = (recorded.links, recorded.joints) != (built.links, built.joints)
    if moved or not sensors <= there or not {*recorded.pairs} <= {*built.pairs}:
        rule = "holds another scenario than it was made of: its links, joints, pairs or sensors have other names"
        raise RecordingError(str(path), rule)


def _asked(recording: Recording, signal: str) -> tuple[str, str]:
    """Return the kind and the name of the sensor that a signal is of; "" and the name of a pair."""
    layout = recording.layout
    if signal.startswith(f"{_COLLISION}/"):
        found = [pair for pair in layout.pairs if signal.endswith(f"/{pair}")]
        if found:
            return "", max(found, key=len)
    topics = [topic for topic in layout.topics() if signal == topic or signal.startswith(f"{topic}/")]
    if topics:
        return layout.topics()[max(topics, key=len)]
    example = next(iter([*layout.topics(), *(f"{_COLLISION}/{pair}" for pair in layout.pairs)]), "")
    rule = f"is no sensor or pair of the recording{f'; there is, for example, {example!r}' if example else ''}"
    raise InvalidValue("SIGNAL", repr(signal), rule)


def _poses(scene: Scene, recording: Recording, row: int) -> LinkPoses:
    """Return the poses of a frame as the simulation has them: of the positions, which guards may have held back, and of
    the script of free bodies; not of rotations that were stored."""
    from replay.kinematics.motion import sample

    at = slice(row, row + 1)
    free = sample(scene.linkage, scene.script, recording.time[at] / SECOND).free_poses
    return scene.linkage.forward(recording.joint_positions[at], free)


def _sensor(moment: _Moment, kind: str, name: str, slow: bool) -> Iterator[str]:
    layout, described = moment.recording.layout, KINDS[kind]
    number = layout.sensors[kind].index(name)
    columns = moment.recording.readings[kind]
    sensor = next(sensor for sensor in moment.scene.sensors[kind] if sensor.name == name)
    yield f"  method {kind}.{moment.recording.provenance.model.get(kind, '?')}"
    link = sensor.link
    yield f"  sensor on {moment.scene.layout.links[link]}, which is at {_place(moment.pose(link))}"
    for field in columns.present():
        gate = next((one for one in columns.present() if one.name == field.gate), None)
        if gate is not None and int(getattr(columns, gate.name)[moment.row, number]) not in gate.open:
            continue
        values = getattr(columns, field.name)[moment.row, number]
        if field.each:
            yield from _shares(field, values, getattr(layout, field.each))
        else:
            yield f"  {field.spoken} {_value(field, values, layout)}"
    seen = next((field for field in columns.present() if field.names == "shapes"), None)
    if seen is not None and (index := int(getattr(columns, seen.name)[moment.row, number])) >= 0:
        yield from _shape(moment, layout.shapes[index], columns, number)
    yield "  other versions of the method at this frame:"
    main = [field for field in columns.present() if field.chart]
    for method, revision in described.revisions.items():
        left_out = method in described.slow and not slow
        said = "takes seconds; --slow asks it too" if left_out else _by(moment, kind, sensor, method, main)
        yield f"    {kind}.{method}@{revision}: {said}"


def _value(field: Field, value: Any, layout: Any) -> str:
    """Return a value of a sensor's field in words."""
    if field.letters:
        return f"({', '.join(f'{number:.6g}' for number in value)}) {field.unit}".rstrip()
    if field.names:
        names = getattr(layout, field.names)
        return names[int(value)] if 0 <= int(value) < len(names) else "nothing"
    if field.states is not None:
        return field.states(int(value)).name.lower().replace("_", " ")
    if field.kind.is_state:
        return str(bool(value)).lower() if field.type.kind == "b" else str(int(value))
    return "none" if np.isnan(value) else quantities.shown(float(value), field.unit, digits=6)


def _shares(field: Field, values: Floats, names: tuple[str, ...]) -> Iterator[str]:
    total = float(np.abs(values[np.isfinite(values)]).sum())
    order = np.argsort(-np.where(np.isfinite(values), np.abs(values), np.inf), kind="stable")
    told = [k for k in order.tolist() if values[k] != 0.0][:_SHARES]
    yield f"  {field.spoken}:"
    for k in told:
        share = f" ({values[k] / total:.1%})" if total > 0.0 and np.isfinite(values[k]) else ""
        yield f"    {names[k]} {quantities.shown(float(values[k]), field.unit, digits=6)}{share}"
    rest = int(np.count_nonzero(values)) - len(told)
    if rest > 0:
        yield f"    and {count(rest, 'more object')}"


def _shape(moment: _Moment, name: str, columns: Any, number: int) -> Iterator[str]:
    shape = next((shape for shape in moment.scene.shapes if shape.name == name), None)
    if shape is None:
        return
    pose = moment.pose(shape.link)
    yield f"  {name} is on {moment.scene.layout.links[shape.link]}, which is at {_place(pose)}"
    triangle = getattr(columns, "triangle", None)
    if triangle is not None and 0 <= (index := int(triangle[moment.row, number])) < len(shape.solid.triangles):
        corners = transforms.apply(pose, shape.solid.triangles[index])
        yield f"  its triangle {index} in world: {'; '.join(_point(corner) for corner in corners)}"


def _by(moment: _Moment, kind: str, sensor: Any, method: str, fields: list[Field]) -> str:
    """Return what a sensor reads by a method at the frame, in words; or why it reads nothing."""
    described = KINDS[kind]
    try:
        options = {"method": method}
        if method == getattr(moment.scene.model, kind).method:
            options = getattr(moment.scene.model, kind).model_dump(exclude_none=True)
        suite = described.suite([sensor], moment.scene.targets, described.method(**options), savings=False)
        columns = suite.run(moment.poses)
    except (ReplayError, ValueError) as error:
        return f"cannot say: {str(error).splitlines()[0]}"
    there = [field for field in columns.present() if field in fields]  # the method, without what electronics make of it
    found = [float(np.asarray(getattr(columns, field.name))[0, 0]) for field in there]
    told = (quantities.shown(value, field.unit, digits=6) for value, field in zip(found, there, strict=True))
    return ", ".join("nothing" if np.isnan(value) else text for value, text in zip(found, told, strict=True))


def _pair(moment: _Moment, name: str) -> Iterator[str]:
    collision = moment.recording.collision
    assert collision is not None
    k = moment.recording.layout.pairs.index(name)
    model = moment.recording.provenance.model
    methods = ", ".join(str(model.get(f"collision.{option}", "?")) for option in ("narrowphase", "pieces", "bounds"))
    yield f"  method collision: {methods}"
    level = Level(int(collision.level[moment.row, k]))
    yield f"  level {level.name.lower()}"
    clearance = float(collision.clearance[moment.row, k])
    yield f"  clearance {'not evaluated' if np.isnan(clearance) else quantities.shown(clearance, 'm', digits=6)}"
    if collision.between is not None:
        between = Between(int(collision.between[moment.row, k]))
        yield f"  since the frame before: {between.name.lower().replace('_', ' ')}"
    shapes = [next(shape for shape in moment.scene.shapes if shape.name == side) for side in name.split("|")]
    poses = [moment.pose(shape.link) for shape in shapes]
    for shape, pose in zip(shapes, poses, strict=True):
        yield f"  {shape.name} is on {moment.scene.layout.links[shape.link]}, which is at {_place(pose)}"
    found = closest_triangles(*(transforms.apply(p, s.solid.triangles) for s, p in zip(shapes, poses, strict=True)))
    for shape, triangle, point in zip(shapes, found.triangles, found.points, strict=True):
        yield f"  closest: triangle {triangle} of {shape.name} at {_point(point)}"
    yield f"  the surfaces there are {quantities.shown(found.gap, 'm', digits=6)} apart"
    yield "  other versions of the method at this frame:"
    for option, choice in _choices():
        yield f"    collision.{option}.{choice}@{METHOD_REVISIONS[f'collision.{option}.{choice}']}: " + _pair_by(
            moment, name, option, choice
        )


def _choices() -> Iterator[tuple[str, str]]:
    for name in METHOD_REVISIONS:
        room, _, rest = name.partition(".")
        option, _, choice = rest.partition(".")
        if room == "collision" and option in ("narrowphase", "pieces", "bounds"):
            yield option, choice


def _pair_by(moment: _Moment, name: str, option: str, choice: str) -> str:
    from replay.simulation import collision_pipeline

    own = moment.scene.model
    try:
        collision = own.collision.model_copy(update={option: choice, "clearance": "always", "between": "sampled"})
        model: Model = own.model_copy(update={"collision": collision})
        scene = build(moment.scene.scenario, model=model)
        found = collision_pipeline(scene, None).run(moment.poses)
    except ReplayError as error:
        return f"cannot say: {str(error).splitlines()[0]}"
    k = scene.layout.pairs.index(name)
    clearance = quantities.shown(float(found.clearance[0, k]), "m", digits=6)
    return f"{Level(int(found.level[0, k])).name.lower()}, clearance {clearance}"


def _place(pose: Floats) -> str:
    """Return a pose as people read it: a point and the rotation's quaternion."""
    quaternion = ", ".join(f"{value:.6g}" for value in transforms.to_quaternion(pose[None])[0])
    return f"{_point(pose[:3, 3])}, turned by quat_xyzw ({quaternion})"


def _point(point: Floats) -> str:
    return f"({', '.join(f'{value:.6g}' for value in point)}) m"
