"""Frame blocks to a rerun recording for people's eyes: columns per entity, block by block, with its own layout.

Values are sent when they change (the viewer holds the last one), curves in every frame that has a value and once
after it, as NaN, so that gaps stay gaps. The bytes differ from run to run; the MCAP recording is the one to keep.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from replay.collision.columns import Level
from replay.numerics import transforms
from replay.recording import blueprint
from replay.recording.events import EventFinder
from replay.recording.rerun_file import RerunFile
from replay.recording.rerun_scene import body_path, extent, log_curve, log_scene
from replay.recording.scene_view import SceneView
from replay.sensing.columns import Detection
from replay.simulation import FrameBlock, Layout

Flags = NDArray[np.bool_]
Floats = NDArray[np.float64]

APPLICATION = "replay"
LEVEL_COLORS = {Level.BOUNDS: (255, 150, 20, 255), Level.CONTACT: (235, 35, 35, 255)}
"""Colours of a body while one of its pairs is at that level."""

_BLOCKS_UNWRITTEN = 8  # the library would take blocks faster than a slow disk, and memory would grow
_LOG_LEVELS = {2: "INFO", 3: "WARN", 4: "ERROR"}


class RerunWriter:
    """Writes one rerun recording: NAME.rrd.part while it grows, NAME.rrd when it is whole."""

    def __init__(self, path: str | Path, layout: Layout, scene: SceneView, *, overwrite: bool = False) -> None:
        """Create the file.

        Raises:
            RecordingExistsError: it exists and may not be overwritten.
            WriteError: the file cannot be written.
        """
        self._file = RerunFile(path, overwrite=overwrite)
        self._layout = layout
        self._scene = scene
        self._events = EventFinder(layout)
        self._stream: Any = None
        self._last: dict[str, Any] = {}
        self._named: set[tuple[str, str]] = set()
        self._index: list[Any] = []
        self._members = self._bodies_of_pairs()
        self._corners = np.zeros((0, 3))
        self._end = 0
        self._blocks = 0

    def prepare(self) -> None:
        """Begin the file with all that does not change."""
        self._stream = stream = self._file.open(APPLICATION)
        stream.send_recording_name(self._scene.name)
        log_scene(stream, self._scene, self._members)

    def write(self, block: FrameBlock) -> None:
        """Append a block."""
        if self._stream is None:
            self.prepare()
        if self._blocks == 0:
            self._corners = extent(self._scene, block.link_poses[0])
        self._end = int(block.time[-1])
        self._index = _index(block.time, block.first + np.arange(len(block.time)))
        self._poses(block)
        self._colors(block)
        self._distance(block)
        self._capacitive(block)
        self._clearance(block)
        titles = [f"{name} [{unit}]" for name, unit in zip(self._layout.joints, self._layout.joint_units, strict=True)]
        everywhere = np.ones(block.joint_positions.shape, dtype=np.bool_)
        self._curves(block, blueprint.JOINTS, self._layout.joints, block.joint_positions, everywhere, titles)
        self._log_events(block)
        self._blocks += 1
        if self._blocks % _BLOCKS_UNWRITTEN == 0:
            self._file.flush()

    def close(self) -> None:
        """Finish the recording and give the file its name; WriteError when not all of it reached the disk."""
        if self._stream is not None:
            charts = sorted({chart for chart, _ in self._named})
            self._stream.send_blueprint(blueprint.blueprint(charts, self._corners, self._end), make_active=False)
        self._file.commit()

    def discard(self) -> None:
        """Give the recording up and remove the unfinished file."""
        self._file.discard()

    def _send(self, block: FrameBlock, rows: Flags, path: list[str], *columns: Any) -> None:
        import rerun as rr

        index = self._index
        if not rows.all():
            index = _index(block.time[rows], block.first + np.flatnonzero(rows))
        for group in columns:
            self._stream.send_columns(rr.new_entity_path(path), indexes=index, columns=group, strict=True)

    def _changed(self, key: str, values: NDArray[Any]) -> Flags:
        """Return in which frames each of k values (n, k, ...) is not that of the frame before, (n, k)."""
        rows = np.ones(values.shape[:2], dtype=np.bool_)
        inner = tuple(range(2, values.ndim))
        rows[1:] = (values[1:] != values[:-1]).any(axis=inner)
        if key in self._last:
            rows[0] = (values[0] != self._last[key]).any(axis=tuple(axis - 1 for axis in inner))
        self._last[key] = values[-1].copy()
        return rows

    def _poses(self, block: FrameBlock) -> None:
        import rerun as rr

        moved = self._changed("poses", block.link_poses)
        quaternions = transforms.to_quaternion(block.link_poses)
        for link in np.flatnonzero(moved.any(axis=0)).tolist():
            rows = moved[:, link]
            columns = rr.Transform3D.columns(
                translation=block.link_poses[rows, link, :3, 3], quaternion=quaternions[rows, link]
            )
            self._send(block, rows, [blueprint.SCENE, self._layout.links[link]], columns)

    def _bodies_of_pairs(self) -> dict[int, list[int]]:
        """Return, for each drawn body that is in a pair, the pairs that it is in."""
        members: dict[int, list[int]] = {}
        index = {body.name: k for k, body in enumerate(self._scene.bodies)}
        for pair, name in enumerate(self._layout.pairs):
            for shape in name.split("|"):
                if shape in index:
                    members.setdefault(index[shape], []).append(pair)
        return members

    def _colors(self, block: FrameBlock) -> None:
        import rerun as rr

        if block.collision is None or not self._members:
            return
        levels = np.stack([block.collision.level[:, pairs].max(axis=1) for pairs in self._members.values()], axis=1)
        changed = self._changed("levels", levels)
        for column, k in enumerate(self._members):
            rows = changed[:, column]
            if rows.any():
                body = self._scene.bodies[k]
                palette = [body.color, LEVEL_COLORS[Level.BOUNDS], LEVEL_COLORS[Level.CONTACT]]
                colors = np.array(palette, dtype=np.uint8)[levels[rows, column]]
                self._send(block, rows, body_path(self._scene, body), rr.Mesh3D.columns(albedo_factor=colors))

    def _distance(self, block: FrameBlock) -> None:
        import rerun as rr

        if block.distance is None:
            return
        names, seen = self._layout.distance_sensors, block.distance.status != Detection.NOTHING
        self._curves(block, blueprint.DISTANCE, names, block.distance.distance, seen)
        cones = {cone.sensor: cone for cone in self._scene.cones}
        shown = [sensor for sensor, name in enumerate(names) if name in cones]
        if not shown:
            return
        apexes = [
            transforms.compose(block.link_poses[:, cones[names[k]].link], cones[names[k]].T_link_sensor)[:, :3, 3]
            for k in shown
        ]
        ends = np.stack([np.stack(apexes, axis=1), block.distance.point[:, shown]], axis=2)
        changed = self._changed("beams", np.where(seen[:, shown, None, None], ends, 0.0))
        for column, sensor in enumerate(shown):
            rows = changed[:, column]
            if rows.any():
                drawn = ends[rows & seen[:, sensor], column]
                lengths = seen[rows, sensor].astype(np.int64)  # no strip at all while nothing is seen
                strips = rr.LineStrips3D.columns(strips=drawn).partition(lengths)
                points = rr.Points3D.columns(positions=drawn[:, 1]).partition(lengths)
                self._send(block, rows, [blueprint.SCENE, "closest_points", names[sensor]], strips, points)

    def _capacitive(self, block: FrameBlock) -> None:
        if block.capacitive is not None:
            values = block.capacitive.delta_output
            self._curves(block, blueprint.CAPACITIVE, self._layout.capacitive_sensors, values, np.isfinite(values))

    def _clearance(self, block: FrameBlock) -> None:
        if block.collision is not None:
            columns = block.collision
            self._curves(block, blueprint.CLEARANCE, self._layout.pairs, columns.clearance, columns.evaluated)

    def _curves(
        self,
        block: FrameBlock,
        chart: str,
        names: Sequence[str],
        values: Floats,
        present: Flags,
        titles: Sequence[str] | None = None,
    ) -> None:
        """Append curves (n, k) to a chart where they have a value, `present`; `titles` are the names if left out."""
        import rerun as rr

        rows = present.copy()
        rows[1:] |= present[:-1]
        rows[0] |= self._last.get(chart, False)
        self._last[chart] = present[-1].copy()
        for k in np.flatnonzero(rows.any(axis=0)).tolist():
            path = [chart, names[k]]
            if (chart, names[k]) not in self._named:
                log_curve(self._stream, path, (titles or names)[k], self._number_of(chart))
                self._named.add((chart, names[k]))
            here = rows[:, k]
            shown = np.where(present[here, k], values[here, k], np.nan)
            self._send(block, here, path, rr.Scalars.columns(scalars=shown))

    def _number_of(self, chart: str) -> int:
        """Return the number of the curve that is added to a chart next."""
        return sum(named == chart for named, _ in self._named)

    def _log_events(self, block: FrameBlock) -> None:
        import rerun as rr

        events = self._events.find(block)
        if not events:
            return
        index = _index(events.time, events.frame)
        texts = [what.text for what in events.transitions]
        levels = [_LOG_LEVELS[what.severity] for what in events.transitions]
        codes = events.code.tolist()
        columns = rr.TextLog.columns(
            text=[f"{time / 1e9:.3f} s  {texts[code]}" for time, code in zip(events.time.tolist(), codes, strict=True)],
            level=[levels[code] for code in codes],
        )
        self._stream.send_columns(blueprint.EVENTS, indexes=index, columns=columns, strict=True)


def _index(time: NDArray[np.int64], frames: NDArray[np.int64]) -> list[Any]:
    import rerun as rr

    return [
        rr.TimeColumn(blueprint.TIMELINE, duration=time.astype("timedelta64[ns]")),
        rr.TimeColumn("frame", sequence=frames),
    ]
