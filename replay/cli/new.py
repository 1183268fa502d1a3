"""`replay new`: a first scenario, to be read and changed."""

from __future__ import annotations

from pathlib import Path

import click

from replay.cli.exit_codes import ExitCode
from replay.cli.terminal import put
from replay.cli.values import PathName


@click.command()
@click.argument("name")
@click.option("-o", "--output", type=PathName(), help="File to write; NAME.yaml when left out.")
def new(name: str, output: Path | None) -> ExitCode:
    """Write a commented scenario that runs as it is; a file that exists is never replaced."""
    from replay.errors import InvalidValue
    from replay.logs.part_file import write_file
    from replay.scenario.starter import starter

    file = output or Path(f"{name}.yaml")
    text = starter(name, str(file))
    if file.exists() or file.is_symlink():
        raise InvalidValue("NAME" if output is None else "-o", file, "exists; choose another one")
    write_file(file, text, named=True)
    put([str(file), f"next: replay run {file} -o out"])
    return ExitCode.FINE
