"""`replay compare`: what a recording says beside a log of the real machine."""

from __future__ import annotations

import datetime
from pathlib import Path
from typing import Any

import click

from replay.cli import options
from replay.cli.exit_codes import ExitCode, worst
from replay.cli.values import PathName

FILE = PathName()


@click.command()
@click.argument("scenario", type=FILE)
@click.option("--measured", "log", type=FILE, help="The machine's log; the one that SCENARIO names when left out.")
@click.option("--map", "mapping", type=FILE, help="What of the log measures which signals (YAML); SCENARIO's own.")
@click.option("--rules", type=FILE, help="Tolerances; rules.yaml beside SCENARIO when left out.")
@click.option("-o", "--output", type=FILE, help="Run folder that keeps the recording.")
@options.model_option
@options.format_option
@click.option("-v", "--verbose", is_flag=True, help="List every event and rule.")
@click.option("--html", type=FILE, help="Write a page with drawings.")
@click.option("--junit", type=FILE, help="Write a JUnit report.")
@click.option("--rrd", type=FILE, help="Write a rerun recording that shows both; a folder for a sweep.")
def compare(scenario: Path, rules: Path | None, model: str | None, form: str, verbose: bool, **how: Any) -> ExitCode:
    """Compare SCENARIO (a file, or a recording, which is not run again) with a log of the real machine.

    Exit codes: 0 within the rules, 1 different, 2 invalid input or a clock that cannot be told, 4 a scenario failed.
    """
    from replay.batch.compare import compare_all
    from replay.batch.select import rules_beside
    from replay.cli.progress import RunProgress
    from replay.comparison.difference import DiffVerdict
    from replay.comparison.measured.outputs import MeasuredOutputs
    from replay.comparison.measured.report_text import lines
    from replay.comparison.rules_file import read_rules
    from replay.scenario.load import load_model

    outputs = MeasuredOutputs(**{name: how.pop(name) for name in ("html", "junit", "rrd")})
    rules = rules or rules_beside([scenario])
    how["rules"] = read_rules(rules, today=datetime.date.today()) if rules else None
    how["model"] = None if model is None else load_model(model)
    with RunProgress() as watch:
        cases = list(compare_all(scenario, visit=outputs.visit, watch=watch, **how))
    for case in cases:
        if case.found is None:
            options.note(f"{case.name}: failed: {case.error}")
    found = [case.found for case in cases if case.found is not None]
    outputs.write(found)
    told = (line for one in found for line in lines(one, verbose=verbose))
    options.say(form, lambda: told, lambda: [one.as_json() for one in found])
    different = any(one.verdict is DiffVerdict.DIFFERENT for one in found)
    failed = ExitCode.FAILED if len(found) < len(cases) else ExitCode.FINE
    return worst([failed, ExitCode.DIFFERENT if different else ExitCode.FINE])
