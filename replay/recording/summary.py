"""What a recording holds, without reading its numbers."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from pathlib import Path

from replay.errors import RecordingError
from replay.logs.mcap_reader import Loss, McapLog
from replay.recording.provenance import Provenance
from replay.recording.reader import read_provenance


@dataclass(frozen=True)
class TopicSummary:
    """One topic: its name, the name of its message type, and how many messages it has."""

    name: str
    schema: str
    messages: int


@dataclass(frozen=True)
class Summary:
    """What a recording holds.

    Attributes:
        path, size: the file and its length [bytes].
        library: what wrote it.
        provenance: where it comes from.
        topics: sorted by name.
        files: names and sizes [bytes] of the attached files.
        loss: what is missing when the file is damaged and was salvaged, else None.
        lost_frames: frames of the scenario that no topic has any more; `read` may have to leave out a few more, those
            of the last block that is not whole.
    """

    path: Path
    size: int
    library: str
    provenance: Provenance
    topics: tuple[TopicSummary, ...]
    files: tuple[tuple[str, int], ...]
    loss: Loss | None
    lost_frames: int


def summarise(path: str | Path, *, salvage: bool = False) -> Summary:
    """Return what a recording holds, its checksums verified except those of chunks that are not read.

    Args:
        path: an MCAP file that `replay` wrote.
        salvage: of a cut or damaged file, tell what is whole instead of refusing it.

    Raises:
        RecordingError: it cannot be read or is not a recording, or it is damaged (with `salvage`: from the start).
    """
    with McapLog(path, salvage=salvage) as log:
        provenance = read_provenance(log)
        counts = log.message_counts
        if counts is None or log.loss is not None:
            counts = Counter()
            for chunk in log.chunks:
                for run in log.runs(chunk):
                    counts[run.channel] += len(run.time)
        topics = sorted(
            (TopicSummary(c.topic, log.schema_name(c), counts.get(c.id, 0)) for c in log.channels.values()),
            key=lambda topic: topic.name,
        )
        frames = next((topic.messages for topic in topics if topic.name == "/joint_states"), None)
        if frames is None:
            raise RecordingError(str(path), "damaged: topic '/joint_states' is missing")
        return Summary(
            path=Path(path),
            size=Path(path).stat().st_size,
            library=log.library,
            provenance=provenance,
            topics=tuple(topics),
            files=tuple((entry.name, entry.size) for entry in log.attachments),
            loss=log.loss,
            lost_frames=provenance.frames - frames,
        )
