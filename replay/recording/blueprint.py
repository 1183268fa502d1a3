"""How the rerun viewer arranges a recording: the scene large, readings over time, events and scenario beside it."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any

import numpy as np

from replay.collision.columns import CollisionColumns
from replay.guarding.columns import GuardColumns
from replay.numerics.arrays import Floats
from replay.numerics.columns import Field
from replay.sensing.kind import SensorKind
from replay.sensing.kinds import KINDS

SCENE = "scene"
CLEARANCE = "clearance"
JOINTS = "joints"
CLOCKS = "clocks"
EVENTS = "events"
SCENARIO = "scenario"
TIMELINE = "time"


def _charted(kind: SensorKind) -> dict[str, Field]:
    """Return the fields that have a chart by its name; that of a kind's first one is called like the kind."""
    fields = [field for field in kind.columns.fields() if field.chart]
    return {f"{kind.name}_{field.name}" if k else kind.name: field for k, field in enumerate(fields)}


CHARTED = {kind.name: _charted(kind) for kind in KINDS.values()}
"""The fields of each kind of sensor that have a chart, by the chart's name."""
CHARTS = {
    **{chart: field.chart for fields in CHARTED.values() for chart, field in fields.items()},
    CLEARANCE: next(field.chart for field in CollisionColumns.fields() if field.chart),
    CLOCKS: next(field.chart for field in GuardColumns.fields() if field.chart),
    JOINTS: "Joint positions [rad, m]",
}
"""Titles of all charts, in the order in which they are shown."""

_VIEW_DIRECTION = np.array([1.1, -1.5, 0.75])
_HALF_VIEW = np.tan(np.radians(55.0) / 2.0)  # the viewer's field of view
_AROUND = 1.1  # room around the scene
_NEAREST = 0.1  # [m], however small the scene
_BACKGROUND = (38, 42, 48)


_PANELS = ("BlueprintPanel", "SelectionPanel")


def recording(charts: Collection[str], eye: Any, axis: Any) -> Any:
    """Return the rerun blueprint of one recording.

    Args:
        charts: which of CHARTS have curves.
        eye: from where the scene is looked at, see `eye_of`.
        axis: time axis of the charts, see `axis_until`.
    """
    import rerun.blueprint as rrb

    readings = [chart(name, axis) for name in CHARTS if name in charts and name != JOINTS]
    behind = [chart(JOINTS, axis)] if JOINTS in charts else []
    scenario = rrb.TextDocumentView(origin=f"/{SCENARIO}", name="Scenario")
    below = rrb.Tabs(event_table(), *behind, scenario, active_tab=0)
    return whole(rrb.Horizontal(scene_view(eye), rrb.Vertical(*readings, below), column_shares=[3, 2]))


def side_by_side(sides: Sequence[str], charts: Sequence[str], eye: Any, end: int) -> Any:
    """Return the blueprint of several recordings in one.

    Args:
        sides: what the recordings are called; the entities of each stand below its name.
        charts: as of `recording`, of all together.
        eye: from where every scene is looked at, see `eye_of_all`.
        end: time [ns] at which the charts end.
    """
    import rerun as rr
    import rerun.blueprint as rrb

    columns = []
    for side in sides:
        prefix = f"/{rr.escape_entity_path_part(side)}"
        curves = [chart(name, axis_until(end), prefix) for name in CHARTS if name in charts]
        below = [rrb.Tabs(*curves, active_tab=0)] if curves else []
        shares = [5, 3, 2] if curves else [5, 2]
        columns.append(rrb.Vertical(scene_view(eye, prefix, side), *below, event_table(prefix), row_shares=shares))
    return whole(rrb.Horizontal(*columns))


def whole(container: Any) -> Any:
    """Return a blueprint in which nothing but a container and the time line is open."""
    import rerun.blueprint as rrb

    closed = [getattr(rrb, panel)(state="collapsed") for panel in _PANELS]
    return rrb.Blueprint(container, *closed, rrb.TimePanel(state="collapsed", timeline=TIMELINE), auto_views=False)


def eye_of(points: Floats) -> Any:
    """Return an eye that sees points (n, 3) [m] in world coordinates, in a view that is as wide as high."""
    axes = _view_axes()
    seen = points @ axes.T
    middle = 0.5 * (seen.min(axis=0) + seen.max(axis=0))
    aside = np.abs(seen - middle)[:, :2].max(axis=1)
    distance = float((seen[:, 2] - middle[2] + aside / _HALF_VIEW).max())
    return eye_at(middle @ axes + (_AROUND * distance + _NEAREST) * axes[2], middle @ axes)


def eye_of_all(eyes: Sequence[tuple[Floats, Floats]]) -> Any:
    """Return one eye that sees what several eyes of `eye_of` see.

    Args:
        eyes: position and target of each, (3,) [m]; the eye of one is that one.
    """
    points = []
    for position, target in eyes:
        distance = (np.linalg.norm(position - target) - _NEAREST) / _AROUND
        aside = max(distance, 0.0) * _HALF_VIEW * _view_axes()[:2]
        points += [target + aside, target - aside]
    return eye_of(np.concatenate(points))


def _view_axes() -> Floats:
    """Return the directions to the right, up and toward the eye, as rows."""
    toward = _VIEW_DIRECTION / np.linalg.norm(_VIEW_DIRECTION)
    right = np.cross([0.0, 0.0, 1.0], toward) / np.hypot(*toward[:2])
    return np.stack([right, np.cross(toward, right), toward])


def eye_at(position: Floats, target: Floats) -> Any:
    """Return an eye at a position that looks to a target, (3,) [m], upright."""
    import rerun.blueprint as rrb

    return rrb.EyeControls3D(position=position, look_target=target, eye_up=(0.0, 0.0, 1.0))


def axis_until(end: int) -> Any:
    """Return the time axis of a chart from 0 to `end` [ns]."""
    import rerun as rr
    import rerun.blueprint as rrb

    span = rr.TimeRange(
        start=rr.TimeRangeBoundary.absolute(seconds=0.0), end=rr.TimeRangeBoundary.absolute(seconds=max(end, 1) / 1e9)
    )
    return rrb.TimeAxis(view_range=span)


def scene_view(eye: Any, prefix: str = "", name: str = "Scene", sides: Sequence[str] = ("",)) -> Any:
    """Return a view of the scene below a prefix, or of the scenes of several sides below it, in one."""
    import rerun.blueprint as rrb

    return rrb.Spatial3DView(
        origin=prefix or "/",
        contents=[f"+ {prefix}{side}/{SCENE}/**" for side in sides],
        name=name,
        background=rrb.Background(color=_BACKGROUND),
        line_grid=rrb.LineGrid3D(visible=True, spacing=0.5, color=(255, 255, 255, 18)),
        eye_controls=eye,
    )


def event_table(prefix: str = "") -> Any:
    """Return a table of the events below a prefix."""
    import rerun.blueprint as rrb
    from rerun.blueprint.encodings import TextLogColumn

    columns = rrb.TextLogColumns(text_log_columns=[TextLogColumn(kind) for kind in ("LogLevel", "Body")])
    return rrb.TextLogView(origin=f"{prefix}/{EVENTS}", name="Events", columns=columns)


def chart(name: str, axis: Any, prefix: str = "") -> Any:
    """Return a chart of the curves below a prefix over a time axis."""
    import rerun.blueprint as rrb

    return rrb.TimeSeriesView(
        origin=f"{prefix}/{name}",
        name=CHARTS[name],
        axis_x=axis,
        plot_legend=rrb.PlotLegend(corner=rrb.Corner2D.RightTop),
    )
