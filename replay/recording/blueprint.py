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


_PANELS = ("BlueprintPanel", "SelectionPanel")


def blueprint(charts: Sequence[str], corners: Floats, end: int) -> Any:
    """Return the rerun blueprint.

    Args:
        charts: which of DISTANCE, CAPACITIVE, CLEARANCE and JOINTS have curves.
        corners: (n, 3) points [m] in world coordinates that the first picture should show.
        end: time [ns] at which the charts end.
    """
    import rerun.blueprint as rrb

    low, high = corners.min(axis=0), corners.max(axis=0)
    middle = 0.5 * (low + high)
    distance = 0.85 * float(np.linalg.norm(high - low)) + 0.1
    eye = middle + distance * _VIEW_DIRECTION / np.linalg.norm(_VIEW_DIRECTION)
    readings = [chart(name, end) for name in (DISTANCE, CAPACITIVE, CLEARANCE) if name in charts]
    behind = [chart(name, end) for name in (JOINTS,) if name in charts]
    scenario = rrb.TextDocumentView(origin=f"/{SCENARIO}", name="Scenario")
    below = rrb.Tabs(event_table(), *behind, scenario, active_tab=0)
    return whole(
        rrb.Horizontal(scene_view(eye, middle), rrb.Vertical(*readings, below), column_shares=[3, 2]),
    )


def side_by_side(sides: Sequence[str], charts: Sequence[str], eye: Floats, target: Floats, end: int) -> Any:
    """Return the blueprint of several recordings in one.

    Args:
        sides: what the recordings are called; the entities of each stand below its name.
        charts, end: as of `blueprint`, of all together.
        eye, target: (3,) [m], from where to where every scene is looked at.
    """
    import rerun as rr
    import rerun.blueprint as rrb

    columns = []
    for side in sides:
        prefix = f"/{rr.escape_entity_path_part(side)}"
        curves = [chart(name, end, prefix) for name in _TITLES if name in charts]
        below = [rrb.Tabs(*curves, active_tab=0)] if curves else []
        shares = [5, 3, 2] if curves else [5, 2]
        columns.append(
            rrb.Vertical(scene_view(eye, target, prefix, side), *below, event_table(prefix), row_shares=shares)
        )
    return whole(rrb.Horizontal(*columns))


def whole(container: Any) -> Any:
    """Return a blueprint in which nothing but a container and the time line is open."""
    import rerun.blueprint as rrb

    closed = [getattr(rrb, panel)(state="collapsed") for panel in _PANELS]
    return rrb.Blueprint(container, *closed, rrb.TimePanel(state="collapsed", timeline=TIMELINE), auto_views=False)


def scene_view(eye: Floats, target: Floats, prefix: str = "", name: str = "Scene") -> Any:
    """Return a view of the scene below a prefix, looked at from `eye` to `target`, (3,) [m]."""
    import rerun.blueprint as rrb

    return rrb.Spatial3DView(
        origin=prefix or "/",
        contents=[f"+ {prefix}/{SCENE}/**"],
        name=name,
        background=rrb.Background(color=_BACKGROUND),
        line_grid=rrb.LineGrid3D(visible=True, spacing=0.5, color=(255, 255, 255, 18)),
        eye_controls=rrb.EyeControls3D(position=eye, look_target=target, eye_up=(0.0, 0.0, 1.0)),
    )


def event_table(prefix: str = "") -> Any:
    """Return a table of the events below a prefix."""
    import rerun.blueprint as rrb
    from rerun.blueprint.encodings import TextLogColumn

    columns = rrb.TextLogColumns(text_log_columns=[TextLogColumn(kind) for kind in ("LogLevel", "Body")])
    return rrb.TextLogView(origin=f"{prefix}/{EVENTS}", name="Events", columns=columns)


def chart(name: str, end: int, prefix: str = "") -> Any:
    """Return a chart of the curves below a prefix, from 0 to `end` [ns]."""
    import rerun as rr
    import rerun.blueprint as rrb

    span = rr.TimeRange(
        start=rr.TimeRangeBoundary.absolute(seconds=0.0), end=rr.TimeRangeBoundary.absolute(seconds=max(end, 1) / 1e9)
    )
    return rrb.TimeSeriesView(
        origin=f"{prefix}/{name}",
        name=_TITLES[name],
        axis_x=rrb.TimeAxis(view_range=span),
        plot_legend=rrb.PlotLegend(corner=rrb.Corner2D.RightTop),
    )
