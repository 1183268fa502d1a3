"""`replay run`: simulate scenarios and record them."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from replay.cli import options
from replay.cli.exit_codes import ExitCode, worst

if TYPE_CHECKING:
    from replay.batch.shard import Shard


@click.command()
@options.scenarios_argument
@options.output_option("recordings")
@options.model_option
@options.select_option
@options.shard_option
@options.execution_options
@click.option("--no-rrd", is_flag=True, help="Record MCAP only.")
@click.option("--no-savings", is_flag=True, help="Compute what a scene does not need too, as a check; slow.")
@click.option("--overwrite", is_flag=True, help="Replace recordings that exist.")
@click.option("--resume", is_flag=True, help="Keep recordings whose inputs and versions are the same; run the others.")
@options.format_option
def run(
    scenarios: tuple[Path, ...],
    output: Path,
    patterns: tuple[str, ...],
    shard: Shard | None,
    no_rrd: bool,
    no_savings: bool,
    form: str,
    **how: Any,
) -> ExitCode:
    """Simulate SCENARIOS (files, folders, or recordings to run again) and record them.

    Each goes to OUTPUT/NAME/NAME.mcap and .rrd. Exit codes: 2 some are not valid, the others are run; 4 an expectation
    does not hold, or a scenario failed.
    """
    from replay.batch.claim import claim
    from replay.batch.interpreter import Ahead

    if how["overwrite"] and how["resume"]:
        raise click.UsageError("--overwrite and --resume exclude each other")
    with claim(output) as claimed, contextlib.ExitStack() as stack:
        ahead = stack.enter_context(Ahead(claimed.handles, rrd=not no_rrd)) if how["dask"] is None else None
        from replay.batch.run import run_all  # while the worker loads what it needs
        from replay.batch.select import Selection
        from replay.cli.progress import RunProgress
        from replay.cli.results import exit_code, show

        settings = options.settings(how, ahead)
        selection = Selection.of(scenarios, patterns, shard)
        options.note_left_out(scenarios)
        if not selection.chosen:
            return options.nothing(patterns, shard)
        with RunProgress() as watch:
            settings |= {name: how[name] for name in ("overwrite", "resume")} | {"failed": selection.failed}
            done = run_all(selection.chosen, output, rrd=not no_rrd, savings=not no_savings, watch=watch, **settings)
        show(form, done)
        return worst([exit_code(done), ExitCode.INVALID if selection.invalid else ExitCode.FINE])
