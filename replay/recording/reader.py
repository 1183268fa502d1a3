"""An MCAP recording back to the columns that were written."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from replay.collision.columns import CollisionColumns
from replay.errors import ForeignLogError, InvalidValue, RecordingError
from replay.guarding.columns import GuardColumns
from replay.logs.columns import Topic, read_topics
from replay.logs.loss import Loss
from replay.logs.mcap_reader import McapLog
from replay.numerics import transforms
from replay.numerics.arrays import Floats, Integers
from replay.numerics.columns import Field
from replay.recording.event_messages import TOPIC as EVENTS
from replay.recording.event_messages import read_events
from replay.recording.events import Events
from replay.recording.layout_message import TOPIC as LAYOUT
from replay.recording.provenance import RECORD, Provenance, sha256
from replay.sensing.kinds import KINDS, of_kind
from replay.simulation import Layout

FRAMES = "/joint_states"
"""The topic that is in every recording and tells its frames."""


_NUMBER = Field()


@dataclass(frozen=True, eq=False)
class Recording:
    """A whole recording: the columns of `FrameBlock` for all F frames.

    Every number is the one that was written, bit by bit, except `link_poses`: a pose is stored as translation and
    unit quaternion (`link_quaternions`), and its rotation matrix is computed again from that. A column that the format
    of an older recording does not have is None. `collision.crossings` are empty: the events tell them.

    Attributes:
        path: the file.
        provenance: where it comes from; `layout` is the provenance's.
        time: (F,) int64 [ns] from the scenario's start.
        joint_positions: (F, J) [rad or m].
        joint_velocities: (F, J) [rad/s or m/s].
        link_poses: (F, L, 4, 4), T_world_link.
        link_quaternions: (F, L, 4), rotation of T_world_link, xyzw, w >= 0.
        collision: None when the scene tests no pair.
        readings: columns of the sensors by kind, also by name as `recording.distance`, None when there are none.
        guards: None when there are none; `happenings` are empty: the events tell them.
        events: in the order of time, a sequence of `Event`.
        files: the scenario and every file that it needs, by name.
        loss: what a salvaged file has lost, else None.
        lost_frames: frames of the scenario that are not there; 0 unless salvaged.
    """

    path: Path
    provenance: Provenance
    time: Integers
    joint_positions: Floats
    joint_velocities: Floats
    link_poses: Floats
    link_quaternions: Floats
    collision: CollisionColumns | None
    events: Events
    files: Mapping[str, bytes]
    loss: Loss | None
    lost_frames: int
    readings: Mapping[str, Any] = field(default_factory=dict)
    guards: GuardColumns | None = None

    def __getattr__(self, kind: str) -> Any:
        return of_kind(self, kind, "readings")

    @property
    def layout(self) -> Layout:
        """The names behind the columns."""
        return self.provenance.layout

    @property
    def loss_text(self) -> str:
        """What is wrong with a salvaged file and what is left of it, in words; "" for a whole one."""
        return "" if self.loss is None else self.loss.text(len(self.time), self.provenance.frames)


def read(path: str | Path, *, salvage: bool = False, topics: Collection[str] | None = None) -> Recording:
    """Return a recording.

    Args:
        path: an MCAP file that `replay` wrote.
        salvage: of a file that was cut or damaged, keep the whole blocks before the damage instead of refusing it;
            `loss` and `lost_frames` then say what is missing.
        topics: read only these, such as "/collision" or "/distance/left", and take the time and memory of these
            alone; `layout` then names what was read. All when None.

    Raises:
        ForeignLogError: the file is no recording.
        RecordingError: the file cannot be read, has another format version, or is damaged
            (with `salvage`: so early that nothing can be kept).
        InvalidValue: the recording has no topic of that name.
    """
    with McapLog(path, salvage=salvage) as log:
        return _Assembly(log, topics).recording()


def read_provenance(log: McapLog) -> Provenance:
    """Return the provenance of an opened recording.

    Raises:
        ForeignLogError: the file is not one.
        RecordingError: its provenance cannot be used.
    """
    found = [values for name, values in log.metadata if name == RECORD]
    if not found and log.loss is not None and not log.channels:
        raise RecordingError(str(log.path), f"nothing can be salvaged: {log.loss.reason}")
    if not found:
        raise ForeignLogError(str(log.path), f"is not a recording of replay: it has no metadata record {RECORD!r}")
    if len(found) != 1:
        raise RecordingError(str(log.path), f"damaged: it has {len(found)} metadata records {RECORD!r}")
    return Provenance.from_metadata(str(log.path), found[0])


def read_files(log: McapLog, provenance: Provenance) -> dict[str, bytes]:
    """Return the files that are attached to an opened recording, by name: those that its provenance states.

    Raises:
        RecordingError: one is not the file whose SHA-256 is stated, so the readings may be of another scene.
    """
    files = {}
    for attachment in log.attachments:
        if attachment.name not in provenance.files:
            continue  # of a tool of others
        data = log.attachment(attachment)
        if sha256(data) != provenance.files[attachment.name]:
            rule = f"damaged: the attached {attachment.name!r} is not the file whose SHA-256 its metadata states"
            raise RecordingError(str(log.path), rule)
        files[attachment.name] = data
    return files


def own_topics(layout: Layout) -> set[str]:
    """Return the topics that a recording may have; those that another tool has added to it are none of them."""
    return {FRAMES, "/tf", "/scene", LAYOUT, EVENTS, "/collision", "/guards", *layout.topics()}


class _Assembly:
    """Puts the topics of one recording together."""

    def __init__(self, log: McapLog, wanted: Collection[str] | None) -> None:
        self._log = log
        self._file = str(log.path)
        self._provenance = read_provenance(log)
        if log.loss is not None and not log.preamble_holds:
            raise RecordingError(self._file, f"nothing can be salvaged: {log.loss.reason}")
        names = {channel.topic for channel in log.channels.values()} & own_topics(self._provenance.layout)
        self._all = self._provenance.layout
        self._check_topics(names)
        chosen = names
        if wanted is not None:
            for name in wanted:
                if name not in names:
                    raise InvalidValue("topic", name, f"is none of {', '.join(sorted(names))}")
            chosen = set(wanted)
            self._provenance = replace(self._provenance, layout=_reduced(self._provenance.layout, chosen))
        self._layout = self._provenance.layout
        self._with_events = EVENTS in chosen
        self._topics = read_topics(log, (chosen | {FRAMES}) - {"/scene", LAYOUT, EVENTS})
        self._frames = self._whole_frames()

    def recording(self) -> Recording:
        layout, count = self._layout, len(self._frames)
        joints = self._topic(FRAMES)
        tf = self._topic("/tf") if layout.links else joints
        positions = [self._column(joints, f"joints[{j}].position") for j in range(len(layout.joints))]
        velocities = [self._column(joints, f"joints[{j}].velocity") for j in range(len(layout.joints))]
        links = range(len(layout.links))
        translation = [[self._column(tf, f"transforms[{k}].translation.{c}") for c in "xyz"] for k in links]
        rotation = [[self._column(tf, f"transforms[{k}].rotation.{c}") for c in "xyzw"] for k in links]
        quaternions = _stack([_stack(parts, count) for parts in rotation], count, 4)
        poses = transforms.from_quaternion(quaternions) if links else np.zeros((count, 0, 4, 4))
        poses[..., :3, 3] = _stack([_stack(parts, count) for parts in translation], count, 3)
        self._check_names(joints, "joints[{}].name", layout.joints)
        self._check_names(tf, "transforms[{}].child_frame_id", layout.links)
        return Recording(
            path=self._log.path,
            provenance=self._provenance,
            time=self._frames,
            joint_positions=_stack(positions, count),
            joint_velocities=_stack(velocities, count),
            link_poses=poses,
            link_quaternions=quaternions,
            collision=self._collision(),
            readings=self._readings(),
            guards=self._guards(),
            events=self._events(),
            files=read_files(self._log, self._provenance),
            loss=self._log.loss,
            lost_frames=self._provenance.frames - count,
        )

    def _check_topics(self, names: set[str]) -> None:
        """Refuse a file without the topics that every recording has, or with some sensors of a kind and not all."""
        needed = {FRAMES, "/tf", EVENTS, *(["/guards"] if self._provenance.layout.guards else [])}
        for kind, sensors in self._provenance.layout.sensors.items():
            topics = {KINDS[kind].topic(name) for name in sensors}
            needed |= topics if topics & names else set()
        missing = ", ".join(map(repr, sorted(needed - names)))
        if missing:
            raise RecordingError(self._file, f"damaged: topics are missing: {missing}")

    def _whole_frames(self) -> Integers:
        """Return the times of the frames of whole blocks: those that every topic of the recording has."""
        per_frame = self._topics.values()
        time = self._topic(FRAMES).time
        count = len(time)
        if self._log.loss is not None:
            block = self._provenance.block_frames
            count = min(len(topic.time) for topic in per_frame)
            count = count if count == self._provenance.frames else count // block * block
        time = time[:count]
        for topic in per_frame:
            if not np.array_equal(topic.time[:count], time) or (self._log.loss is None and len(topic.time) != count):
                raise RecordingError(self._file, f"damaged: topic {topic.name!r} has other frames than {FRAMES}")
        if not bool((np.diff(time) > 0).all()):
            raise RecordingError(self._file, "damaged: its frames are not in the order of time")
        if self._log.loss is None and count != self._provenance.frames:
            raise RecordingError(
                self._file, f"damaged: it holds {count} frames, its scenario has {self._provenance.frames}"
            )
        return time

    def _topic(self, name: str) -> Topic:
        if name not in self._topics:
            raise RecordingError(self._file, f"damaged: topic {name!r} is missing")
        return self._topics[name]

    def _column(self, topic: Topic, path: str, field: Field = _NUMBER, count: int | None = None) -> NDArray[Any]:
        """Take a value of all frames out of a topic, (F,) or, with `count`, (F, count); so memory holds it once."""
        frames = len(self._frames)
        column = topic.columns.pop(path, None)
        if column is None and (count == 0 or not len(topic.time)) and topic.messages is None:
            column = np.zeros((len(topic.time), *(() if count is None else (count,))), field.type)
        if column is None or column.shape[1:] != (() if count is None else (count,)):
            raise RecordingError(self._file, f"damaged: field {path!r} of topic {topic.name!r} is missing or misshapen")
        least, most = self._range(field)
        if column.dtype.kind not in {"f": "f", "b": "b"}.get(field.type.kind, "iu"):
            raise RecordingError(self._file, f"damaged: field {path!r} of topic {topic.name!r} is of another type")
        column = column[:frames]
        if field.type.kind != "f" and column.size and not (column.min() >= least and column.max() <= most):
            wrong = int(column.min() if column.min() < least else column.max())
            rule = f"{wrong}, which is none of {least} to {most}"
            raise RecordingError(self._file, f"damaged: field {path!r} of topic {topic.name!r} is {rule}")
        return column.astype(field.type, copy=False)

    def _range(self, field: Field) -> tuple[int, int]:
        """Return the least and the largest value of a field that counts or names something."""
        if field.names:
            return -1, len(getattr(self._layout, field.names)) - 1
        return (-1 if field.type.kind == "i" else 0), field.most

    def _field(self, topic: Topic, field: Field) -> NDArray[Any] | None:
        """Take a field of all frames out of a topic, (F,) or, of a vector or a list, (F, n).

        None of one that the format of the recording does not have.
        """
        if field.since > self._provenance.format:
            return None
        if field.letters:
            return np.stack([self._column(topic, f"{field.name}.{c}", field) for c in field.letters], axis=1)
        count = len(getattr(self._layout, field.each)) if field.each else None
        return self._column(topic, field.name, field, count)

    def _check_names(self, topic: Topic, path: str, names: tuple[str, ...]) -> None:
        if any(topic.texts.get(path.format(index)) != name for index, name in enumerate(names)) and len(self._frames):
            raise RecordingError(
                self._file, f"damaged: the names in topic {topic.name!r} are not those of its metadata"
            )

    def _collision(self) -> CollisionColumns | None:
        if "/collision" not in self._topics:
            return None
        topic = self._topic("/collision")
        columns: dict[str, Any] = {field.name: self._field(topic, field) for field in CollisionColumns.fields()}
        return CollisionColumns(**columns)

    def _guards(self) -> GuardColumns | None:
        if not self._all.guards or "/guards" not in self._topics:
            return None
        topic, names = self._topic("/guards"), self._all  # clocks of joints, also where their positions are not read
        found: dict[str, Any] = {
            field.name: self._column(topic, field.name, field, len(getattr(names, field.each)))
            for field in GuardColumns.fields()
        }
        return GuardColumns(**found)

    def _readings(self) -> dict[str, Any]:
        found = {}
        for kind, names in self._layout.sensors.items():
            topics = [self._topics[topic] for topic in map(KINDS[kind].topic, names) if topic in self._topics]
            if topics:
                columns = KINDS[kind].columns
                read = [name for name in names if KINDS[kind].topic(name) in self._topics]
                values = {}
                for field in columns.fields():
                    having = [self._layout.has(kind, name, field) for name in read]
                    values[field.name] = self._of_sensors(topics, field, having)
                found[kind] = columns(**values)
        return found

    def _of_sensors(self, topics: list[Topic], field: Field, having: list[bool]) -> NDArray[Any] | None:
        if field.optional and not any(field.name in topic.columns for topic in topics):
            return None  # its method has no such column, or no sensor a signal
        nothing = np.full(len(self._frames), field.nothing, dtype=field.type)
        values = [self._field(topic, field) if has else nothing for topic, has in zip(topics, having, strict=True)]
        present = [value for value in values if value is not None]
        return np.stack(present, axis=1) if present else None

    def _events(self) -> Events:
        if not self._with_events:
            return Events.none()
        events = read_events(self._log).in_order(self._all)
        last = int(self._frames[-1]) if len(self._frames) else -1
        return events[: int(np.searchsorted(events.time, last, side="right"))]


def _reduced(layout: Layout, topics: Collection[str]) -> Layout:
    """Return the names behind the columns of some topics; those that columns refer to (shapes, objects) all stay."""
    joints = FRAMES in topics
    return replace(
        layout,
        links=layout.links if "/tf" in topics else (),
        joints=layout.joints if joints else (),
        joint_units=layout.joint_units if joints else (),
        pairs=layout.pairs if "/collision" in topics else (),
        guards=layout.guards if "/guards" in topics else (),
        sensors={
            kind: tuple(name for name in names if KINDS[kind].topic(name) in topics)
            for kind, names in layout.sensors.items()
        },
        signals={
            kind: tuple(name for name in names if KINDS[kind].topic(name) in topics)
            for kind, names in layout.signals.items()
        },
    )


def _stack(columns: list[Any], frames: int, *rest: int) -> Any:
    """Return columns side by side, (F, n, ...); (F, 0, ...) when there are none."""
    return np.stack(columns, axis=1) if columns else np.zeros((frames, 0, *rest))
