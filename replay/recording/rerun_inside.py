"""All that reaches into rerun: chunks made without the library's checks, and blueprints sent as chunks.

None of this is public in rerun, so it holds for the versions it was tried with, `TRIED`. With another version, or when
a name that it needs is gone, `available` is false: chunks are made and blueprints sent by the library's public
functions. What is recorded is the same; a chunk takes 10 us longer, a blueprint 3 ms, and a process grows by 1.4 MiB
with each recording. When a version is added: run the tests and `replay bench recording` with it.
"""

from __future__ import annotations

import functools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from replay.numerics.remarks import remark

TRIED = ("0.41.",)
"""Beginnings of the versions of rerun whose inner side is known."""


@functools.cache
def available() -> bool:
    """Return whether this rerun is one whose inner side is known; where it is not, that is said."""
    import rerun as rr

    found = rr.__version__.startswith(TRIED) and _has_what_is_needed()
    if not found:
        remark(
            f"rerun {rr.__version__} is not known from within ({TRIED[0]}x is): .rrd files are the same, made slower"
        )
    return found


def made(path: str, index: dict[str, Any], columns: Iterable[tuple[Any, Any]]) -> Any:
    """Return the chunk of an entity.

    Args:
        path: of the entity.
        index: times as arrow arrays by timeline; without any, the chunk has one row that holds at all times.
        columns: pairs of a component's descriptor and its values, an arrow array with a list a row.
    """
    from rerun.chunk import Chunk

    if not available():
        times = [_PublicTimes(name, values) for name, values in index.items()]
        return Chunk.from_columns(path, times, [_column(descriptor, lists) for descriptor, lists in columns])
    from rerun_bindings import ChunkInternal

    return Chunk(ChunkInternal.from_columns(path, index, dict(columns)))


def send_blueprint(stream: Any, blueprint: Any) -> None:
    """Send a blueprint to a rerun.RecordingStream, and let go of the stream that the library makes for it."""
    if not available():
        stream.send_blueprint(blueprint)
        return
    noted = _Noted(blueprint)
    stream.send_blueprint(noted)
    noted.stream.disconnect()


def parts_of(blueprint: Any) -> list[tuple[str, Any]]:
    """Return what a blueprint of the library consists of: paths and archetypes."""
    parts = _Parts()
    blueprint._log_to_stream(parts)
    return parts.found


class ChunkBlueprint:
    """A blueprint that is chunks already, as `send_blueprint` takes it."""

    def __init__(self, chunks: Sequence[Any]) -> None:
        self._chunks = chunks

    def to_blueprint(self) -> ChunkBlueprint:
        """Return this."""
        return self

    def _log_to_stream(self, stream: Any) -> None:
        stream.send_chunks(self._chunks)


class _Parts:
    """Takes what a blueprint logs."""

    def __init__(self) -> None:
        self.found: list[tuple[str, Any]] = []

    def log(self, path: str, archetype: Any) -> None:
        self.found.append((path, archetype))


class _Noted:
    """A blueprint that knows which stream the library makes for it: until that is disconnected it holds itself."""

    def __init__(self, blueprint: Any) -> None:
        self._blueprint = blueprint
        self.stream: Any = None

    def to_blueprint(self) -> _Noted:
        return self

    def _log_to_stream(self, stream: Any) -> None:
        self.stream = stream
        self._blueprint.to_blueprint()._log_to_stream(stream)


@dataclass(frozen=True)
class _PublicTimes:
    """Times of rows as the library's public functions take them."""

    name: str
    values: Any

    def timeline_name(self) -> str:
        return self.name

    def as_arrow_array(self) -> Any:
        return self.values


@dataclass(frozen=True)
class _PublicBatch:
    """Values of a component as the library's public functions take them."""

    values: Any

    def as_arrow_array(self) -> Any:
        return self.values


def _column(descriptor: Any, lists: Any) -> Any:
    import rerun as rr

    return rr.ComponentColumn(descriptor, _PublicBatch(lists.values), offsets=lists.offsets.to_numpy())


def _has_what_is_needed() -> bool:
    try:
        from rerun.blueprint import Blueprint
        from rerun_bindings import ChunkInternal
    except ImportError:
        return False
    return hasattr(ChunkInternal, "from_columns") and hasattr(Blueprint, "_log_to_stream")
