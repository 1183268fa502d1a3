"""What a recording, or any other MCAP log, holds, for people and programs: topics, counts, provenance, joints."""

from __future__ import annotations

import datetime
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from replay.errors import ForeignLogError, count
from replay.logs.joint_log import JOINT_TOPIC
from replay.logs.loss import Loss
from replay.logs.mcap_reader import McapLog
from replay.logs.overview import JointRange, TopicSummary, overview
from replay.recording.provenance import Provenance
from replay.recording.reader import FRAMES, Recording, read

_CLOCK_BEGINS = 10**18
"""Log times from here on [ns], September 2001, are taken for times of day."""


@dataclass(frozen=True)
class Summary:
    """A log at a glance.

    Attributes:
        path: the file; `bytes` its size.
        library: what wrote it, as it says.
        provenance: where a recording comes from; None for a log of another kind, as are `frames` and `lost_frames`.
        topics: sorted by name.
        frames: whole frames; the last one is at `seconds` [s].
        seconds: of another log, from its first message to its last [s].
        begin, end: first and last log time [ns]; None without messages.
        joints: the joints that can drive a motion, with the positions between which they are.
        files: size of each attached file [bytes], by name.
        loss: what a salvaged file has lost, else None; `lost_frames` are the frames among it.
    """

    path: Path
    bytes: int
    library: str
    provenance: Provenance | None
    topics: tuple[TopicSummary, ...]
    frames: int | None
    seconds: float
    begin: int | None
    end: int | None
    joints: tuple[JointRange, ...]
    files: dict[str, int]
    loss: Loss | None
    lost_frames: int | None

    @property
    def loss_text(self) -> str:
        """What is wrong with a salvaged file and what is left of it, in words; "" for a whole one."""
        if self.loss is None:
            return ""
        if self.provenance is not None and self.frames is not None:
            return self.loss.text(self.frames, self.provenance.frames)
        return f"{self.loss.reason}; {count(sum(topic.messages for topic in self.topics), 'message')} before it"

    def as_json(self) -> dict[str, Any]:
        """Return the summary as JSON values."""
        made = self.provenance
        provenance = None if made is None else asdict(made) | {"layout": asdict(made.layout)}
        return asdict(self) | {"path": str(self.path), "provenance": provenance}

    def lines(self) -> list[str]:
        """Return the summary as lines for people."""
        width = max((len(topic.topic) for topic in self.topics), default=0)
        topics = (f"  {t.topic:<{width}}  {t.messages:>7}  {t.schema or '(no schema)'}" for t in self.topics)
        head = f"{self.seconds:g} s, {self.bytes} bytes"
        made = self.provenance
        if made is None or self.frames is None:
            messages = count(sum(topic.messages for topic in self.topics), "message")
            lines = [f"{self.path}: {messages}, {head}, written by {self.library}", *self._span(), "topics", *topics]
            lines += [*self._joints(), *(["files"] if self.files else [])]
            return [*lines, *(f"  {size:>9}  {name}" for name, size in sorted(self.files.items()))]
        return [
            f"{self.path}: {made.scenario}, {count(self.frames, 'frame')}, {head}",
            "topics",
            *topics,
            "provenance",
            f"  replay {made.version}, format {made.format}, code {made.code[:16]}",
            "  model " + ", ".join(f"{key} {value}" for key, value in sorted(made.model.items())),
            "  libraries " + ", ".join(f"{name} {version}" for name, version in sorted(made.libraries.items())),
            "files",
            *(
                f"  {sha[:16]}  {self.files.get(name, 'elsewhere'):>9}  {name}"
                for name, sha in sorted(made.files.items())
            ),
        ]

    def _span(self) -> Iterator[str]:
        if self.begin is None or self.end is None:
            return
        yield f"log times {self.begin} to {self.end} ns"
        if self.begin >= _CLOCK_BEGINS:
            first, last = (datetime.datetime.fromtimestamp(ns // 10**9, datetime.UTC) for ns in (self.begin, self.end))
            yield f"  {first:%Y-%m-%d %H:%M:%S} to {last:%Y-%m-%d %H:%M:%S} UTC"

    def _joints(self) -> Iterator[str]:
        width = max((len(found.joint) for found in self.joints), default=0)
        for topic in dict.fromkeys(found.topic for found in self.joints):
            source = self.path.name if topic == JOINT_TOPIC else f"{self.path.name}, topic: {topic}"
            yield f"joints of {topic}, for motion: {{recorded: {{file: {source}}}}}"
            for found in self.joints:
                if found.topic == topic:
                    span = "nothing finite" if found.lower is None else f"{found.lower:.6g} to {found.upper:.6g}"
                    yield f"  {found.joint:<{width}}  {count(found.samples, 'sample')}, {span}"


def summarize(path: str | Path, *, salvage: bool = False) -> Summary:
    """Read a whole log, verify it, and say what it holds.

    Args:
        path: an MCAP file, of `replay` or of anyone.
        salvage: of a file that was cut or damaged, tell what comes before the damage instead of refusing it.

    Raises:
        RecordingError: the file cannot be read or is damaged (with `salvage`: so early that nothing is left of it).
    """
    try:
        recording = read(path, salvage=salvage)
    except ForeignLogError:
        recording = None
    with McapLog(path, salvage=salvage) as log:
        found = overview(log, joints=recording is None)
        files = {attachment.name: attachment.size for attachment in log.attachments}
        library, loss = log.library, log.loss
    span = 0 if found.begin is None or found.end is None else found.end - found.begin
    last = int(recording.time[-1]) if recording is not None and len(recording.time) else 0
    return Summary(
        path=Path(path),
        bytes=Path(path).stat().st_size,
        library=library,
        provenance=None if recording is None else recording.provenance,
        topics=found.topics,
        frames=None if recording is None else len(recording.time),
        seconds=(span if recording is None else last) / 1e9,
        begin=found.begin,
        end=found.end,
        joints=found.joints if recording is None else _joints(recording),
        files=files,
        loss=loss,
        lost_frames=None if recording is None else recording.lost_frames,
    )


def _joints(recording: Recording) -> tuple[JointRange, ...]:
    frames = len(recording.time)
    ranges = []
    for joint, name in enumerate(recording.layout.joints):
        positions = recording.joint_positions[:, joint]
        finite = positions[np.isfinite(positions)]
        bounds = (float(finite.min()), float(finite.max())) if len(finite) else (None, None)
        ranges.append(JointRange(FRAMES, name, frames, *bounds))
    return tuple(ranges)
