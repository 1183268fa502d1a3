"""The file of a log that a scenario names: opened by what it holds, with options that have no effect refused."""

from __future__ import annotations

import contextlib
import hashlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from replay.errors import RecordingError
from replay.language.node import KeyPath
from replay.language.units import TIME
from replay.logs.csv_table import Format, is_excerpt
from replay.logs.exported import ENDINGS, as_csv
from replay.logs.message_log import MessageLog, is_message_log, open_bag_folder, open_message_log
from replay.scenario.motion import TimeColumnPart
from replay.scenario.recorded_series import Unusable
from replay.scenario.source import Library, SourceRule

_TABLES = ("csv", "tsv")
_UNITS = {unit: factor * 10**9 for unit, factor in TIME.units.items()}


@dataclass(frozen=True, eq=False)
class LogFile:
    """An opened log.

    Attributes:
        shown: what messages call it.
        sha256: of its file, or of the list of files of its folder.
        messages: a log of messages, or None: then `table` is one, in CSV.
    """

    shown: str
    sha256: str
    messages: MessageLog | None
    table: bytes = b""


def open_log(
    library: Library, name: str, path: KeyPath, *, of_tables: Mapping[str, object], of_messages: Mapping[str, object]
) -> LogFile:
    """Return the log of a name in a library.

    Args:
        library: where files are.
        name: of the log in it: a file, or a ROS 2 bag's folder.
        path: of the part of the language that names it as `file`.
        of_tables, of_messages: options that are written, and have an effect with one of the two only; what is None or
            empty is not written.

    Raises:
        Unusable: it cannot be read, is no log, or an option has no effect with it.
    """
    shown = library.shown(name)
    try:
        data = library.read(name)
    except SourceRule as error:
        return _open_folder(library, name, path, of_tables, error)
    kind = name.rpartition(".")[2].lower()
    messages = is_message_log(data) or kind in ("mcap", "bag", "db3")
    if not messages and kind not in (*_TABLES, *ENDINGS):
        raise Unusable((*path, "file"), "is neither a .mcap nor a .csv file, nor a ROS bag (.bag, .db3, its folder)")
    for option, value in (of_tables if messages else of_messages).items():
        if value not in (None, {}):
            more = ", whose messages carry their times" if option == "time" else ""
            raise Unusable((*path, option), f"has no effect with a .{kind} file{more}")
    digest = hashlib.sha256(data).hexdigest()
    with reading(path):
        if messages:
            return LogFile(shown, digest, open_message_log(shown, data))
        table = as_csv(shown, data) if kind in ENDINGS and not is_excerpt(data) else data
        return LogFile(shown, digest, None, table)


def _open_folder(
    library: Library, name: str, path: KeyPath, of_tables: Mapping[str, object], error: SourceRule
) -> LogFile:
    shown = library.shown(name)

    def read(file: str) -> bytes:
        try:
            return library.read(f"{name}/{file}")
        except SourceRule as wrong:
            raise RecordingError(shown, f"names the file {file!r}, which {wrong}") from None

    try:
        library.read(f"{name}/metadata.yaml")
    except SourceRule:
        raise Unusable((*path, "file"), str(error)) from None
    for option, value in of_tables.items():
        if value is not None:
            raise Unusable((*path, option), "has no effect with a bag, whose messages carry their times")

    with reading(path):
        log, files = open_bag_folder(shown, read)
    listed = "".join(f"{hashlib.sha256(data).hexdigest()}  {file}\n" for file, data in sorted(files.items()))
    return LogFile(shown, hashlib.sha256(listed.encode()).hexdigest(), log)


@contextlib.contextmanager
def reading(path: KeyPath) -> Iterator[None]:
    """Tell what is wrong with a log's file, in a `with` block, as the rule of the key that names it."""
    try:
        yield
    except RecordingError as error:
        raise Unusable((*path, "file"), error.reason) from None


def csv_format(time: TimeColumnPart | None, separator: str | None, decimal: str | None) -> Format:
    """Return how a log in CSV is written, as a scenario says it."""
    column, unit = (time.column, time.unit) if time else (None, None)
    return Format(column, unit, _UNITS, separator, decimal)
