"""A recording beside what the machine measured, as a rerun recording: the scene, curves of both, residuals."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from replay.comparison.measured.report_text import lines
from replay.comparison.measured.result import MeasuredComparison, MeasuredSignal
from replay.comparison.overlay import COLORS, Color, Side, log_poses, log_scene, send
from replay.errors import printable
from replay.numerics.arrays import Integers
from replay.recording.blueprint import TIMELINE, eye_of, scene_view
from replay.recording.reader import read
from replay.recording.rerun_file import RerunFile
from replay.recording.rerun_log import APPLICATION

MEASURED, SIMULATED, RESIDUAL = "measured", "simulated", "residual"
"""First parts of the entities: `/simulated/scene/arm/beam`, `/measured/values/SIGNAL`, `/residual/SIGNAL`."""
CURVES = 24
"""Signals that are drawn; those that are off come first."""
_COLORS: dict[str, Color] = {MEASURED: COLORS["baseline"], SIMULATED: COLORS["candidate"]}
_BODY: Color = (150, 160, 170, 255)


def write_measured(path: str | Path, recording: Path, found: MeasuredComparison) -> None:
    """Write what shows a recording beside what the machine measured; a file that exists is replaced.

    Raises:
        WriteError: it cannot be written.
    """
    import rerun as rr

    file = RerunFile(path, overwrite=True)
    try:
        poses = read(recording, topics=["/tf"])
        side = Side.of(poses)
        shown = sorted(found.signals, key=lambda signal: not signal.decides)[:CURVES]
        stream = file.open(APPLICATION)
        file.arrange(_blueprint(shown, eye_of(side.extent())))
        stream.send_recording_name(f"{found.difference.name}: measured and simulated")
        summary = "".join(f"{printable(line)}\n" for line in lines(found, verbose=True))
        stream.log("summary", rr.TextDocument(summary), static=True)
        stream.log("/", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        log_scene(stream, SIMULATED, side.scene, _BODY)
        log_poses(stream, SIMULATED, poses)
        for signal in shown:
            _log_signal(stream, signal, poses.time)
        file.commit()
    except BaseException:
        file.discard()
        raise


def _log_signal(stream: Any, signal: MeasuredSignal, time: Integers) -> None:
    import rerun as rr

    matched, name = signal.matched, signal.signal.full_name
    frames = np.arange(len(time))
    residual = np.full(len(time), np.nan)
    residual[matched.frames] = matched.residual
    curves = ((MEASURED, matched.at_frames), (SIMULATED, matched.pair.value), (RESIDUAL, residual))
    for side, values in curves:
        path = [side, name] if side == RESIDUAL else [side, "values", name]
        color = _COLORS.get(side)
        style = rr.SeriesLines(names=side, colors=color and (*color[:3], 255), widths=3.0 if side == MEASURED else 1.5)
        stream.log(path, style, static=True)
        send(stream, path, time, frames, rr.Scalars.columns(scalars=values))


def _charts(signal: MeasuredSignal) -> Any:
    import rerun as rr
    import rerun.blueprint as rrb

    legend = rrb.PlotLegend(corner=rrb.Corner2D.RightTop)
    name = signal.signal.full_name
    unit = f" [{signal.signal.unit}]" if signal.signal.unit else ""
    sides = [rr.new_entity_path([side, "values", name]) for side in (MEASURED, SIMULATED)]
    return rrb.Vertical(
        rrb.TimeSeriesView(origin="/", contents=[f"+ {side}" for side in sides], name=name + unit, plot_legend=legend),
        rrb.TimeSeriesView(origin=rr.new_entity_path([RESIDUAL, name]), name=f"residual{unit}", plot_legend=legend),
        name=name,
    )


def _blueprint(shown: list[MeasuredSignal], eye: Any) -> Any:
    import rerun.blueprint as rrb

    scene = scene_view(eye, name="As simulated", sides=[f"/{SIMULATED}"])
    summary = rrb.TextDocumentView(origin="/summary", name="Summary")
    charts = rrb.Tabs(*map(_charts, shown), active_tab=0)
    return rrb.Blueprint(
        rrb.Horizontal(scene, rrb.Vertical(charts, summary, row_shares=[3, 2]), column_shares=[3, 2]),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline=TIMELINE),
        auto_views=False,
    )
