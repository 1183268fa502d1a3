"""Topics of any log as tables: one row a message, one column a value.

A column is named by the path of its field, such as `pose.position.x`. Joint states have columns of their joints, such
as `elbow position`; a time stamp is one column in nanoseconds. Lists of up to 64 entries have a column an entry, longer
ones are one JSON text. Of bytes up to 256 are written in hexadecimal, of more their number and SHA-256.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from replay import limits
from replay.errors import RecordingError
from replay.logs.mcap_reader import McapLog
from replay.logs.values import Values, value_decoder

TIME = "time [ns]"
"""The column of the log times."""

_MAX_ENTRIES = 64
_MAX_BYTES = 256
_STAMPS = ({"sec", "nanosec"}, {"seconds", "nanos"}, {"sec", "nsec"}, {"secs", "nsecs"})
_JOINT_FIELDS = ("position", "velocity", "effort", "acceleration")


def topic_table(log: McapLog, topic: str) -> tuple[dict[str, NDArray[Any]], str]:
    """Return the messages of a topic in the order of time, and why they are only bytes ("" when they are values).

    Returns:
        Columns by name, (n,) each; None stands where a message has no such value.

    Raises:
        RecordingError: damage.
    """
    found = sorted(_messages(log, topic), key=lambda entry: entry[0])
    log.work.decode(len(found))
    reason = ""
    try:
        decoders = {
            channel.id: value_decoder(str(log.path), channel, log.schemas.get(channel.schema_id))
            for channel in log.channels.values()
            if channel.topic == topic
        }
        columns = _columns(found, lambda channel, data: _row(decoders[channel], data))
    except RecordingError as error:
        reason = error.reason
    except Exception as error:  # each format's library fails in ways of its own on bytes that are not its messages
        reason = str(error).partition("\n")[0][:200] or type(error).__name__
    if reason:
        columns = _columns(found, lambda _, data: {"data": data})
    elif any(decoder is None for decoder in decoders.values()):
        kinds = {c.encoding or "bytes" for c in log.channels.values() if decoders.get(c.id, c) is None}
        reason = f"messages as {', '.join(sorted(kinds))} with such a schema are not decoded"
    return {name: _array(values, len(found)) for name, values in columns.items()}, reason


def _columns(found: Sequence[tuple[int, int, bytes]], row: Callable[[int, bytes], Values]) -> dict[str, list[Any]]:
    """Return the values of messages by column, as `row` takes them apart; ValueError where they are too many."""
    columns: dict[str, list[Any]] = {TIME: [time for time, _, _ in found]}
    for index, (_, channel, data) in enumerate(found):
        for name, value in _flat(row(channel, data), ""):
            column = columns.setdefault(name if name != TIME else f"message {TIME}", [])
            column.extend([None] * (index - len(column)))
            if len(column) == index:  # else two fields have one name
                column.append(value)
        if len(columns) > 2 and (len(columns) > limits.COLUMNS or len(columns) * len(found) > limits.CELLS):
            raise ValueError(f"its values make a table of more than {limits.COLUMNS} columns or {limits.CELLS} cells")
    return columns


def _messages(log: McapLog, topic: str) -> Iterator[tuple[int, int, bytes]]:
    channels = {channel.id for channel in log.channels.values() if channel.topic == topic}
    for chunk in log.chunks_with(channels):
        for run in log.runs(chunk):
            if run.channel in channels:
                for time, data in zip(run.time.tolist(), run.messages(), strict=True):
                    yield time, run.channel, data


def _row(decode: Any, data: bytes) -> Values:
    if decode is None:
        return {"data": data}
    if len(data) > limits.MESSAGE:
        raise ValueError(f"a message has {len(data)} bytes; at most {limits.MESSAGE} are taken apart")
    return _by_joint(decode(data))


def _by_joint(values: Values) -> Values:
    """Return joint states with their values under the joints' names; anything else as it is."""
    joints = values.get("joints")
    if (
        isinstance(joints, list)
        and joints
        and all(isinstance(j, dict) and isinstance(j.get("name"), str) for j in joints)
    ):
        found = {f"{j['name']} {field}": value for j in joints for field, value in j.items() if field != "name"}
        return {**{key: value for key, value in values.items() if key != "joints"}, **found}
    names = values.get("name")
    fields = [f for f in _JOINT_FIELDS if isinstance(values.get(f), list)]
    if (
        not isinstance(names, list)
        or "position" not in fields
        or any(len(values[f]) not in (0, len(names)) for f in fields)
    ):
        return values
    found = {f"{name} {field}": value for field in fields for name, value in zip(names, values[field], strict=False)}
    return {**{key: value for key, value in values.items() if key != "name" and key not in fields}, **found}


def _flat(value: Any, path: str) -> Iterator[tuple[str, Any]]:
    if isinstance(value, Mapping):
        if set(value) in _STAMPS and all(isinstance(part, int | str) for part in value.values()):
            seconds, nanoseconds = (int(value[key]) for key in sorted(value, key=lambda key: key.startswith("n")))
            yield f"{path} [ns]", seconds * 1_000_000_000 + nanoseconds
            return
        for key, part in value.items():
            yield from _flat(part, f"{path}.{key}" if path else str(key))
    elif isinstance(value, list | tuple) and len(value) <= _MAX_ENTRIES:
        for index, part in enumerate(value):
            yield from _flat(part, f"{path}[{index}]")
    elif isinstance(value, list | tuple):
        yield path, json.dumps(value, default=_shown)
    elif isinstance(value, bytes | bytearray | memoryview):
        yield path, _shown(bytes(value))
    elif value is None or isinstance(value, bool | int | float | str):
        yield path, value
    elif hasattr(value, "tolist"):
        yield from _flat(value.tolist(), path)
    else:
        yield path, str(value)


def _shown(value: Any) -> str:
    if isinstance(value, bytes):
        long = len(value) > _MAX_BYTES
        return f"{len(value)} bytes, sha256 {hashlib.sha256(value).hexdigest()}" if long else value.hex()
    return str(value)


def _array(values: list[Any], length: int) -> NDArray[Any]:
    """Return a column of one kind: numbers where all are, else texts; objects where some are missing."""
    values = [*values, *[None] * (length - len(values))]
    kinds = {type(value) for value in values if value is not None}
    if kinds <= {int} and any(value is not None and not -(2**63) <= value < 2**63 for value in values):
        kinds = {str}
    if kinds == {int, float}:
        kinds, values = {float}, [None if value is None else float(value) for value in values]
    if len(kinds) != 1 or kinds == {str}:
        values = [value if value is None or isinstance(value, str) else json.dumps(value) for value in values]
        return np.array(values, dtype=object)
    complete = all(value is not None for value in values)
    return np.array(values, dtype=kinds.pop() if complete else object)
