"""What a recording holds, for people and programs: topics, counts, provenance, events."""

from __future__ import annotations

from collections import Counter
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from replay.errors import count
from replay.logs.loss import Loss
from replay.logs.mcap_reader import McapLog
from replay.recording.provenance import Provenance
from replay.recording.reader import read


@dataclass(frozen=True)
class TopicSummary:
    """A topic: the name of its schema, and how many messages it has."""

    topic: str
    schema: str
    messages: int


@dataclass(frozen=True)
class Summary:
    """A recording at a glance.

    Attributes:
        path: the file; `bytes` its size.
        provenance: where it comes from.
        topics: sorted by name.
        frames: whole frames; the last one is at `seconds` [s].
        files: size of each attached file [bytes], by name.
        loss: what a salvaged file has lost, else None; `lost_frames` are the frames among it.
    """

    path: Path
    bytes: int
    provenance: Provenance
    topics: tuple[TopicSummary, ...]
    frames: int
    seconds: float
    files: dict[str, int]
    loss: Loss | None
    lost_frames: int

    def as_json(self) -> dict[str, Any]:
        """Return the summary as JSON values."""
        provenance = asdict(self.provenance)
        return asdict(self) | {
            "path": str(self.path),
            "provenance": provenance | {"layout": asdict(self.provenance.layout)},
        }

    def as_text(self) -> str:
        """Return the summary as lines for people."""
        made, width = self.provenance, max(len(topic.topic) for topic in self.topics)
        lines = [
            f"{self.path}: {made.scenario}, {count(self.frames, 'frame')}, {self.seconds:g} s, {self.bytes} bytes",
            "topics",
            *(f"  {topic.topic:<{width}}  {topic.messages:>7}  {topic.schema}" for topic in self.topics),
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
        return "\n".join(lines)


def summarize(path: str | Path, *, salvage: bool = False) -> Summary:
    """Read a whole recording, verify it, and say what it holds; arguments and errors as of `recording.reader.read`."""
    recording = read(path, salvage=salvage)
    with McapLog(path, salvage=salvage) as log:
        counts: Counter[int] = Counter()
        for chunk in log.chunks:
            for run in log.runs(chunk):
                counts[run.channel] += len(run.time)
        topics = [
            TopicSummary(channel.topic, log.schema_name(channel), counts[channel.id])
            for channel in log.channels.values()
        ]
    return Summary(
        path=Path(path),
        bytes=Path(path).stat().st_size,
        provenance=recording.provenance,
        topics=tuple(sorted(topics, key=lambda topic: topic.topic)),
        frames=len(recording.time),
        seconds=float(recording.time[-1]) * 1e-9 if len(recording.time) else 0.0,
        files={name: len(data) for name, data in recording.files.items()},
        loss=recording.loss,
        lost_frames=recording.lost_frames,
    )
