"""`replay merge`: parts of a night as one."""

from __future__ import annotations

from pathlib import Path

import click

from replay.cli.exit_codes import ExitCode
from replay.cli.values import PathName


@click.command()
@click.argument("rundirs", nargs=-1, required=True, type=PathName())
@click.option("-o", "--output", type=PathName(), required=True, help="Run folder of the whole night; a new one.")
@click.option("--history", type=PathName(), help="File that each night appends to; OUTPUT/history.jsonl when left out.")
def merge(rundirs: tuple[Path, ...], output: Path, history: Path | None) -> ExitCode:
    """Put the run folders of `replay regress --shard i/n` into one, with reports over all of them.

    Exit codes are those of `replay regress`, of all scenarios.
    """
    from replay.batch.claim import claim
    from replay.batch.history import check_history
    from replay.batch.merge import merge as merged
    from replay.cli.results import report

    check_history(history)
    found = merged(rundirs, output)
    with claim(output):
        return report(found, history=history)
