"""`replay regress`: run scenarios and compare each with its baseline."""

from __future__ import annotations

import datetime
from pathlib import Path
from typing import Any

import click

from replay.cli import options
from replay.cli.exit_codes import ExitCode
from replay.cli.values import PathName, RrdOf

MISSING: Any = {"type": click.Choice(["fail", "create", "skip"]), "default": "fail", "show_default": True}
RRD: Any = {"type": RrdOf(), "default": "failing", "show_default": True, "metavar": "failing[:N]|all|none"}


@click.command()
@options.scenarios_argument
@click.option("--baseline", type=PathName(), required=True, help="Folder of accepted recordings; see `replay accept`.")
@options.output_option("regress")
@click.option("--rules", type=PathName(), help="Tolerances; rules.yaml beside SCENARIOS when left out.")
@click.option("--missing-baseline", "missing", **MISSING, help="What a scenario without one is.")
@click.option("--rrd", **RRD, help="Scenarios to record for eyes; failing:20 are the worst 20.")
@click.option("--pictures", type=click.IntRange(0, 100), default=0, metavar="N", help="Render the N worst moments.")
@click.option("--history", type=PathName(), help="File that each night appends to; OUTPUT/history.jsonl when left out.")
@click.option("--resume", is_flag=True, help="Carry on a night that was cut: keep results that are up to date.")
@options.model_option
@options.select_option
@options.shard_option
@options.execution_options
def regress(
    scenarios: tuple[Path, ...],
    baseline: Path,
    output: Path,
    rules: Path | None,
    history: Path | None,
    patterns: tuple[str, ...],
    shard: Any,
    **how: Any,
) -> ExitCode:
    """Run SCENARIOS, compare them with their baselines, and write junit.xml, index.html and more into OUTPUT.

    Exit codes: 1 different; 2 invalid or unreadable; 4 failed or without a baseline; 130 interrupted (partial reports).
    """
    from replay.batch.claim import claim
    from replay.batch.regress import regress as judge
    from replay.batch.select import Selection, rules_beside
    from replay.cli.progress import RunProgress
    from replay.cli.results import report
    from replay.comparison.rules_file import read_rules

    settings = options.settings(how)
    selection = Selection.of(scenarios, patterns, shard)
    options.note_left_out(scenarios)
    if not selection.chosen:
        return options.nothing(patterns, shard)
    rules = rules or rules_beside(scenarios)
    settings |= {"rules": read_rules(rules, today=datetime.date.today()) if rules else None}
    settings |= {"rules_file": str(rules or ""), "model_name": how["model"] or "", "history": history}
    settings |= {name: how[name] for name in ("missing", "rrd", "pictures", "resume")}
    with claim(output):
        with RunProgress() as watch:
            found = judge(selection, output, baseline, watch=watch, **settings)
        return report(found, history=history)
