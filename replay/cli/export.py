"""`replay export`: write a log's topics as tables."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from replay.cli.exit_codes import ExitCode
from replay.cli.options import note
from replay.cli.terminal import put
from replay.cli.values import PathName

if TYPE_CHECKING:
    from replay.recording.export import Format


@click.command()
@click.argument("recording", type=PathName())
@click.option(
    "--format", "form", type=click.Choice(["csv", "json", "parquet"]), required=True, help="Form of the files."
)
@click.option("-o", "--output", type=PathName(), help="Folder for the files; the recording's own when left out.")
@click.option("--topic", "topics", multiple=True, metavar="GLOB", help="Only topics that match; repeatable.")
@click.option("--overwrite", is_flag=True, help="Replace files that exist.")
def export(recording: Path, form: Format, output: Path | None, topics: tuple[str, ...], overwrite: bool) -> ExitCode:
    """Write topics of RECORDING (.mcap, or the .mcap.part of a stopped run) as csv, json or parquet.

    Any other MCAP log will do: protobuf, JSON and ROS 2 messages become columns. Of a cut or damaged file, what is
    whole is written (exit code 3).
    """
    from replay.errors import ForeignLogError
    from replay.logs.mcap_reader import McapLog
    from replay.recording.export import export as write
    from replay.recording.reader import read

    how: Any = {"format": form, "topics": topics or ("*",), "overwrite": overwrite, "tell": note}
    try:
        found = read(recording, salvage=True)
        files, lost = write(found, output or recording.parent, **how), found.loss_text
    except ForeignLogError:
        with McapLog(recording, salvage=True) as log:
            files = write(log, output or recording.parent, **how)
            lost = log.loss.reason if log.loss is not None else ""
    if files:
        put(map(str, files))
    if not lost:
        return ExitCode.FINE
    note(f"{recording}: {lost}")
    return ExitCode.LOSSES
