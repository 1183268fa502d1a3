"""`replay diff`: what differs between two recordings or two run folders."""

from __future__ import annotations

import datetime
import json
from pathlib import Path
from typing import Any

import click

FILE = click.Path(path_type=Path)


@click.command()
@click.argument("baseline", type=FILE)
@click.argument("candidate", type=FILE)
@click.option("--rules", type=FILE, help="Tolerances (YAML); without them everything must be equal.")
@click.option("--format", "format_", type=click.Choice(["text", "json"]), default="text", show_default=True)
@click.option("-v", "--verbose", is_flag=True, help="List every signal, event and rule.")
@click.option("--html", type=FILE, help="Write a page with drawings.")
@click.option("--rrd", type=FILE, help="Write a rerun recording that shows both; a folder for run folders.")
@click.option("--junit", type=FILE, help="Write a JUnit report.")
@click.option("--suggest-rules", is_flag=True, help="Print the tightest rules that would pass, to be reviewed.")
@click.option("--strict-provenance", is_flag=True, help="Other versions, models and inputs count as a difference.")
def diff(baseline: Path, candidate: Path, rules: Path | None, strict_provenance: bool, **wanted: Any) -> None:
    """Compare CANDIDATE with BASELINE by meaning: two recordings (.mcap) or two run folders.

    Exit codes: 0 the same, 1 different, 2 invalid or unreadable input.
    """
    from replay.comparison.difference import Verdict
    from replay.comparison.outputs import Outputs
    from replay.comparison.report_text import text
    from replay.comparison.rules_file import read_rules
    from replay.comparison.runs import diff_runs
    from replay.comparison.suggest import suggest

    outputs = Outputs(html=wanted["html"], junit=wanted["junit"], rrd=wanted["rrd"])
    tolerances = read_rules(rules, today=datetime.date.today()) if rules else None
    found = diff_runs(baseline, candidate, rules=tolerances, strict_provenance=strict_provenance, visit=outputs.visit)
    outputs.write(found)
    if wanted["suggest_rules"]:
        click.echo(suggest(found), nl=False)
    elif wanted["format_"] == "json":
        click.echo(json.dumps(found.as_json(), indent=1, allow_nan=False))
    else:
        click.echo(text(found, verbose=wanted["verbose"]), nl=False)
    click.get_current_context().exit(1 if found.verdict is Verdict.DIFFERENT else 0)
