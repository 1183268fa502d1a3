"""`replay trend`: numbers over the nights of a history."""

from __future__ import annotations

from pathlib import Path

import click

from replay.cli import options
from replay.cli.exit_codes import ExitCode
from replay.cli.values import PathName


@click.command()
@click.option("--history", type=PathName(), required=True, help="File that `replay regress` appends to.")
@click.option("--metric", "metrics", multiple=True, metavar="GLOB", help="Only numbers of that name; repeatable.")
@click.option("--scenario", "scenarios", multiple=True, metavar="GLOB", help="Only scenarios of that name; repeatable.")
@click.option("--html", type=PathName(), help="Also write a page with plots over nights.")
@options.format_option
def trend(
    history: Path, metrics: tuple[str, ...], scenarios: tuple[str, ...], html: Path | None, form: str
) -> ExitCode:
    """Say how numbers such as the smallest clearance went from night to night: a table with sparklines.

    Exit codes: 2 no such file; 5 no numbers of these names.
    """
    from replay.batch.trend import as_json, page, read_trend, table
    from replay.logs.part_file import write_file

    if not history.is_file():
        raise click.UsageError(f"--history {history}: is not there; `replay regress` writes OUTPUT/history.jsonl")
    found = read_trend(history, measures=metrics, scenarios=scenarios)
    if found.curves or form == "json":
        options.say(form, lambda: table(found), lambda: as_json(found))
    if html is not None:
        write_file(html, page(found), named=True)
    if not found.curves:
        options.note(f"no numbers of these names in {len(found.times)} nights")
        return ExitCode.NOTHING
    return ExitCode.FINE
