"""Recordings, and logs of others, as tables: CSV, JSON or Parquet, with the unit in each column's name.

Numbers keep all their digits. What is not a number stays so: `nan`, `inf` and `-inf` in CSV, the texts "NaN",
"Infinity" and "-Infinity" in JSON (as in protobuf's JSON), NaN and infinities in Parquet.
"""

from __future__ import annotations

import functools
import json
import os
import re
from collections import Counter
from collections.abc import Callable, Collection, Mapping
from pathlib import Path
from typing import Any, Literal

import numpy as np

from replay import limits
from replay.errors import InvalidValue, LimitError
from replay.language.globs import fits
from replay.logs.mcap_reader import McapLog
from replay.logs.part_file import write_file
from replay.logs.tables import topic_table
from replay.numerics.arrays import Column
from replay.numerics.columns import Field
from replay.recording.provenance import RECORD
from replay.recording.reader import Recording
from replay.recording.topics import world_frame
from replay.sensing.kinds import KINDS
from replay.simulation import Layout

Table = dict[str, Column]
Format = Literal["csv", "json", "parquet"]

FORMATS: tuple[Format, ...] = ("csv", "json", "parquet")

_NAME_BYTES = 200  # file systems take names of 255 bytes; a number, an ending and ".part" are added
_TOPIC_LETTERS = 20  # of a topic's that are kept whatever the recording is called


def tables(recording: Recording) -> dict[str, Table]:
    """Return a recording as one table a topic: columns by name, the unit in brackets, of equal length (F,)."""
    time: Table = {"time [ns]": recording.time}
    layout = recording.layout
    result: dict[str, Table] = {"/joint_states": dict(time), "/tf": dict(time)}
    for joint, (name, unit) in enumerate(zip(layout.joints, layout.joint_units, strict=True)):
        result["/joint_states"][f"{name} position [{unit}]"] = recording.joint_positions[:, joint]
        result["/joint_states"][f"{name} velocity [{unit}/s]"] = recording.joint_velocities[:, joint]
    world = world_frame(layout)
    for link, name in enumerate(layout.links):
        place = f"{name} in {world}"
        _vector(result["/tf"], place, " [m]", recording.link_poses[:, link, :3, 3], "xyz")
        _vector(result["/tf"], f"{place} quat", "", recording.link_quaternions[:, link], "xyzw")
    if recording.collision is not None:
        result["/collision"] = dict(time)
        for pair, name in enumerate(layout.pairs):
            for field in recording.collision.present():
                values = getattr(recording.collision, field.name)[:, pair]
                _add(result["/collision"], f"{name} {field.label}", field, values, layout)
    if recording.guards is not None:
        result["/guards"] = dict(time)
        for field in recording.guards.fields():
            for k, name in enumerate(getattr(layout, field.each)):
                values = getattr(recording.guards, field.name)[:, k]
                _add(result["/guards"], f"{name} {field.label}", field, values, layout)
    for kind, columns in recording.readings.items():
        for sensor, name in enumerate(layout.sensors[kind]):
            table = result[KINDS[kind].topic(name)] = dict(time)
            for field in columns.present():
                if not layout.has(kind, name, field):
                    continue
                values = getattr(columns, field.name)[:, sensor]
                for k, each in enumerate(getattr(layout, field.each) if field.each else ()):
                    _add(table, f"{each} {field.label}", field, values[:, k], layout)
                if not field.each:
                    _add(table, field.label, field, values, layout)
    events = recording.events.columns()
    result["/events"] = {f"{name} [ns]" if name in ("time", "earliest") else name: events[name] for name in events}
    return result


def export(
    recording: Recording | McapLog,
    directory: str | Path,
    *,
    format: Format,
    topics: Collection[str] = ("*",),
    overwrite: bool = False,
    tell: Callable[[str], object] = str,
) -> tuple[Path, ...]:
    """Write topics of a recording, or of any other log, into a directory.

    Args:
        recording: what `read` returned; or a log of others, whose topics become tables as of `logs.tables`.
        directory: where; made when it is not there.
        format: "csv" and "parquet" give a file a topic, NAME.TOPIC.csv; "json" gives one file, NAME.json.
        topics: globs on topic names, such as "/distance/*".
        overwrite: replace files that exist.
        tell: is called with what a reader of the tables should know: topics whose messages are bytes to `replay`.

    Returns:
        The files written.

    Raises:
        InvalidValue: an unknown format, or a glob that matches no topic.
        RecordingExistsError: a file exists and may not be overwritten.
        WriteError: a file cannot be written.
    """
    if format not in FORMATS:
        raise InvalidValue("format", format, f"must be one of {', '.join(FORMATS)}")
    sources = _sources(recording, tell)
    if not sources:
        tell(f"{recording.path}: has no topics")
    for pattern in topics if sources else ():
        if not any(fits(topic, pattern) for topic in sources):
            raise InvalidValue("topic", pattern, f"matches none of {', '.join(sorted(sources))}")
    chosen = [topic for topic in sorted(sources) if any(fits(topic, pattern) for pattern in topics)]
    if isinstance(recording, McapLog) and len(chosen) * recording.work.unpacked > limits.passes(recording.size):
        rule = f"has {len(chosen)} topics to be looked for in {recording.work.unpacked} bytes; choose some with --topic"
        raise LimitError(str(recording.path), rule)
    directory = Path(directory)
    stem = recording.path.name.removesuffix(".part").removesuffix(".mcap")
    if format == "json":
        document = _json(recording, {topic: sources[topic]() for topic in chosen})
        return (write_file(directory / f"{stem}.json", document, overwrite=overwrite),)
    names = _file_names(stem, sorted(sources), format)
    encode = _csv if format == "csv" else _parquet
    return tuple(
        write_file(directory / names[topic], encode(recording, sources[topic]()), overwrite=overwrite)
        for topic in chosen
    )


def _sources(recording: Recording | McapLog, tell: Callable[[str], object]) -> dict[str, Callable[[], Table]]:
    """Return what makes the table of each topic: of a log of others, no two are in memory at once."""
    if not isinstance(recording, McapLog):
        return {topic: functools.partial(dict, table) for topic, table in tables(recording).items()}
    log = recording

    def table(topic: str) -> Table:
        found, reason = topic_table(log, topic)
        if reason:
            tell(f"{log.path}: topic {topic!r} is written as bytes: {reason}")
        return found

    return {topic: functools.partial(table, topic) for topic in {channel.topic for channel in log.channels.values()}}


def _add(table: Table, label: str, field: Field, values: Column, layout: Layout) -> None:
    """Add a field (F,) or (F, letters) to a table: states by their names, what counts names by these."""
    unit = f" [{field.unit}]" if field.unit else ""
    if field.letters:
        _vector(table, label, unit, values, field.letters)
        return
    if field.states is not None:
        values = np.array([state.name.lower() for state in field.states])[values]
    if field.names:
        values = np.array([*getattr(layout, field.names), ""])[values]  # the last one, index -1, while there is nothing
    table[f"{label}{unit}"] = values


def _vector(table: Table, name: str, unit: str, values: Column, letters: str) -> None:
    for axis, letter in enumerate(letters):
        table[f"{name} {letter}{unit}"] = values[:, axis]


def _file_names(stem: str, topics: Collection[str], extension: str) -> dict[str, str]:
    """Return a file name for each topic: letters that a path may not have are replaced, names stay different.

    They differ in more than upper and lower case, which some file systems take for the same, and fit file systems. All
    topics of a recording are named together, so that a topic has the same file whichever others are wanted.
    """
    names: dict[str, str] = {}
    taken: set[str] = set()
    numbers: Counter[str] = Counter()
    room = max(_NAME_BYTES - len(os.fsencode(stem)), _TOPIC_LETTERS)
    for topic in topics:
        base = f"{stem}.{re.sub(r'[^A-Za-z0-9_-]+', '_', topic).strip('_')[:room]}"
        key = base.casefold()
        name = f"{base}.{extension}"
        while name.casefold() in taken:
            numbers[key] += 1
            name = f"{base}_{numbers[key] + 1}.{extension}"
        taken.add(name.casefold())
        names[topic] = name
    return names


def _arrow(recording: Recording | McapLog, table: Mapping[str, Column]) -> Any:
    import pyarrow

    metadata = {}
    if isinstance(recording, Recording):
        metadata = {RECORD: json.dumps(recording.provenance.to_metadata(), sort_keys=True)}
    columns = {name: pyarrow.array(np.ascontiguousarray(values)) for name, values in table.items()}
    return pyarrow.table(columns, metadata=metadata)


def _csv(recording: Recording | McapLog, table: Mapping[str, Column]) -> bytes:
    import pyarrow
    import pyarrow.csv

    sink = pyarrow.BufferOutputStream()
    pyarrow.csv.write_csv(_arrow(recording, table), sink)
    data: bytes = sink.getvalue().to_pybytes()
    return data


def _parquet(recording: Recording | McapLog, table: Mapping[str, Column]) -> bytes:
    import pyarrow
    import pyarrow.parquet

    sink = pyarrow.BufferOutputStream()
    pyarrow.parquet.write_table(_arrow(recording, table), sink)
    data: bytes = sink.getvalue().to_pybytes()
    return data


def _json(recording: Recording | McapLog, chosen: Mapping[str, Table]) -> bytes:
    provenance = lost = None
    if isinstance(recording, Recording):
        provenance = {key: json.loads(value) for key, value in recording.provenance.to_metadata().items()}
        lost = recording.lost_frames
    topics = {
        topic: {name: [_plain(value) for value in values.tolist()] for name, values in table.items()}
        for topic, table in chosen.items()
    }
    document = {"provenance": provenance, "lost_frames": lost, "topics": topics}
    return json.dumps(document, ensure_ascii=False, allow_nan=False, indent=1).encode()


def _plain(value: Any) -> Any:
    if isinstance(value, float) and not np.isfinite(value):
        return "NaN" if np.isnan(value) else ("Infinity" if value > 0 else "-Infinity")
    return value
