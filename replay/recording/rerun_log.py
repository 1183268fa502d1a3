"""Frame blocks to a rerun recording for people's eyes: columns per entity, block by block, with its own layout.

Values are sent when they change (the viewer holds the last one), curves in every frame that has a value and once
after it, as NaN, so that gaps stay gaps. The bytes differ from run to run; the MCAP recording is the one to keep.
"""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from replay.collision.columns import Level
from replay.errors import WriteError
from replay.logs.part_file import PartFile
from replay.numerics import transforms
from replay.recording import blueprint
from replay.recording.events import EventFinder
from replay.recording.rerun_scene import body_path, extent, log_curve, log_scene
from replay.recording.scene_view import SceneView
from replay.sensing.columns import Detection
from replay.simulation import FrameBlock, Layout

Flags = NDArray[np.bool_]
Floats = NDArray[np.float64]

APPLICATION = "replay"
LEVEL_COLORS = {Level.BOUNDS: (255, 150, 20, 255), Level.CONTACT: (235, 35, 35, 255)}
"""Colours of a body while one of its pairs is at that level."""

_FLUSH = 20.0  # [s] until what is left must have reached the disk
_LOG_LEVELS = {2: "INFO", 3: "WARN", 4: "ERROR"}


class RerunWriter:
    """Writes one rerun recording: NAME.rrd.part while it grows, NAME.rrd when it is whole."""

    def __init__(self, path: str | Path, layout: Layout, scene: SceneView, *, overwrite: bool = False) -> None:
        """Create the file.

        Raises:
            RecordingExistsError: it exists and may not be overwritten.
            WriteError: the file cannot be written.
        """
        self._file = PartFile(Path(path), overwrite=overwrite)
        self._layout = layout
        self._scene = scene
        self._events = EventFinder(layout)
        self._stream: Any = None
        self._last: dict[str, Any] = {}
        self._curves: set[tuple[str, ...]] = set()
        self._members = self._bodies_of_pairs()
        self._corners = np.zeros((0, 3))
        self._end = 0

    def write(self, block: FrameBlock) -> None:
        """Append a block."""
        if self._stream is None:
            self._stream = self._begin(block)
        self._end = int(block.time[-1])
        self._poses(block)
        self._colors(block)
        self._distance(block)
        self._capacitive(block)
        self._clearance(block)
        for joint, name in enumerate(self._layout.joints):
            everywhere = np.ones(len(block.time), dtype=np.bool_)
            unit = self._layout.joint_units[joint]
            self._curve(
                block, [blueprint.JOINTS, name], f"{name} [{unit}]", block.joint_positions[:, joint], everywhere
            )
        self._log_events(block)

    def close(self) -> None:
        """Finish the recording and give the file its name; WriteError when not all of it reached the disk."""
        if self._stream is not None:
            charts = sorted({path[0] for path in self._curves})
            self._stream.send_blueprint(blueprint.blueprint(charts, self._corners, self._end), make_active=False)
            try:  # on a full disk the library's writing thread is gone, and may leave a flush without an answer
                self._stream.flush(timeout_sec=_FLUSH)
            except Exception as error:
                raise WriteError(str(self._file.path), f"not all of it was written: {error}") from None
            self._stream.disconnect()
            self._check_footer()
        self._file.commit()

    def discard(self) -> None:
        """Give the recording up and remove the unfinished file."""
        if self._stream is not None:
            self._stream.disconnect()
        self._file.discard()

    def _begin(self, block: FrameBlock) -> Any:
        import rerun as rr

        stream = rr.RecordingStream(APPLICATION)
        self._corners = extent(self._scene, block.link_poses[0])
        # The library opens the file that is already there anew, so that the name, its folder and its rights are proven.
        try:
            stream.save(self._file.part)
        except RuntimeError as error:
            raise WriteError(str(self._file.path), str(error)) from None
        stream.send_recording_name(self._scene.name)
        log_scene(stream, self._scene, self._members if block.collision is not None else ())
        return stream

    def _check_footer(self) -> None:
        """Read the end of the file back: the library only logs that a disk is full."""
        from rerun.chunk import RrdReader

        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error")
                RrdReader(str(self._file.part)).recordings()
        except Exception as error:  # a missing footer is a warning of its own class, damage any of several errors
            raise WriteError(str(self._file.path), f"it did not reach the disk whole ({error})") from None

    def _send(self, block: FrameBlock, rows: Flags, path: list[str], *columns: Any) -> None:
        import rerun as rr

        index = [
            rr.TimeColumn(blueprint.TIMELINE, duration=block.time[rows].astype("timedelta64[ns]")),
            rr.TimeColumn("frame", sequence=block.first + np.flatnonzero(rows)),
        ]
        for group in columns:
            self._stream.send_columns(rr.new_entity_path(path), indexes=index, columns=group, strict=True)

    def _changed(self, key: str, values: NDArray[Any]) -> Flags:
        """Return the frames (n,) whose values (n, ...) are not those of the frame before, blocks before included."""
        flat = values.reshape(len(values), -1)
        rows = np.ones(len(flat), dtype=np.bool_)
        rows[1:] = (flat[1:] != flat[:-1]).any(axis=1)
        if key in self._last:
            rows[0] = bool((flat[0] != self._last[key]).any())
        self._last[key] = flat[-1].copy()
        return rows

    def _poses(self, block: FrameBlock) -> None:
        import rerun as rr

        for link, name in enumerate(self._layout.links):
            poses = block.link_poses[:, link]
            rows = self._changed(f"pose {name}", poses)
            if rows.any():
                columns = rr.Transform3D.columns(
                    translation=poses[rows][:, :3, 3], quaternion=transforms.to_quaternion(poses[rows])
                )
                self._send(block, rows, [blueprint.SCENE, name], columns)

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

        if block.collision is None:
            return
        for k, pairs in self._members.items():
            body = self._scene.bodies[k]
            level = block.collision.level[:, pairs].max(axis=1)
            rows = self._changed(f"level {body.name}", level)
            palette = [body.color, LEVEL_COLORS[Level.BOUNDS], LEVEL_COLORS[Level.CONTACT]]
            if rows.any():
                colors = np.array(palette, dtype=np.uint8)[level[rows]]
                self._send(block, rows, body_path(self._scene, body), rr.Mesh3D.columns(albedo_factor=colors))

    def _distance(self, block: FrameBlock) -> None:
        import rerun as rr

        if block.distance is None:
            return
        cones = {cone.sensor: cone for cone in self._scene.cones}
        for sensor, name in enumerate(self._layout.distance_sensors):
            seen = block.distance.status[:, sensor] != Detection.NOTHING
            self._curve(block, [blueprint.DISTANCE, name], name, block.distance.distance[:, sensor], seen)
            if name not in cones:
                continue
            apex = transforms.compose(block.link_poses[:, cones[name].link], cones[name].T_link_sensor)[:, :3, 3]
            ends = np.stack([apex, block.distance.point[:, sensor]], axis=1)
            rows = self._changed(f"beam {name}", np.where(seen[:, None, None], ends, 0.0))
            if rows.any():
                shown = seen[rows]
                lengths = shown.astype(np.int64)  # no strip at all while nothing is seen
                strips = rr.LineStrips3D.columns(strips=ends[rows & seen]).partition(lengths)
                points = rr.Points3D.columns(positions=ends[rows & seen][:, 1]).partition(lengths)
                self._send(block, rows, [blueprint.SCENE, "closest_points", name], strips, points)

    def _capacitive(self, block: FrameBlock) -> None:
        for sensor, name in enumerate(self._layout.capacitive_sensors if block.capacitive is not None else ()):
            assert block.capacitive is not None
            values = block.capacitive.delta_output[:, sensor]
            self._curve(block, [blueprint.CAPACITIVE, name], name, values, np.isfinite(values))

    def _clearance(self, block: FrameBlock) -> None:
        for pair, name in enumerate(self._layout.pairs if block.collision is not None else ()):
            assert block.collision is not None
            evaluated = block.collision.evaluated[:, pair]
            self._curve(block, [blueprint.CLEARANCE, name], name, block.collision.clearance[:, pair], evaluated)

    def _curve(self, block: FrameBlock, path: list[str], name: str, values: Floats, present: Flags) -> None:
        import rerun as rr

        key = f"curve {path[0]} {path[1]}"
        rows = present.copy()
        rows[1:] |= present[:-1]
        rows[0] |= self._last.get(key, False)
        self._last[key] = bool(present[-1])
        if not rows.any():
            return
        if tuple(path) not in self._curves:
            self._curves.add(tuple(path))
            log_curve(self._stream, path, name)
        shown = np.where(present, values, np.nan)[rows]
        self._send(block, rows, path, rr.Scalars.columns(scalars=shown))

    def _log_events(self, block: FrameBlock) -> None:
        import rerun as rr

        events = self._events.find(block)
        if not events:
            return
        index = [
            rr.TimeColumn(blueprint.TIMELINE, duration=events.time.astype("timedelta64[ns]")),
            rr.TimeColumn("frame", sequence=events.frame),
        ]
        texts = [what.text for what in events.transitions]
        levels = [_LOG_LEVELS[what.severity] for what in events.transitions]
        codes = events.code.tolist()
        columns = rr.TextLog.columns(
            text=[f"{time / 1e9:.3f} s  {texts[code]}" for time, code in zip(events.time.tolist(), codes, strict=True)],
            level=[levels[code] for code in codes],
        )
        self._stream.send_columns(blueprint.EVENTS, indexes=index, columns=columns, strict=True)
