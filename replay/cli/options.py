"""Arguments and options that several commands share."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

scenarios_argument = click.argument("scenarios", nargs=-1, required=True, type=click.Path(path_type=Path))
select_option = click.option(
    "--select",
    "patterns",
    multiple=True,
    metavar="GLOB|tag:NAME",
    help="Only scenarios of that name or tag; repeatable.",
)
format_option = click.option(
    "--format",
    "form",
    type=click.Choice(["text", "json"]),
    default="text",
    show_default=True,
    help="Form of the result.",
)


def say(form: str, text: Callable[[], str], data: Callable[[], Any]) -> None:
    """Write a result to stdout as text for people or as JSON for programs."""
    click.echo(text() if form == "text" else json.dumps(data(), indent=1))


def announce_compiling() -> None:
    """Say on stderr that kernels will be compiled, when none are."""
    from replay.numerics.jit import is_cache_empty

    if is_cache_empty():
        note("compiling kernels; this takes about a minute, once")


def note(message: str) -> None:
    """Write a remark to stderr, where it does not disturb results."""
    click.echo(f"replay: {message}", err=True)
