"""Recorded motion: which joint or frame of a log moves which joint of the scenario, checked and converted to SI."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from typing import TYPE_CHECKING

import numpy as np

from replay.errors import Problem, count
from replay.kinematics.motion import FreeTrack, Track
from replay.language.node import KeyPath
from replay.language.units import ANGLE, LENGTH
from replay.logs.csv_table import unit_of
from replay.logs.joint_csv import read_csv
from replay.logs.joint_log import Choice, JointLog, read_messages
from replay.logs.message_log import MessageLog
from replay.numerics.arrays import Floats
from replay.scenario.log_file import LogFile, csv_format, open_log, reading
from replay.scenario.names import SCALAR_JOINTS
from replay.scenario.problems import did_you_mean
from replay.scenario.recorded_followers import deviations, of_the_same_name
from replay.scenario.recorded_frames import pose_track
from replay.scenario.recorded_series import Unusable, Window, check_turns, in_window, unwrapped
from replay.scenario.script import linkage
from replay.scenario.source import Library

if TYPE_CHECKING:
    from replay.scenario.model import Scenario
    from replay.scenario.motion import RecordedFramePart, RecordedJointPart, RecordedPart

PATH = ("motion", "recorded")
_OF_TABLES = ("time", "separator", "decimal")
_OF_MESSAGES = ("topic", "channel", "frame_id", "free")


@dataclass
class RecordedMotion:
    """What a log says of a scenario's motion.

    Attributes:
        tracks: by joint.
        free: by free joint.
        problems: what is wrong; with any, the rest is of no use.
        notes: what a reader should know.
        excerpt: a file with what the scenario needs of the log.
        origin: name and SHA-256 of the file that the log is, or was cut out of.
        published: whether the log is one of messages.
        rows, headings: of a table, what the scenario needs of it.
    """

    tracks: dict[str, Track] = field(default_factory=dict)
    free: dict[str, FreeTrack] = field(default_factory=dict)
    problems: list[Problem] = field(default_factory=list)
    notes: list[Problem] = field(default_factory=list)
    excerpt: bytes = b""
    origin: Mapping[str, str] = field(default_factory=dict)
    published: bool = False
    rows: tuple[int, ...] = ()
    headings: tuple[str, ...] = ()


def read(scenario: Scenario, library: Library, name: str) -> RecordedMotion:
    """Return what the log of a scenario says.

    Args:
        scenario: with `motion.recorded`.
        library: where its files are.
        name: of the log in the library: a file, or a ROS 2 bag's folder.
    """
    return _MotionReader(scenario, library, name).found()


class _MotionReader:
    """Reads one scenario's log."""

    def __init__(self, scenario: Scenario, library: Library, name: str) -> None:
        assert scenario.motion.recorded is not None
        self._scenario = scenario
        self._written: RecordedPart = scenario.motion.recorded
        self._library = library
        self._name = name
        self._linkage = linkage(scenario)
        self._found = RecordedMotion()
        self._rows: set[int] = set()

    def found(self) -> RecordedMotion:
        """Return what it says."""
        found = self._found
        try:
            log, digest = self._read()
            joints, window = self._joints(log), self._window(log)
        except Unusable as error:
            self._wrong(error)
            return found
        for joint, source in joints.items():
            try:
                found.tracks[joint] = self._track(joint, source, log, window)
            except Unusable as error:
                self._wrong(error)
        if self._linkage.followers and not found.problems:
            self._compare_followers(log, window)
        for link, frame in self._written.free.items():
            try:
                joint, track = self._free_track(link, frame, log, window)
                found.free[joint] = track
            except Unusable as error:
                self._wrong(error)
        if log.left_out:
            rule = f"begins with {count(log.left_out, 'sample')} stamped 0, before its clock was there; left out"
            self._note((*PATH, "file"), rule)
        if not found.problems:
            found.origin = dict(log.origin) or {"name": self._name, "sha256": digest}
            found.published, found.headings = log.published, log.headings
            found.rows = tuple(sorted({*log.anchor, *self._rows}))
            found.excerpt = log.cut(found.rows, found.origin)
        return found

    def _read(self) -> tuple[JointLog, str]:
        """Return the log and the SHA-256 of its file, or of the list of files of its folder."""
        written = self._written
        of_tables = {option: getattr(written, option) for option in _OF_TABLES}
        of_messages = {option: getattr(written, option) for option in _OF_MESSAGES}
        file = open_log(self._library, self._name, PATH, of_tables=of_tables, of_messages=of_messages)
        with reading(PATH):
            return self._joint_log(file), file.sha256

    def _joint_log(self, file: LogFile) -> JointLog:
        written = self._written
        if file.messages is not None:
            return self._of_messages(file.shown, file.messages)
        format = csv_format(written.time, written.separator, written.decimal)
        needed = {joint.name for joint in written.joints.values()} | self._linkage.followers.keys()
        needed = needed if written.joints else set(self._scalar_joints())
        return read_csv(file.shown, file.table, format, needed, self._max_gap)

    def _of_messages(self, shown: str, log: MessageLog) -> JointLog:
        written = self._written
        joints = True if written.joints or not written.free else None
        choice = Choice(joints, bool(written.free), written.topic, written.channel, written.frame_id, self._max_gap)
        return read_messages(shown, log, choice)

    @property
    def _max_gap(self) -> int:
        return _nanoseconds(self._written.max_gap)

    def _window(self, log: JointLog) -> Window:
        begin = log.begin + _nanoseconds(self._written.start)
        if begin > log.end:
            rule = f"is after the log's last sample, {(log.end - log.begin) / 1e9:.6g} s after its first"
            raise Unusable((*PATH, "start"), rule)
        end = begin + math.ceil(Fraction(self._scenario.duration) * 10**9)
        return Window(log.begin, begin, end, self._max_gap, log.published)

    def _joints(self, log: JointLog) -> dict[str, RecordedJointPart]:
        """Return the log's joint by joint of the scenario: as written, or those of the same name."""
        from replay.scenario.motion import RecordedJointPart

        if self._written.joints:
            return dict(self._written.joints)
        common = {}
        for mine in self._scalar_joints():
            theirs = of_the_same_name(mine, log)
            if theirs and not self._scripted(mine) and mine not in self._linkage.followers:
                common[mine] = RecordedJointPart(name=theirs)
        if not common and not self._written.free:
            rule = f"has no joint of the scenario's names; it has {sorted(log.joints)}"
            raise Unusable((*PATH, "file"), f"{rule}: name them in motion.recorded.joints")
        return common

    def _scalar_joints(self) -> dict[str, str]:
        """Return the types of the joints that have a position, by name."""
        joints = ((link.joint.name or name, link.joint.type) for name, link in self._scenario.links.items())
        return {name: kind for name, kind in joints if kind in SCALAR_JOINTS}

    def _scripted(self, joint: str) -> str:
        motion = self._scenario.motion
        if joint in motion.points:
            return "motion.points"
        return "motion.moves" if any(joint in self._scenario.target(move) for move in motion.moves) else ""

    def _track(self, joint: str, source: RecordedJointPart, log: JointLog, window: Window) -> Track:
        path = (*PATH, "joints", joint)
        mine = self._scalar_joints()
        if joint not in mine:
            raise Unusable(path, f"is no joint with a position; {did_you_mean(joint, mine, what='joints are')}")
        if joint in self._linkage.followers:
            leader = self._linkage.followers[joint].joint
            raise Unusable(path, f"is a joint that follows {leader!r}, which alone moves it; name the joint that leads")
        if other := self._scripted(joint):
            raise Unusable(path, f"is a joint that {other} moves as well; keep one of the two")
        if source.name not in log.joints:
            rule = did_you_mean(source.name, log.joints, what="its joints are")
            raise Unusable((*path, "name"), f"is not in the log; {rule}")
        dimension = LENGTH if mine[joint] == "prismatic" else ANGLE
        if source.unit is not None and source.unit not in dimension.units:
            rule = f"is no unit of joint {joint!r}, which is {mine[joint]}; units are {', '.join(dimension.units)}"
            raise Unusable((*path, "unit"), rule)
        seconds, position = self._positions(path, mine[joint], source, log, window)
        if mine[joint] == "revolute":
            self._note_jumps(path, seconds, position)
        return Track(seconds, position, self._tolerance(path, joint, mine[joint], position))

    def _positions(
        self, path: KeyPath, kind: str, source: RecordedJointPart, log: JointLog, window: Window
    ) -> tuple[Floats, Floats]:
        """Return times (n,) [s] and positions (n,) [rad or m] that the log has of a joint of a kind."""
        dimension = LENGTH if kind == "prismatic" else ANGLE
        headed = unit_of(source.name)[1]
        factor = dimension.units[source.unit or (headed if headed in dimension.units else dimension.si)]
        series = in_window(path, log.joints[source.name], window)
        self._rows.update(series.row.tolist())
        value = series.value
        if kind == "continuous":
            value = unwrapped(value, float(ANGLE.units["deg"] * 360 / factor))
        position = value if factor == 1 else value * float(factor)
        if window.published:
            check_turns(path, series.time, position)
        return window.seconds(series.time), position

    def _compare_followers(self, log: JointLog, window: Window) -> None:
        from replay.scenario.motion import RecordedJointPart

        path = (*PATH, "file")

        def read(kind: str, name: str) -> tuple[Floats, Floats]:
            return self._positions(path, kind, RecordedJointPart(name=name), log, window)

        joints = {joint.name: joint for joint in self._linkage.joints}
        for rule in deviations(joints, self._linkage.followers, self._found.tracks, log, read):
            self._note(path, rule)

    def _note_jumps(self, path: KeyPath, seconds: np.ndarray, position: np.ndarray) -> None:
        jumps = np.flatnonzero(np.abs(np.diff(position)) > math.pi)
        if len(jumps):
            step = float(position[jumps[0] + 1] - position[jumps[0]])
            more = f", and {len(jumps) - 1} more" if len(jumps) > 1 else ""
            rule = f"jumps by {step:.4g} rad between two samples at {seconds[jumps[0]]:.6g} s{more}"
            self._note(path, f"{rule}; if its encoder wraps there, the joint is of type continuous")

    def _tolerance(self, path: KeyPath, joint: str, kind: str, position: np.ndarray) -> float:
        """Return how far a joint may be beyond its limits [rad or m], and note where it is."""
        dimension = LENGTH if kind == "prismatic" else ANGLE
        written = self._written.limit_tolerance
        value = written.value if written.dimension in (None, dimension) else 1e-4
        limits = next(link.joint for name, link in self._scenario.links.items() if (link.joint.name or name) == joint)
        over = float(position.max()) - getattr(limits, "upper", math.inf)
        under = getattr(limits, "lower", -math.inf) - float(position.min())
        if 0.0 < max(over, under) <= value:
            rule = f"is beyond a limit by up to {max(over, under):.3g} {dimension.si}, within limit_tolerance"
            self._note(path, f"{rule} = {value:.3g} {dimension.si}")
        return value

    def _free_track(self, link: str, frame: RecordedFramePart, log: JointLog, window: Window) -> tuple[str, FreeTrack]:
        path = (*PATH, "free", link)
        joints = {name: part.joint for name, part in self._scenario.links.items() if part.joint.type == "free"}
        if link not in joints:
            raise Unusable(path, f"is no link with a free joint; {did_you_mean(link, joints, what='such links are')}")
        joint = joints[link].name or link
        if joint in self._scenario.motion.free:
            raise Unusable(path, "is a link that motion.free moves as well; keep one of the two")
        child, parent = ((name or "").removeprefix("/") for name in (frame.child or link, frame.parent))
        track, rows = pose_track(path, log.frames, child, parent, window)
        self._rows.update(rows)
        return joint, track

    def _wrong(self, error: Unusable) -> None:
        self._found.problems.append(self._scenario.provenance.problem(error.path, error.rule))

    def _note(self, path: KeyPath, rule: str) -> None:
        self._found.notes.append(self._scenario.provenance.problem(path, rule))


def _nanoseconds(seconds: float) -> int:
    """Return a time that was written in decimal, exactly."""
    return round(Fraction(repr(seconds)) * 10**9)
