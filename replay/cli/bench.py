"""`replay bench`: speed against error, our methods and installed peers in one run."""

from __future__ import annotations

import importlib
from pathlib import Path

import click

from replay.cli.exit_codes import ExitCode
from replay.cli.options import format_option, note, say

BENCHMARKS = ("collision", "distance", "capacitive", "pipeline", "stability")


@click.command()
@click.argument("names", nargs=-1, type=click.Choice(BENCHMARKS), metavar="[" + "|".join(BENCHMARKS) + "]...")
@click.option("--quick", is_flag=True, help="Fewer queries and rounds: about a minute each.")
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    default=Path("recordings/bench"),
    show_default=True,
    help="Folder for NAME.json and NAME.html.",
)
@format_option
def bench(names: tuple[str, ...], quick: bool, output: Path, form: str) -> ExitCode:
    """Time methods and peers on the same questions, check every answer, and say which goals are met.

    All benchmarks when none is named. Exit code 1: a goal is missed.
    """
    from replay.bench.report import Report

    reports: list[Report] = []
    for name in names or BENCHMARKS:
        note(f"bench {name} ...")
        report: Report = importlib.import_module(f"replay.bench.{name}").run(quick=quick)
        for path in report.write(output):
            note(f"wrote {path}")
        reports.append(report)
    say(
        form,
        lambda: "\n\n".join(report.as_text() for report in reports),
        lambda: [report.as_json() for report in reports],
    )
    missed = any(goal.verdict == "missed" for report in reports for goal in report.goals)
    return ExitCode.DIFFERENT if missed else ExitCode.FINE
