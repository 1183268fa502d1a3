"""The `replay` command: loads a command's module only when it is called, and turns errors into one line."""

from __future__ import annotations

import difflib
import errno
import importlib
import keyword
import os
import sys
import traceback
from collections.abc import Sequence
from typing import Any

import click

import replay
from replay.cli import interruption, terminal
from replay.cli.exit_codes import ExitCode
from replay.errors import ReplayError

COMMANDS = {
    "new": "write a first scenario, to be read and changed",
    "run": "simulate scenarios and record them",
    "validate": "check scenarios without running them",
    "import": "make a part of a robot's description (URDF, SRDF)",
    "info": "say what is in a recording",
    "schema": "print the JSON Schema of scenarios, for editors",
    "calibrate": "fit a capacitive sensor to a measured curve",
    "experiments": "reproduce the thesis's experiments with the capacitive sensor",
    "export": "write a recording's topics as csv, json or parquet",
    "diff": "say what differs between two recordings or two run folders",
    "compare": "put a recording beside a log of the real machine",
    "explain": "say why a reading is what it is at a moment",
    "regress": "run scenarios and compare each with its baseline",
    "merge": "put the run folders of several shards into one night",
    "accept": "make a run's recordings the baseline",
    "trend": "say how results went from night to night",
    "view": "show recordings in the rerun viewer, or make a picture",
    "bench": "time methods and peers on the same questions, and check their answers",
}
"""Help by name of command; each is the function of that name in the module of that name, `import_` for `import`."""

MAX_LINES = 100
"""Lines of one error that are shown; a mistake in a sweep is one line for each of its cases."""


class LazyGroup(click.Group):
    """A group whose commands are imported when they are used: `--help` needs none of them."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return the names, in the order in which people meet them."""
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, name: str) -> click.Command | None:
        """Return a command, importing its module."""
        if name not in COMMANDS:
            return None
        name += "_" * keyword.iskeyword(name)
        command: click.Command = getattr(importlib.import_module(f"replay.cli.{name}"), name)
        return command

    def resolve_command(self, ctx: click.Context, args: list[str]) -> Any:
        """Return a command and its arguments; a name that is none is told with what it may have meant."""
        close = difflib.get_close_matches(args[0], COMMANDS, n=1)
        if args[0] not in COMMANDS and not args[0].startswith("-"):
            ctx.fail(
                f"No such command {args[0]!r}; " + (f"did you mean {close[0]!r}?" if close else ", ".join(COMMANDS))
            )
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the list of commands from the table, so that no module is imported for it."""
        with formatter.section("Commands"):
            formatter.write_dl(list(COMMANDS.items()))


@click.group(cls=LazyGroup, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(replay.__version__, prog_name="replay")
def replay_command() -> None:
    """Simulate scenarios of mechanical systems, record collisions and sensor readings, and compare recordings."""


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line and leave with its exit code.

    Asked to stop by the system (SIGTERM, or SIGHUP of a closed terminal), a command ends as by Ctrl-C: it removes half
    files and takes the viewer with it.
    """
    interruption.install()
    terminal.install()
    os.environ["PYTHONSAFEPATH"] = "1"  # no Python that is started from here imports from the current folder
    code = ExitCode.INTERRUPTED
    try:
        code = run(arguments)
        interrupted = interruption.over()
    except KeyboardInterrupt:  # at the command's very end
        interrupted = interruption.over()
    sys.exit(int(ExitCode.INTERRUPTED if interrupted else code))


def run(arguments: Sequence[str] | None = None) -> ExitCode:
    """Run the command line and return its exit code; errors are said on stderr, one line each."""
    try:
        result: Any = replay_command.main(args=arguments, prog_name="replay", standalone_mode=False)
    except click.exceptions.Exit as left:
        return ExitCode(left.exit_code)
    except click.exceptions.NoArgsIsHelpError as error:
        error.show()
        return ExitCode.INVALID
    except click.ClickException as error:
        context = error.ctx if isinstance(error, click.UsageError) else None
        hint = f"; see {context.command_path} --help" if context else ""
        message = " ".join(error.format_message().split()).rstrip(".")
        terminal.put([f"replay: error: {message}{hint}"], err=True)
        return ExitCode.INVALID
    except ReplayError as error:
        lines = str(error).splitlines()
        shown = [*lines[:MAX_LINES], *([f"... and {len(lines) - MAX_LINES} more"] if len(lines) > MAX_LINES else [])]
        terminal.put([f"replay: error: {line}" for line in shown], err=True)
        return ExitCode.INVALID
    except (KeyboardInterrupt, click.Abort):
        terminal.put(["replay: interrupted"], err=True)
        return ExitCode.INTERRUPTED
    except OSError as error:
        if error.filename is not None or error.errno not in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO):
            return _fault(error)
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)  # what is left of the result would fail once more at exit
        terminal.put([f"replay: error: the result cannot be written to standard output: {error.strerror}"], err=True)
        return ExitCode.INVALID
    except Exception as error:  # Python's own exit code for it is 1, which here means "different"
        return _fault(error)
    return result if isinstance(result, ExitCode) else ExitCode.FINE


def _fault(error: Exception) -> ExitCode:
    traceback.print_exc()
    terminal.put([f"replay: error: this is a fault of replay: {type(error).__name__}: {error}"], err=True)
    return ExitCode.FAILED
