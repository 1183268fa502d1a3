"""Two runs in one rerun recording: both scenes in two colours, their readings and differences over time, what differs.

For people's eyes: the scene once as baseline (blue) and once as candidate (orange), curves of both for the signals
that differ, the differences in charts of their own, and a log of moments: selecting a line jumps to it, and the first
line is the first difference. The time selection spans what differs.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from replay.comparison import wording
from replay.comparison.difference import EventDifference, Moment, SignalDifference
from replay.comparison.log_changes import read_scene
from replay.comparison.plots import ComparedCurve, Curves
from replay.comparison.report_text import text
from replay.comparison.runs import Case, RecordingPair, RunDifference
from replay.numerics.arrays import Floats, Integers
from replay.recording.blueprint import SCENE, TIMELINE, eye_of, scene_view
from replay.recording.reader import Recording, read
from replay.recording.rerun_file import RerunFile
from replay.recording.rerun_log import APPLICATION
from replay.recording.rerun_scene import extent
from replay.recording.scene_view import BodyView, SceneView
from replay.recording.surfaces import corner_normals

Color = tuple[int, int, int, int]

BASELINE, CANDIDATE, DIFFERENCE = "baseline", "candidate", "difference"
"""First parts of the entities: `/baseline/scene/arm/beam`, `/candidate/values/FIELD/SIGNAL`, `/difference/...`."""
COLORS: dict[str, Color] = {BASELINE: (70, 150, 240, 110), CANDIDATE: (250, 140, 40, 110)}
CURVES = 24
"""Signals that are drawn; those that decide come first."""

_OPAQUE = 255


@dataclass(frozen=True)
class _Mark:
    """A moment worth a look."""

    at: Moment
    level: str
    text: str


@dataclass(frozen=True, eq=False)
class Side:
    """One run: its bodies, and a recording that has its poses."""

    scene: SceneView
    poses: Recording

    @staticmethod
    def of(recording: Recording) -> Side:
        """Read what a pair leaves out: the scene, and poses that are equal in both."""
        poses = recording if recording.layout.links else read(recording.path, topics=["/tf"])
        index = {name: k for k, name in enumerate(poses.layout.links)}
        message = read_scene(recording.path)
        bodies = []
        for entity in message.entities if message is not None else ():
            for mesh in entity.triangles:
                points = np.array([(point.x, point.y, point.z) for point in mesh.points]).reshape(-1, 3)
                triangles = points[np.array(mesh.indices, dtype=np.int64).reshape(-1, 3)]
                bodies.append(BodyView(entity.id, index[entity.frame_id], triangles, (0, 0, 0, 0)))
        name = recording.provenance.scenario
        return Side(SceneView(name, description="", links=poses.layout.links, bodies=tuple(bodies)), poses)

    def extent(self) -> Floats:
        """Return points (n, 3) [m] in world coordinates that span the scene and where it moves."""
        return extent(self.scene, self.poses.link_poses)


def write_overlay(path: str | Path, case: Case, pair: RecordingPair, *, overwrite: bool = True) -> None:
    """Write the recording that shows both runs of a scenario.

    Args:
        path: the `.rrd` file.
        case: what differs.
        pair: the two recordings.
        overwrite: replace a file that exists.

    Raises:
        RecordingExistsError: the file exists and may not be replaced.
        WriteError: it cannot be written.
    """
    import rerun as rr

    file = RerunFile(path, overwrite=overwrite)
    try:
        sides = {BASELINE: Side.of(pair.baseline), CANDIDATE: Side.of(pair.candidate)}
        eye = eye_of(np.concatenate([side.extent() for side in sides.values()]))
        marks = sorted(_marks(case), key=lambda mark: mark.at.time)
        shown = case.difference.signals[:CURVES]
        blueprint = _blueprint(marks, list(dict.fromkeys(map(_chart, shown))), eye)
        stream = file.open(APPLICATION)
        file.arrange(blueprint)
        stream.send_recording_name(f"{case.name}: baseline and candidate")
        summary = text(RunDifference(str(case.baseline), str(case.candidate), (case,)), verbose=True)
        stream.log("summary", rr.TextDocument(summary), static=True)
        stream.log("/", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        for name, side in sides.items():
            log_scene(stream, name, side.scene, COLORS[name])
            log_poses(stream, name, side.poses)
        curves = Curves(pair)
        for item in shown:
            _log_curve(stream, item, curves.curve(item), pair.baseline)
        _log_marks(stream, marks)
        file.commit()
    except BaseException:
        file.discard()
        raise


def log_scene(stream: Any, side: str, scene: SceneView, color: Color) -> None:
    """Log the bodies of one side, in one colour."""
    import rerun as rr

    corners, normals = (part.reshape(-1, 3) for part in (scene.meshes.triangles, corner_normals(scene.meshes)))
    ends = (3 * scene.meshes.first_triangle).tolist()
    for body, begin, end in zip(scene.bodies, ends, ends[1:], strict=False):
        path = [side, SCENE, scene.links[body.link], body.name.rpartition("/")[2]]
        positions, across = corners[begin:end], normals[begin:end]
        shape = rr.Mesh3D(vertex_positions=positions, vertex_normals=across, albedo_factor=color)
        stream.log(path, shape, static=True)


def log_poses(stream: Any, side: str, recording: Recording) -> None:
    """Log the poses of the links of one side, where they change."""
    import rerun as rr

    for link, name in enumerate(recording.layout.links):
        poses = recording.link_poses[:, link]
        rows = np.ones(len(poses), dtype=np.bool_)
        rows[1:] = (poses[1:] != poses[:-1]).any(axis=(1, 2))
        columns = rr.Transform3D.columns(
            translation=poses[rows][:, :3, 3], quaternion=recording.link_quaternions[rows, link]
        )
        send(stream, [side, "scene", name], recording.time[rows], np.flatnonzero(rows), columns)


def _log_curve(stream: Any, item: SignalDifference, curve: ComparedCurve, baseline: Recording) -> None:
    import rerun as rr

    time = np.round(curve.seconds * 1e9).astype(np.int64)
    frames = np.searchsorted(baseline.time, time)
    name = item.signal.full_name
    short = " ".join(part for part in (*item.signal.topic.split("/")[2:], item.signal.name) if part)
    values = ((BASELINE, curve.baseline), (CANDIDATE, curve.candidate), (DIFFERENCE, curve.error))
    for side, column in values:
        if side != DIFFERENCE and item.signal.field == "rotation":
            continue
        chart = _chart(item)
        path = [side, "values", chart, name] if side != DIFFERENCE else [side, chart, name]
        color = (*COLORS[side][:3], _OPAQUE) if side in COLORS else None
        title = f"{side}: {short}" if side != DIFFERENCE else short
        lines = rr.SeriesLines(names=title, colors=color, widths=3.0 if side == BASELINE else 1.5)
        stream.log(path, lines, static=True)
        send(stream, path, time, frames, rr.Scalars.columns(scalars=column))


def _log_marks(stream: Any, marks: list[_Mark]) -> None:
    import rerun as rr

    if not marks:
        return
    time = np.array([round(mark.at.time * 1e9) for mark in marks], dtype=np.int64)
    texts = [mark.text for mark in marks]
    texts[0] = f"first difference: {texts[0]}"
    columns = rr.TextLog.columns(text=texts, level=[mark.level for mark in marks])
    send(stream, [DIFFERENCE, "moments"], time, np.array([mark.at.frame for mark in marks]), columns)


def send(stream: Any, path: list[str], time: Integers, frames: NDArray[Any], *columns: Any) -> None:
    """Send columns of an entity at times (n,) [ns] and frames (n,)."""
    import rerun as rr

    index = [
        rr.TimeColumn(TIMELINE, duration=time.astype("timedelta64[ns]")),
        rr.TimeColumn("frame", sequence=frames),
    ]
    for group in columns:
        stream.send_columns(rr.new_entity_path(path), indexes=index, columns=group, strict=True)


def _marks(case: Case) -> Iterator[_Mark]:
    """Yield where to look: each event that differs, and where a number first and most differs."""
    for item in case.difference.signals:
        level = "ERROR" if item.decides else "INFO"
        name = item.signal.full_name
        if item.events:
            for event in item.events:
                yield _Mark(_when(event), "INFO" if event.allowed else "ERROR", f"{name}: {wording.event(event)}")
            continue
        yield _Mark(item.first, level, f"{name}: differs for the first time")
        worst = item.worst_abs
        if worst is not None and worst.at != item.first:
            error = wording.number(worst.error, item.signal.unit)
            yield _Mark(worst.at, level, f"{name}: differs most, by {error}")


def _when(event: EventDifference) -> Moment:
    at = event.baseline or event.candidate
    assert at is not None
    return at


def _chart(item: SignalDifference) -> str:
    """Return the chart that a signal is drawn in: one for each field, because a chart has one unit."""
    unit = f" [{item.signal.unit}]" if item.signal.unit else ""
    return f"{item.signal.topic.split('/')[1]} {item.signal.field}{unit}"


def _charts(name: str) -> Any:
    import rerun as rr
    import rerun.blueprint as rrb

    legend = rrb.PlotLegend(corner=rrb.Corner2D.RightTop)
    sides = [rr.new_entity_path([side, "values", name]) for side in (BASELINE, CANDIDATE)]
    return rrb.Vertical(
        rrb.TimeSeriesView(origin="/", contents=[f"+ {side}/**" for side in sides], name=name, plot_legend=legend),
        rrb.TimeSeriesView(origin=rr.new_entity_path([DIFFERENCE, name]), name="difference", plot_legend=legend),
        name=name,
    )


def _blueprint(marks: list[_Mark], charts: list[str], eye: Any) -> Any:
    import rerun as rr
    import rerun.blueprint as rrb
    from rerun.blueprint.encodings import TextLogColumn

    scene = scene_view(eye, name="Baseline blue, candidate orange", sides=[f"/{BASELINE}", f"/{CANDIDATE}"])
    moments = rrb.TextLogView(
        origin=f"/{DIFFERENCE}/moments",
        name="Moments",
        columns=rrb.TextLogColumns(text_log_columns=[TextLogColumn(kind) for kind in ("LogLevel", "Body")]),
    )
    below = rrb.Tabs(moments, rrb.TextDocumentView(origin="/summary", name="Summary"), active_tab=0 if marks else 1)
    parts = [rrb.Tabs(*map(_charts, charts), active_tab=0)] if charts else []
    selection: Any = None
    if marks:
        begin, end = (round(mark.at.time * 1e9) for mark in (marks[0], marks[-1]))
        selection = rr.encodings.AbsoluteTimeRange(min=begin, max=end)
    return rrb.Blueprint(
        rrb.Horizontal(scene, rrb.Vertical(*parts, below, row_shares=[3, 2][-len(parts) - 1 :]), column_shares=[3, 2]),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline=TIMELINE, time_selection=selection),
        auto_views=False,
    )
