"""`replay explain`: why a reading is what it is."""

from __future__ import annotations

from pathlib import Path

import click

from replay.cli.exit_codes import ExitCode
from replay.cli.terminal import put
from replay.cli.values import PathName


@click.command()
@click.argument("recording", type=PathName())
@click.argument("signal")
@click.option("--at", type=float, required=True, metavar="SECONDS", help="Moment; the frame at or before it counts.")
@click.option("--slow", is_flag=True, help="Ask methods that take seconds a frame too, such as bem.")
def explain(recording: Path, signal: str, at: float, slow: bool) -> ExitCode:
    """Say why SIGNAL of RECORDING (.mcap) is what it is: poses, what is closest, shares, and what other methods say.

    SIGNAL is a sensor (/distance/tip or tip), a pair (/collision/arm/rod|table/top or arm/rod|table/top), or a signal
    of one as `replay diff` names it.
    """
    from replay.comparison.explain import explain as explained

    put(explained(recording, signal, at, slow=slow))
    return ExitCode.FINE
