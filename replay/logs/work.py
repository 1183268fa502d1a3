"""What reading a log costs, counted while it is read, so that a small file cannot ask for much."""

from __future__ import annotations

from replay import limits
from replay.errors import LimitError


class Work:
    """The records of a log and the bytes that its chunks unpack to, held against the bounds for its size.

    Attributes:
        most_records: that it may have.
        unpacked: bytes that the chunks found so far claim to unpack to.
    """

    def __init__(self, file: str, size: int) -> None:
        self.most_records = limits.records(size)
        self.unpacked = 0
        self._file = file
        self._most_bytes = limits.unpacked(size)
        self._most_loose = limits.loose_records(size)
        self._loose = 0
        self._records = 0
        self._decoded, self._most_decoded = 0, limits.decoded(size)
        self._in_chunks: dict[int, int] = {}
        self._definitions = 0

    def record(self) -> None:
        """Count a record outside chunks; LimitError when there are too many."""
        self._loose += 1
        if self._loose > self._most_loose:
            rule = f"holds more than {self._most_loose} records outside chunks"
            raise LimitError(self._file, f"{rule}, the most that are read of a file of its size")

    def records_of(self, chunk: int, number: int) -> None:
        """Count the records in the chunk that begins at a byte, once however often it is read."""
        self._records += number - self._in_chunks.get(chunk, 0)
        self._in_chunks[chunk] = number
        if self._records > self.most_records:
            self._too_many()

    def unpack(self, size: int) -> None:
        """Count a chunk; LimitError when all together unpack to too much."""
        self.unpacked += size
        if self.unpacked > self._most_bytes:
            rule = f"{self._most_bytes} bytes, the most that is read of a file of its size"
            raise LimitError(self._file, f"unpacks to more than {rule}")

    def decode(self, messages: int) -> None:
        """Count messages that are taken apart one by one; LimitError when they are too many."""
        self._decoded += messages
        if self._decoded > self._most_decoded:
            rule = f"holds more than {self._most_decoded} messages to be taken apart"
            raise LimitError(self._file, f"{rule}, the most of a file of its size")

    def define(self, size: int, channels: int) -> None:
        """Count a schema, a channel or metadata that was not there before."""
        self._definitions += size
        if self._definitions > limits.DEFINITIONS:
            raise LimitError(
                self._file, f"has schemas, channels and metadata of more than {limits.DEFINITIONS} bytes together"
            )
        if channels > limits.CHANNELS:
            raise LimitError(self._file, f"has more than {limits.CHANNELS} channels or schemas")

    def _too_many(self) -> None:
        raise LimitError(
            self._file, f"holds more than {self.most_records} records, the most that are read of a file of its size"
        )
