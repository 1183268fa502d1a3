"""`replay view`: show recordings in the rerun viewer, or make a picture."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import click

from replay.cli.exit_codes import ExitCode
from replay.cli.terminal import put
from replay.cli.values import CameraAt, PathName, Size


@click.command()
@click.argument("recordings", nargs=-1, required=True, type=PathName())
@click.option("--screenshot", type=PathName(), metavar="PNG", help="Write a picture; needs no display.")
@click.option("--at", type=float, metavar="SECONDS", help="Moment of the picture; the end when left out.")
@click.option("--size", type=Size(), default="1280x800", show_default=True, help="Of the viewer's window [pixels].")
@click.option("--camera", type=CameraAt(), help="From where to look, and to where: X,Y,Z or X,Y,Z,TX,TY,TZ [m].")
@click.option("--scene-only", is_flag=True, help="A picture of the scene alone.")
@click.option("--web", is_flag=True, help="Serve the viewer to this machine's browsers, on 127.0.0.1 only.")
def view(
    recordings: tuple[Path, ...],
    screenshot: Path | None,
    at: float | None,
    size: tuple[int, int],
    camera: Any,
    scene_only: bool,
    web: bool,
) -> ExitCode:
    """Show RECORDINGS (.rrd, or .mcap with its .rrd beside it) side by side in one viewer."""
    from replay.recording.picture import picture
    from replay.recording.side_by_side import one_recording
    from replay.recording.viewer import rerun_files, show
    from replay.recording.web_page import serve

    for name, given in (("--at", at is not None), ("--camera", camera is not None), ("--scene-only", scene_only)):
        if given and screenshot is None:
            raise click.UsageError(f"{name} belongs to --screenshot")
    if (camera is not None or scene_only) and len(recordings) > 1:
        raise click.UsageError("--camera and --scene-only are for one recording")
    if at is not None and not 0.0 <= at < math.inf:
        raise click.UsageError(f"--at {at:g} is no moment of a recording; give seconds from its start")
    if screenshot is not None and screenshot.suffix.lower() != ".png":
        raise click.UsageError(f"--screenshot {screenshot} must end in .png, the only form of pictures")
    if screenshot is not None and web:
        raise click.UsageError("--screenshot and --web exclude each other")
    with one_recording(rerun_files(recordings)) as file:
        if web:
            names = ", ".join(path.name for path in recordings)
            serve(file, lambda address: put([f"{address} shows {names} until Ctrl-C"]))
        elif screenshot is None:
            show(file)
        else:
            picture(file, screenshot, at=at, size=size, camera=camera, only_scene=scene_only)
            put([str(screenshot)])
    return ExitCode.FINE
