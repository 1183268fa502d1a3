"""How the rerun viewer arranges a recording: the scene large, readings over time, events and scenario beside it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from replay.recording.scene_view import Floats

SCENE = "scene"
DISTANCE = "distance"
CAPACITIVE = "capacitive"
CLEARANCE = "clearance"
JOINTS = "joints"
EVENTS = "events"
SCENARIO = "scenario"
TIMELINE = "time"

_TITLES = {
    DISTANCE: "Distance to the closest point [m]",
    CAPACITIVE: "Capacitive sensors: drop of the output voltage [V]",
    CLEARANCE: "Clearance of pairs that are near [m]",
    JOINTS: "Joint positions [rad, m]",
}
_VIEW_DIRECTION = np.array([1.1, -1.5, 0.75])
_BACKGROUND = (38, 42, 48)


def blueprint(charts: Sequence[str], corners: Floats, end: int) -> Any:
    """Return the rerun blueprint.

    Args:
        charts: which of DISTANCE, CAPACITIVE, CLEARANCE and JOINTS have curves.
        corners: (n, 3) points [m] in world coordinates that the first picture should show.
        end: time [ns] at which the charts end.
    """
    import rerun.blueprint as rrb
    from rerun.blueprint.encodings import TextLogColumn

    low, high = corners.min(axis=0), corners.max(axis=0)
    middle = 0.5 * (low + high)
    distance = 0.85 * float(np.linalg.norm(high - low)) + 0.1
    eye = middle + distance * _VIEW_DIRECTION / np.linalg.norm(_VIEW_DIRECTION)
    scene = rrb.Spatial3DView(
        origin="/",
        contents=[f"+ /{SCENE}/**"],
        name="Scene",
        background=rrb.Background(color=_BACKGROUND),
        line_grid=rrb.LineGrid3D(visible=True, spacing=0.5, color=(255, 255, 255, 18)),
        eye_controls=rrb.EyeControls3D(position=eye, look_target=middle, eye_up=(0.0, 0.0, 1.0)),
    )
    events = rrb.TextLogView(
        origin=f"/{EVENTS}",
        name="Events",
        columns=rrb.TextLogColumns(text_log_columns=[TextLogColumn(kind) for kind in ("LogLevel", "Body")]),
    )
    readings = [_chart(name, end) for name in (DISTANCE, CAPACITIVE, CLEARANCE) if name in charts]
    behind = [_chart(name, end) for name in (JOINTS,) if name in charts]
    below = rrb.Tabs(events, *behind, rrb.TextDocumentView(origin=f"/{SCENARIO}", name="Scenario"), active_tab=0)
    return rrb.Blueprint(
        rrb.Horizontal(scene, rrb.Vertical(*readings, below), column_shares=[3, 2]),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline=TIMELINE),
        auto_views=False,
    )


def _chart(name: str, end: int) -> Any:
    import rerun as rr
    import rerun.blueprint as rrb

    span = rr.TimeRange(
        start=rr.TimeRangeBoundary.absolute(seconds=0.0), end=rr.TimeRangeBoundary.absolute(seconds=max(end, 1) / 1e9)
    )
    return rrb.TimeSeriesView(
        origin=f"/{name}",
        name=_TITLES[name],
        axis_x=rrb.TimeAxis(view_range=span),
        plot_legend=rrb.PlotLegend(corner=rrb.Corner2D.RightTop),
    )
