"""Joint states as `replay export` writes them in JSON and Parquet, to CSV, which is read as a log."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Mapping, Sequence
from typing import Any

from replay.errors import RecordingError
from replay.logs.joint_log import JOINT_TOPIC

ENDINGS = ("json", "parquet")


def as_csv(name: str, data: bytes) -> bytes:
    """Return an exported table of joint states as CSV, its numbers unchanged; RecordingError when it is none."""
    columns = _of_parquet(name, data) if data.startswith(b"PAR1") else _of_json(name, data)
    if len({len(values) for values in columns.values()}) != 1:
        raise RecordingError(name, "has columns of different lengths")
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(zip(*columns.values(), strict=True))
    return out.getvalue().encode()


def _of_parquet(name: str, data: bytes) -> Mapping[str, Sequence[Any]]:
    import pyarrow
    import pyarrow.parquet

    try:
        table: Mapping[str, Sequence[Any]] = pyarrow.parquet.read_table(pyarrow.BufferReader(data)).to_pydict()
    except (pyarrow.ArrowException, OSError) as error:
        raise RecordingError(name, f"cannot be read as Parquet: {str(error).partition(chr(10))[0]}") from None
    return table


def _of_json(name: str, data: bytes) -> Mapping[str, Sequence[Any]]:
    try:
        document = json.loads(data)
        table = document["topics"][JOINT_TOPIC]
        if not all(isinstance(values, list) for values in table.values()):
            raise TypeError
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        raise RecordingError(
            name, f"is no JSON that replay export writes: it has no topics with {JOINT_TOPIC!r}"
        ) from None
    result: Mapping[str, Sequence[Any]] = table
    return result
