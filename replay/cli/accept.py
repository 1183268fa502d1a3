"""`replay accept`: make a run's recordings the baseline."""

from __future__ import annotations

import datetime
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

from replay.cli import interruption
from replay.cli.exit_codes import ExitCode
from replay.cli.options import note
from replay.cli.terminal import put
from replay.cli.values import PathName

if TYPE_CHECKING:
    from replay.batch.accept import Accepted


@click.command()
@click.argument("rundir", type=PathName())
@click.option("--baseline", type=PathName(), required=True, help="Folder of accepted recordings.")
@click.option("--select", multiple=True, metavar="GLOB", help="Only scenarios of that name; repeatable.")
@click.option("--except", "leave_out", multiple=True, metavar="GLOB", help="No scenarios of that name; repeatable.")
@click.option("--group", default="", metavar="NAME", help="Only scenarios of that cause, as the night's page names it.")
@click.option("--reason", default="", help="Why the results are right now; kept in the baseline's log.")
@click.option("--yes", is_flag=True, help="Do not ask.")
def accept(
    rundir: Path,
    baseline: Path,
    select: tuple[str, ...],
    leave_out: tuple[str, ...],
    group: str,
    reason: str,
    yes: bool,
) -> ExitCode:
    """Show how the recordings of RUNDIR differ from the baseline, and make them the baseline.

    A run that was interrupted, or of which a scenario that is to be accepted failed, is refused.
    """
    from replay.batch.accept import Accepted
    from replay.batch.claim import claim

    chosen = Accepted(select, leave_out, group)
    with claim(rundir, shared=True), claim(baseline):  # what is shown is what is stored
        return _accept(rundir, baseline, chosen, reason, yes)


def _accept(rundir: Path, baseline: Path, chosen: Accepted, reason: str, yes: bool) -> ExitCode:
    from replay.batch.accept import plan_acceptance

    plan = plan_acceptance(rundir, baseline, chosen)
    put(plan.describe())
    if not plan.entries:
        return ExitCode.FINE
    if not yes and not sys.stdin.isatty():
        raise click.UsageError("there is nobody to ask; pass --yes")
    if not yes and not click.confirm("Accept?", err=True):
        note("nothing was changed")
        return ExitCode.DIFFERENT
    if not reason and not yes:
        reason = click.prompt("Why are they right?", err=True)
    if not reason:
        note("no --reason: the baseline's log will not say why")
    interruption.settle()
    plan.commit(reason=reason, now=datetime.datetime.now(datetime.UTC))
    return ExitCode.FINE
