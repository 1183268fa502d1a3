"""Frame blocks to a rerun recording for people's eyes: columns per entity, block by block, with its own layout.

Values are sent when they change (the viewer holds the last one), curves in every frame that has a value and once
after it, as NaN, so that gaps stay gaps. The bytes differ from run to run; the MCAP recording is the one to keep.
"""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from replay.collision.columns import Level
from replay.collision.passages import passages
from replay.numerics import transforms
from replay.numerics.arrays import Bytes, Flags, Floats
from replay.recording import blueprint
from replay.recording.blueprint_parts import recording_blueprint
from replay.recording.events import EventFinder
from replay.recording.rerun_columns import Chunks, Column, Index, column, entity, index_of, packed
from replay.recording.rerun_file import RerunFile
from replay.recording.rerun_scene import CURVES, beam_path, body_path, extent, log_curve, log_scene
from replay.recording.scene_view import SceneView
from replay.simulation import FrameBlock, Layout

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
        self._chunks: Any = None
        self._last: dict[str, Any] = {}
        self._named: set[tuple[str, str]] = set()
        self._taken: dict[str, set[int]] = {}
        self._indexes: dict[bytes, Index] = {}
        self._members = self._bodies_of_pairs()
        self._corners = np.zeros((0, 3))
        self._end = 0
        self._blocks = 0

    def prepare(self) -> None:
        """Begin the file with all that does not change."""
        self._stream = stream = self._file.open(APPLICATION)
        stream.send_recording_name(self._scene.name)
        self._chunks = Chunks()
        log_scene(self._chunks, self._scene, self._members)
        self._chunks.send(stream)

    def write(self, block: FrameBlock) -> None:
        """Append a block."""
        if self._stream is None:
            self.prepare()
        if self._blocks == 0:
            self._corners = extent(self._scene, block.link_poses)
        self._end = int(block.time[-1])
        self._indexes.clear()
        self._poses(block)
        self._colors(block)
        for kind, columns in block.readings.items():
            for chart, field in blueprint.CHARTED[kind].items():
                values = getattr(columns, field.name)
                if values is not None:
                    self._curves(block, chart, self._layout.sensors[kind], values, np.isfinite(values))
            for field in columns.fields():
                if field.beam:
                    self._beams(block, kind, getattr(columns, field.name))
        self._clearance(block)
        self._guards(block)
        titles = [f"{name} [{unit}]" for name, unit in zip(self._layout.joints, self._layout.joint_units, strict=True)]
        everywhere = np.ones(block.joint_positions.shape, dtype=np.bool_)
        self._curves(block, blueprint.JOINTS, self._layout.joints, block.joint_positions, everywhere, titles)
        self._log_events(block)
        self._chunks.send(self._stream)
        self._blocks += 1
        if self._blocks % _BLOCKS_UNWRITTEN == 0:
            self._file.flush()

    def finish(self) -> None:
        """Begin to finish the file in the background, with the arrangement of what was found."""
        if self._stream is not None:
            layout = recording_blueprint({chart for chart, _ in self._named}, self._corners, self._end)
            self._file.arrange(layout)
            self._stream = None
            self._file.finish()

    def commit(self) -> None:
        """Finish the recording and give the file its name; WriteError when not all of it reached the disk."""
        self.finish()
        self._file.commit()

    def discard(self) -> None:
        """Give the recording up and remove the unfinished file."""
        self._file.discard()

    def _send(self, block: FrameBlock, rows: Flags, path: str, *columns: Column) -> None:
        """Send columns that have a value in those rows of the block; rows alike share their times."""
        key = rows.tobytes()
        if key not in self._indexes:
            frames = np.flatnonzero(rows)
            self._indexes[key] = index_of(block.time[frames], block.first + frames)
        self._chunks.add(path, self._indexes[key], columns)

    def _changed(self, key: str, values: NDArray[Any]) -> Flags:
        """Return in which frames each of k values (n, k, ...) is not that of the frame before, (n, k)."""
        rows = np.ones(values.shape[:2], dtype=np.bool_)
        flat = values.reshape(*values.shape[:2], -1)
        rows[1:] = (flat[1:] != flat[:-1]).any(axis=2)
        if key in self._last:
            rows[0] = (flat[0] != self._last[key]).any(axis=1)
        self._last[key] = flat[-1].copy()
        return rows

    def _poses(self, block: FrameBlock) -> None:
        moved = self._changed("poses", block.link_poses).T
        link_of, frame_of = np.nonzero(moved)
        places = block.link_poses[frame_of, link_of, :3, 3].astype(np.float32)
        turns = block.link_quaternions[frame_of, link_of].astype(np.float32)
        end = 0
        for name, rows, count in zip(self._layout.links, moved, moved.sum(axis=1).tolist(), strict=True):
            begin, end = end, end + count
            if count:
                place = column("Transform3D", "translation", places[begin:end], 1)
                turn = column("Transform3D", "quaternion", turns[begin:end], 1)
                self._send(block, rows, entity(blueprint.SCENE, name), place, turn)

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
        if block.collision is None or not self._members:
            return
        pairs = np.concatenate(list(self._members.values()))
        begins = np.cumsum([0, *map(len, self._members.values())])[:-1]
        levels = np.maximum.reduceat(np.ascontiguousarray(block.collision.level.T)[pairs], begins)
        changed = self._changed("levels", levels.T).T
        warnings = LEVEL_COLORS[Level.BOUNDS], LEVEL_COLORS[Level.CONTACT]
        palettes = packed([color for k in self._members for color in (self._scene.bodies[k].color, *warnings)])
        for k, palette, rows, level in zip(self._members, palettes.reshape(-1, 3), changed, levels, strict=True):
            if rows.any():
                colors = column("Mesh3D", "albedo_factor", palette[level[rows]], 1)
                self._send(block, rows, body_path(self._scene, self._scene.bodies[k]), colors)
        self._flashes(block, palettes.reshape(-1, 3), levels)

    def _flashes(self, block: FrameBlock, palettes: NDArray[np.uint32], levels: Bytes) -> None:
        """Colour bodies while they are in a contact that no frame shows; `levels` are those of the frames (k, n)."""
        assert block.collision is not None
        found = passages(block.collision.crossings)
        for row, (k, pairs) in enumerate(self._members.items()):
            mine = np.flatnonzero(np.isin(found.pair, pairs))
            if len(mine):
                frames = np.repeat(found.frame[mine], 2)
                times = np.stack([found.begin[mine, 1], found.end[mine, 1]], axis=1).reshape(-1)
                after = levels[row, np.maximum(found.frame[mine] - block.first - 1, 0)]
                shown = np.stack([np.full(len(mine), Level.CONTACT), after], axis=1).reshape(-1)
                colors = column("Mesh3D", "albedo_factor", palettes[row][shown], 1)
                path = body_path(self._scene, self._scene.bodies[k])
                self._chunks.add(path, index_of(times, frames), [colors])

    def _beams(self, block: FrameBlock, kind: str, points: Floats) -> None:
        """Draw lines from the sensors of a kind to the points (n, S, 3) that they read; NaN is none."""
        drawn = {sensor.name: sensor for sensor in self._scene.sensors if sensor.kind == kind}
        names = self._layout.sensors[kind]
        shown = [sensor for sensor, name in enumerate(names) if name in drawn]
        if not shown:
            return
        placed = [drawn[names[sensor]] for sensor in shown]
        origins = np.stack([sensor.drawing.extent[0] for sensor in placed])
        begins = transforms.apply(block.link_poses[:, [sensor.link for sensor in placed]], origins)
        ends = np.stack([begins, points[:, shown]], axis=2)
        seen = np.asarray(np.isfinite(points[:, shown]).all(axis=2))
        changed = self._changed(f"beams {kind}", np.where(seen[:, :, None, None], ends, 0.0))
        for place, sensor in enumerate(shown):
            rows = changed[:, place]
            if rows.any():
                lines = ends[rows & seen[:, place], place]
                lengths = seen[rows, place].astype(np.int64)  # no strip at all while nothing is seen
                strips = column("LineStrips3D", "strips", lines, lengths, 2)
                tips = column("Points3D", "positions", lines[:, 1], lengths)
                self._send(block, rows, beam_path(names[sensor]), strips, tips)

    def _clearance(self, block: FrameBlock) -> None:
        if block.collision is not None:
            columns = block.collision
            self._curves(block, blueprint.CLEARANCE, self._layout.pairs, columns.clearance, columns.evaluated)

    def _guards(self, block: FrameBlock) -> None:
        """Append the clocks of joints that are slowed down, and the thresholds at which that begins."""
        if block.guards is None:
            return
        slowed = [k for k, name in enumerate(self._layout.joints) if name in self._scene.slowed]
        rate = block.guards.rate[:, slowed]
        names = [self._layout.joints[k] for k in slowed]
        self._curves(block, blueprint.CLOCKS, names, rate, np.ones(rate.shape, dtype=np.bool_))
        ends = np.zeros(len(block.time), dtype=np.bool_)
        ends[[0, -1]] = True
        for chart, name, value in self._scene.thresholds:
            path = entity(chart, name)
            if (chart, name) not in self._named:
                log_curve(self._chunks, path, name, self._number_of(chart, name))
                self._named.add((chart, name))
            self._send(block, ends, path, column("Scalars", "scalars", np.full(int(ends.sum()), value), 1))

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
        rows = present.copy()
        rows[1:] |= present[:-1]
        rows[0] |= self._last.get(chart, False)
        self._last[chart] = present[-1].copy()
        shown = np.where(present, values, np.nan).T
        for k in np.flatnonzero(rows.any(axis=0)).tolist():
            path = entity(chart, names[k])
            if (chart, names[k]) not in self._named:
                log_curve(self._chunks, path, (titles or names)[k], self._number_of(chart, names[k]))
                self._named.add((chart, names[k]))
            here = rows[:, k]
            self._send(block, here, path, column("Scalars", "scalars", shown[k, here], 1))

    def _number_of(self, chart: str, name: str) -> int:
        """Return the number of a new curve's colour: it follows from its name, unless another of the chart has it."""
        taken = self._taken.setdefault(chart, set())
        first = zlib.crc32(name.encode()) % len(CURVES)
        numbers = ((first + k) % len(CURVES) for k in range(len(CURVES)))
        number = next((one for one in numbers if one not in taken), first)
        taken.add(number)
        return number

    def _log_events(self, block: FrameBlock) -> None:
        events = self._events.find(block)
        if not len(events):
            return
        texts = [what.text for what in events.transitions]
        levels = [_LOG_LEVELS[what.severity] for what in events.transitions]
        codes = events.code.tolist()
        lines = [f"{time / 1e9:.3f} s  {texts[code]}" for time, code in zip(events.time.tolist(), codes, strict=True)]
        text, level = column("TextLog", "text", lines, 1), column("TextLog", "level", [levels[k] for k in codes], 1)
        self._chunks.add(blueprint.EVENTS, index_of(events.time, events.frame), [text, level])
