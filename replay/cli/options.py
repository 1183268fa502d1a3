"""Arguments and options that several commands share."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from replay.cli.exit_codes import ExitCode
from replay.cli.terminal import put
from replay.cli.values import Memory, PathName, Seconds, ShardOf, Workers

if TYPE_CHECKING:
    from replay.batch.interpreter import Ahead
    from replay.batch.shard import Shard

Command = TypeVar("Command", bound=Callable[..., Any])

scenarios_argument = click.argument("scenarios", nargs=-1, required=True, type=PathName())
model_option = click.option("--model", metavar="FILE|NAME", help="Compute with this model (a file, or thesis2015).")
select_option = click.option(
    "--select",
    "patterns",
    multiple=True,
    metavar="GLOB|tag:NAME",
    help="Only scenarios of that name or tag; repeatable.",
)
shard_option = click.option("--shard", type=ShardOf(), help="Only the i-th of n parts of the scenarios.")
format_option = click.option(
    "--format",
    "form",
    type=click.Choice(["text", "json"]),
    default="text",
    show_default=True,
    help="Form of the result.",
)
_EXECUTION = (
    click.option("--workers", type=Workers(), help="Processes; as many as there are cores when left out."),
    click.option("--timeout", type=Seconds(), help="Longest time of one scenario, such as 90s or 10min."),
    click.option("--memory", type=Memory(), help="Most resident memory of one scenario, such as 2GiB."),
    click.option("--dask", metavar="ADDRESS", help="Run on the Dask cluster of this scheduler instead; it is trusted."),
    click.option("--dask-ca", type=PathName(), help="TLS: certificate of the authority that the cluster is known by."),
    click.option("--dask-cert", type=PathName(), help="TLS: our certificate, signed by that authority."),
    click.option("--dask-key", type=PathName(), help="TLS: its private key, if it is in a file of its own."),
)


def output_option(default: str) -> Callable[[Command], Command]:
    """Return the option for the run folder."""
    kind = PathName()
    return click.option("-o", "--output", type=kind, default=Path(default), show_default=True, help="Run folder.")


def execution_options(command: Command) -> Command:
    """Add what `batch.run.Execution` takes: workers, timeout, memory, dask and its certificates."""
    for option in reversed(_EXECUTION):
        command = option(command)
    return command


def settings(options: dict[str, Any], ahead: Ahead | None = None) -> dict[str, Any]:
    """Return `model` and `execution` of a run as the options name them, with a worker that was begun ahead."""
    from replay.batch.run import Execution
    from replay.batch.tls import Certificates
    from replay.scenario.load import load_model

    certificates = Certificates.of(*(options[name] for name in ("dask_ca", "dask_cert", "dask_key")))
    if certificates is not None and options["dask"] is None:
        raise click.UsageError("--dask-ca, --dask-cert and --dask-key belong to --dask")
    how = {name: options[name] for name in ("workers", "timeout", "memory", "dask")}
    execution = Execution(**how, certificates=certificates, ahead=ahead)
    return {"model": None if options["model"] is None else load_model(options["model"]), "execution": execution}


def say(form: str, lines: Callable[[], Iterable[str]], data: Callable[[], Any]) -> None:
    """Write a result to stdout as lines for people or as JSON for programs."""
    put(lines() if form == "text" else json.dumps(data(), indent=1).splitlines())


def note(message: str) -> None:
    """Write a remark to stderr, where it does not disturb results."""
    put([f"replay: {message}"], err=True)


def note_left_out(paths: Sequence[Path]) -> None:
    """Say what of folders of scenarios cannot be looked at."""
    from replay.batch.select import left_out

    for line in left_out(paths):
        note(f"note: {line}")


def nothing(patterns: Sequence[str], shard: Shard | None = None) -> ExitCode:
    """Say that no scenario is left to work on."""
    by = f" by {', '.join(pattern or repr(pattern) for pattern in patterns)}" if patterns else ""
    note(f"nothing selected{by}{f' in part {shard.index} of {shard.count}' if shard else ''}")
    return ExitCode.NOTHING
