"""`replay run`: simulate scenarios and record them."""

from __future__ import annotations

from pathlib import Path

import click

from replay.cli.exit_codes import ExitCode
from replay.cli.options import format_option, note, say, scenarios_argument, select_option


@click.command()
@scenarios_argument
@click.option(
    "-o", "--output", type=click.Path(path_type=Path), default=Path("recordings"), show_default=True, help="Run folder."
)
@click.option("--model", metavar="FILE|NAME", help="Compute with this model instead of the scenarios' own.")
@select_option
@click.option("--no-rrd", is_flag=True, help="Record MCAP only.")
@click.option("--overwrite", is_flag=True, help="Replace recordings that exist.")
@format_option
def run(
    scenarios: tuple[Path, ...],
    output: Path,
    model: str | None,
    patterns: tuple[str, ...],
    no_rrd: bool,
    overwrite: bool,
    form: str,
) -> ExitCode:
    """Simulate SCENARIOS (files, folders, or recordings to run again) and record them.

    Each goes to OUTPUT/NAME/NAME.mcap and .rrd; an expectation that does not hold is exit code 4.
    """
    from replay.batch.run import report, run_all
    from replay.batch.select import load_all, select
    from replay.cli.progress import RunProgress
    from replay.numerics.jit import is_cache_empty
    from replay.scenario.load import load_model

    version = load_model(model) if model else None
    chosen = select(load_all(scenarios), patterns)
    if not chosen:
        note(f"nothing selected by {', '.join(patterns)}")
        return ExitCode.NOTHING
    if is_cache_empty():
        note("compiling kernels; this takes about a minute, once")
    with RunProgress() as progress:
        results = run_all(
            chosen,
            output,
            model=version,
            rrd=not no_rrd,
            overwrite=overwrite,
            progress=lambda scenario: progress.follow(scenario.name, scenario.frames),
        )
    lines = [line for result in results for line in report(result)]
    say(form, lambda: "\n".join(lines), lambda: [result.as_json() for result in results])
    return ExitCode.FINE if all(result.status == "passed" for result in results) else ExitCode.FAILED
