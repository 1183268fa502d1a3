"""Joint states as `replay export` writes them in JSON and Parquet, to CSV, which is read as a log."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from typing import Any

from typing_extensions import TypedDict

from replay import limits
from replay.errors import RecordingError
from replay.json_text import read_json, typed
from replay.logs.joint_log import JOINT_TOPIC

ENDINGS = ("json", "parquet")


class _Document(TypedDict):
    topics: dict[str, dict[str, list[str | int | float | bool | None]]]


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
        file = pyarrow.parquet.ParquetFile(pyarrow.BufferReader(data))
        schema = file.schema_arrow
        # of one to eight bytes a value, so that the number of cells bounds what a small file unpacks to
        columns = [field.name for field in schema if _is_number(field.type)]
        rows = file.metadata.num_rows
        if len(columns) > limits.COLUMNS or rows * max(len(columns), 1) > limits.CELLS:
            raise RecordingError(name, f"has {rows} rows of {len(columns)} numbers; at most {limits.CELLS} are read")
        table: Mapping[str, Sequence[Any]] = file.read(columns=columns).to_pydict()
    except (pyarrow.ArrowException, OSError, ValueError, OverflowError) as error:
        reason = str(error).partition("\n")[0][:200]
        raise RecordingError(name, f"cannot be read as Parquet: {reason}") from None
    return table


def _is_number(kind: Any) -> bool:
    import pyarrow.types

    return bool(pyarrow.types.is_integer(kind) or pyarrow.types.is_floating(kind) or pyarrow.types.is_boolean(kind))


def _of_json(name: str, data: bytes) -> Mapping[str, Sequence[Any]]:
    try:
        table = typed(read_json(data), _Document)["topics"][JOINT_TOPIC]
    except (ValueError, KeyError) as error:
        reason = f": {error}" if isinstance(error, ValueError) else ""
        rule = f"it has no topics with {JOINT_TOPIC!r}{reason}"
        raise RecordingError(name, f"is no JSON that replay export writes: {rule}") from None
    if len(table) > limits.COLUMNS or sum(map(len, table.values())) > limits.CELLS:
        raise RecordingError(name, f"has more than {limits.COLUMNS} columns or {limits.CELLS} cells")
    return table
