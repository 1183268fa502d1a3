"""`replay info`: say what is in a recording, or in any other MCAP log."""

from __future__ import annotations

from pathlib import Path

import click

from replay.cli.exit_codes import ExitCode
from replay.cli.options import format_option, note, say
from replay.cli.values import PathName


@click.command()
@click.argument("recording", type=PathName())
@format_option
def info(recording: Path, form: str) -> ExitCode:
    """Say what RECORDING (.mcap, or the .mcap.part of a stopped run) holds: topics, counts, provenance.

    Of any other MCAP log: topics, schemas, counts, the time that it spans, and the joints that can drive a motion.

    Every checksum of the file is verified on the way; of a cut or damaged file, what is whole is told (exit code 3).
    """
    from replay.recording.summary import summarize

    found = summarize(recording, salvage=True)
    say(form, found.lines, found.as_json)
    if found.loss is None:
        return ExitCode.FINE
    note(f"{recording}: {found.loss_text}")
    return ExitCode.LOSSES
