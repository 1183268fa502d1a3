"""`replay diff`: what differs between two recordings or two run folders."""

from __future__ import annotations

import datetime
from pathlib import Path

import click

from replay.cli.exit_codes import ExitCode
from replay.cli.options import format_option, say
from replay.cli.terminal import put
from replay.cli.values import PathName

FILE = PathName()


@click.command()
@click.argument("baseline", type=FILE)
@click.argument("candidate", type=FILE)
@click.option("--rules", type=FILE, help="Tolerances (YAML); without them everything must be equal.")
@format_option
@click.option("-v", "--verbose", is_flag=True, help="List every signal, event and rule.")
@click.option("--html", type=FILE, help="Write a page with drawings.")
@click.option("--rrd", type=FILE, help="Write a rerun recording that shows both; a folder for run folders.")
@click.option("--junit", type=FILE, help="Write a JUnit report.")
@click.option("--suggest-rules", "suggested", is_flag=True, help="Print the tightest rules that would pass.")
@click.option("--strict-provenance", is_flag=True, help="Other versions, models and inputs count as a difference.")
def diff(
    baseline: Path,
    candidate: Path,
    rules: Path | None,
    form: str,
    verbose: bool,
    html: Path | None,
    rrd: Path | None,
    junit: Path | None,
    suggested: bool,
    strict_provenance: bool,
) -> ExitCode:
    """Compare CANDIDATE with BASELINE by meaning: two recordings (.mcap) or two run folders.

    Exit codes: 0 the same, 1 different, 2 invalid or unreadable input.
    """
    from replay.comparison.difference import DiffVerdict
    from replay.comparison.outputs import Outputs
    from replay.comparison.report_text import lines
    from replay.comparison.rules_file import read_rules
    from replay.comparison.runs import diff_runs
    from replay.comparison.suggest import suggest

    outputs = Outputs(html=html, junit=junit, rrd=rrd)
    tolerances = read_rules(rules, today=datetime.date.today()) if rules else None
    found = diff_runs(baseline, candidate, rules=tolerances, strict_provenance=strict_provenance, visit=outputs.visit)
    outputs.write(found)
    if suggested:
        put(suggest(found).splitlines())
    else:
        say(form, lambda: lines(found, verbose=verbose), found.as_json)
    codes = {DiffVerdict.DIFFERENT: ExitCode.DIFFERENT, DiffVerdict.UNREADABLE: ExitCode.INVALID}
    return codes.get(found.verdict, ExitCode.FINE)
