"""`replay bench`: speed against error, our methods and installed peers in one run."""

from __future__ import annotations

import importlib
import tempfile
import time
from pathlib import Path

import click

from replay.cli.diverted import diverted_stderr, lines_of
from replay.cli.exit_codes import ExitCode
from replay.cli.options import format_option, note, say
from replay.cli.values import PathName

BENCHMARKS = (
    *("collision", "between", "distance", "capacitive", "electrostatics", "pipeline"),
    *("savings", "scaling", "stability", "recording", "diff", "start"),
)


@click.command()
@click.argument("names", nargs=-1, type=click.Choice(BENCHMARKS), metavar="[" + "|".join(BENCHMARKS) + "]...")
@click.option("--quick", is_flag=True, help="Fewer queries and rounds: a minute and a half in all.")
@click.option(
    "-o",
    "--output",
    type=PathName(),
    default=Path("recordings/bench"),
    show_default=True,
    help="Folder for bench.json, bench.html and bench.png.",
)
@format_option
def bench(names: tuple[str, ...], quick: bool, output: Path, form: str) -> ExitCode:
    """Time methods and peers on the same questions, check every answer, and say which goals are met.

    All benchmarks when none is named. Exit code 1: a goal is missed.
    """
    from replay.bench import results
    from replay.cli.bench_progress import BenchProgress

    names, before = names or BENCHMARKS, results.earlier_seconds(output)
    reports, paths = [], []
    with (
        tempfile.TemporaryFile() as said,
        diverted_stderr(said) as shown,
        BenchProgress(names, before, shown) as progress,
    ):
        for name in names:
            begin = time.perf_counter()
            reports.append(importlib.import_module(f"replay.bench.{name}").run(quick=quick))
            reports[-1].said = lines_of(said)
            reports[-1].seconds = time.perf_counter() - begin
            paths = results.write(reports, output)  # after each, so that an interruption loses none
            progress.done(reports[-1].seconds)
    note(f"wrote {', '.join(map(str, paths))}")
    say(form, lambda: results.as_text(reports).splitlines(), lambda: results.as_json(reports))
    missed = any(goal.failed for report in reports for goal in report.goals)
    return ExitCode.DIFFERENT if missed else ExitCode.FINE
