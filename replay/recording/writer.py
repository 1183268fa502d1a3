"""Frame blocks to an MCAP recording, block by block."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path, PurePosixPath

from replay.errors import InvalidValue
from replay.logs.mcap_records import MAGIC
from replay.logs.mcap_writer import McapFileWriter
from replay.logs.part_file import PartFile
from replay.recording import messages
from replay.recording.event_messages import TOPIC as EVENTS
from replay.recording.event_messages import encode
from replay.recording.events import EventFinder
from replay.recording.layout_message import TOPIC as LAYOUT
from replay.recording.layout_message import layout_message
from replay.recording.provenance import RECORD, Provenance
from replay.recording.scene_update import scene_message
from replay.recording.scene_view import SceneView
from replay.recording.topics import FrameTopic, frame_topics
from replay.sensing.kinds import KINDS
from replay.simulation import FrameBlock

_MEDIA_TYPES = {
    ".yaml": "application/yaml",
    ".yml": "application/yaml",
    ".csv": "text/csv",
    ".mcap": "application/x-mcap",
    ".stl": "model/stl",
    ".obj": "model/obj",
    ".ply": "model/ply",
}


class McapWriter:
    """Writes one recording: NAME.mcap.part while it grows, NAME.mcap when it is whole.

    A block becomes one chunk a topic. The bytes depend on the arguments and the blocks alone.
    """

    def __init__(
        self,
        path: str | Path,
        provenance: Provenance,
        scene: SceneView,
        files: Mapping[str, bytes],
        *,
        overwrite: bool = False,
    ) -> None:
        """Create the file.

        Args:
            path: where the whole recording will be.
            provenance: what it says about itself.
            scene: what it shows.
            files: the scenario and every file that it needs, by the names that it calls them.
            overwrite: replace a recording that exists.

        Raises:
            RecordingExistsError: it exists and may not be overwritten.
            WriteError: the file cannot be written.
        """
        self._provenance = provenance
        self._scene = scene
        self._files = files
        self._file = PartFile(Path(path), overwrite=overwrite)
        self._events = EventFinder(provenance.layout)
        self._topics: list[tuple[FrameTopic, int]] = []
        self._log: McapFileWriter | None = None
        self._event_channel = 0
        self._scene_data = b""
        self._finished = False

    def prepare(self) -> None:
        """Write what does not depend on a block, and encode the scene."""
        self._log = McapFileWriter(self._file, f"replay {self._provenance.version}")
        self._log.metadata(RECORD, self._provenance.to_metadata())
        for name, data in sorted(self._files.items()):
            ending = ".mcap" if data.startswith(MAGIC) else PurePosixPath(name).suffix.lower()
            self._log.attachment(name, _MEDIA_TYPES.get(ending, "application/octet-stream"), data)
        self._scene_data = scene_message(self._scene)
        layout = self._provenance.layout
        kinds = {
            kind: [field for field in KINDS[kind].columns.fields() if not field.optional]
            for kind, names in layout.sensors.items()
            if names
        }
        list(frame_topics(layout, collision=bool(layout.pairs), kinds=kinds))  # shapes are found here

    def write(self, block: FrameBlock) -> None:
        """Append a block; the first one decides which groups of columns the recording has."""
        if self._log is None:
            self.prepare()
        assert self._log is not None
        if not self._topics:
            self._begin(self._log, block)
        events = self._events.find(block)
        self._log.messages(
            self._event_channel,
            events.time.tolist(),
            events.frame.tolist(),
            encode(events),
        )
        for topic, channel in self._topics:
            for rows in topic.encode(block, channel):
                self._log.rows(rows)
        self._file.flush()

    def finish(self) -> None:
        """Write the rest, to the file that has no name yet; InvalidValue when no block was written."""
        if self._log is None or not self._topics:
            raise InvalidValue("blocks", 0, "a recording needs at least one frame")
        if not self._finished:
            self._log.finish()
            self._file.finish()
            self._finished = True

    def commit(self) -> None:
        """Finish the recording, unless that is done, and give the file its name; InvalidValue as of `finish`."""
        self.finish()
        self._file.commit()

    def discard(self) -> None:
        """Give the recording up and remove the unfinished file."""
        self._file.discard()

    def _begin(self, log: McapFileWriter, block: FrameBlock) -> None:
        collision = block.collision is not None
        kinds = {kind: columns.present() for kind, columns in block.readings.items()}
        topics = list(frame_topics(self._provenance.layout, collision=collision, kinds=kinds))
        types = sorted({topic.type for topic in topics} | {messages.SCENE, messages.LOG, messages.LAYOUT})
        schemas = {name: log.schema(messages.schema(name)) for name in types}
        scene = log.channel("/scene", schemas[messages.SCENE])
        names = log.channel(LAYOUT, schemas[messages.LAYOUT])
        self._event_channel = log.channel(EVENTS, schemas[messages.LOG])
        self._topics = [(topic, log.channel(topic.name, schemas[topic.type])) for topic in topics]
        log.end_preamble()
        log.messages(scene, [0], [0], [self._scene_data])
        log.messages(names, [0], [0], [layout_message(self._provenance.layout)])
