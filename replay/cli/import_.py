"""`replay import`: a robot's description to a part that scenarios include."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from replay.cli.exit_codes import ExitCode
from replay.cli.options import format_option, say
from replay.cli.values import PathName

FILE = PathName()


@click.command("import")
@click.argument("description", type=FILE)
@click.option("-o", "--output", type=FILE, required=True, help="The part: a .yaml file.")
@click.option("--srdf", type=FILE, help="SRDF file: pairs that need no test, and states, which become poses.")
@click.option("--package", "packages", multiple=True, metavar="NAME=DIR", help="Where a ROS package is; repeatable.")
@click.option(
    "--acceleration", multiple=True, metavar="VALUE", help="For joints without: '2 rad/s^2', '1 m/s^2'; twice."
)
@click.option("--limits", type=FILE, help="MoveIt's joint_limits.yaml, which wins over the description.")
@click.option(
    "--collision",
    type=click.Choice(["collision", "visual"]),
    default="collision",
    show_default=True,
    help="visual: links without collision bodies collide as what they show.",
)
@click.option("--prefix", default="", metavar="TEXT", help="Goes before the names of links, joints and poses.")
@click.option("--root-pose", default="", metavar="POSE", help="Of the root link: 'X Y Z', or 'X Y Z ROLL PITCH YAW'.")
@click.option(
    "--up-axis",
    type=click.Choice(["apply", "ignore"]),
    default="apply",
    show_default=True,
    help="Of COLLADA meshes: apply turns to z what a file says is up; ignore reads it as RViz does.",
)
@click.option("--copy-meshes", is_flag=True, help="Copy the meshes beside the part, into a folder of its name.")
@click.option("--check-collisions", "samples", type=int, metavar="N", help="Disable pairs by what N random poses show.")
@click.option("--overwrite", is_flag=True, help="Replace a part that was changed by hand.")
@format_option
def import_(description: Path, output: Path, form: str, samples: int | None, **given: Any) -> ExitCode:
    """Write the robot of a URDF file DESCRIPTION as a part of the language, with what is not as it says (exit code 3).

    Files of package:// are looked for in --package, then beside the description, then where ROS says.
    """
    from replay.errors import RobotError
    from replay.robots.importing import Options, run

    if samples is not None and samples < 1:
        raise RobotError("--check-collisions", f"{samples} must be 1 or more")
    imported = run(description, output, Options(samples=samples or 0, **given))
    say(form, imported.lines, imported.data)
    return ExitCode.LOSSES if imported.lossy else ExitCode.FINE
