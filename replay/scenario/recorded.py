"""Recorded motion: which joint of a log moves which joint of the scenario, checked and converted to SI."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from replay.errors import Problem, RecordingError
from replay.kinematics.motion import Track
from replay.logs.joint_log import DEFAULT_TOPIC, JointTrack, read_csv, read_mcap
from replay.scenario.names import SCALAR_JOINTS
from replay.scenario.problems import did_you_mean
from replay.scenario.units import ANGLE, LENGTH, TIME

if TYPE_CHECKING:
    from replay.scenario.model import Scenario
    from replay.scenario.motion import RecordedJoint

PATH = ("motion", "recorded")


class Unusable(Exception):
    """A part of the recorded motion cannot be used: the path of the language, and the rule that is broken."""

    def __init__(self, path: tuple[str | int, ...], rule: str) -> None:
        self.path = path
        self.rule = rule
        super().__init__(rule)


def tracks(scenario: Scenario, file: str, data: bytes) -> tuple[dict[str, Track], list[Problem]]:
    """Return the track of each joint that a log moves, and what is wrong.

    Args:
        scenario: with `motion.recorded`.
        file: name of the log, for messages.
        data: its bytes.
    """
    written = scenario.motion.recorded
    assert written is not None
    found: dict[str, Track] = {}
    problems: list[Problem] = []
    try:
        log = _read(scenario, file, data)
        joints = dict(written.joints) or _same_names(scenario, log)
        begin = _begin(written.start, log)
    except Unusable as error:
        return found, [scenario.provenance.problem(error.path, error.rule)]
    for joint, source in joints.items():
        try:
            found[joint] = _track(scenario, joint, source, log, begin)
        except Unusable as error:
            problems.append(scenario.provenance.problem(error.path, error.rule))
    return found, problems


def _read(scenario: Scenario, file: str, data: bytes) -> dict[str, JointTrack]:
    written = scenario.motion.recorded
    assert written is not None
    kind = file.rpartition(".")[2].lower()
    if kind not in ("mcap", "csv"):
        raise Unusable((*PATH, "file"), "is neither a .mcap nor a .csv file")
    if kind == "mcap" and written.time is not None:
        raise Unusable((*PATH, "time"), "has no effect with a .mcap file, whose messages carry their times")
    if kind == "csv" and written.topic is not None:
        raise Unusable((*PATH, "topic"), "has no effect with a .csv file")
    try:
        if kind == "mcap":
            return read_mcap(file, data, topic=written.topic or DEFAULT_TOPIC)
        column, unit = (written.time.column, written.time.unit) if written.time else ("time", "s")
        needed = {joint.name for joint in written.joints.values()} or set(_scalar_joints(scenario))
        return read_csv(file, data, time_column=column, nanoseconds=float(TIME.units[unit] * 10**9), needed=needed)
    except RecordingError as error:
        raise Unusable((*PATH, "file"), error.reason) from None


def _begin(start: float, log: dict[str, JointTrack]) -> int:
    """Return the time [ns] of the log's first sample, of whichever joint."""
    if not log:
        raise Unusable((*PATH, "file"), "has no samples of joints")
    begin = min(int(track.time.min()) for track in log.values())
    end = max(int(track.time.max()) for track in log.values())
    if begin + start * 1e9 > end:
        raise Unusable((*PATH, "start"), f"is after the log's last sample, {(end - begin) / 1e9:.6g} s after its first")
    return begin


def _same_names(scenario: Scenario, log: dict[str, JointTrack]) -> dict[str, RecordedJoint]:
    """Return the scenario's scalar joints that the log has under the same name."""
    from replay.scenario.motion import RecordedJoint

    mine = _scalar_joints(scenario)
    common = {name: RecordedJoint(name=name) for name in mine if name in log and not _scripted(scenario, name)}
    if not common:
        rule = f"has no joint of the scenario's names; it has {sorted(log)}: name them in motion.recorded.joints"
        raise Unusable((*PATH, "file"), rule)
    return common


def _scalar_joints(scenario: Scenario) -> dict[str, str]:
    """Return the types of the joints that have a position, by name."""
    joints = ((link.joint.name or name, link.joint.type) for name, link in scenario.links.items())
    return {name: kind for name, kind in joints if kind in SCALAR_JOINTS}


def _scripted(scenario: Scenario, joint: str) -> str:
    if joint in scenario.motion.points:
        return "motion.points"
    return "motion.moves" if any(joint in move.to for move in scenario.motion.moves) else ""


def _track(scenario: Scenario, joint: str, source: RecordedJoint, log: dict[str, JointTrack], begin: int) -> Track:
    written = scenario.motion.recorded
    assert written is not None
    path = (*PATH, "joints", joint)
    mine = _scalar_joints(scenario)
    if joint not in mine:
        raise Unusable(path, f"is no joint with a position; {did_you_mean(joint, mine, what='joints are')}")
    if other := _scripted(scenario, joint):
        raise Unusable(path, f"is a joint that {other} moves as well; keep one of the two")
    if source.name not in log:
        rule = did_you_mean(source.name, log, what="its joints are")
        raise Unusable((*path, "name"), f"is not in the log; {rule}")
    dimension = LENGTH if mine[joint] == "prismatic" else ANGLE
    if source.unit is not None and source.unit not in dimension.units:
        rule = f"is no unit of joint {joint!r}, which is {mine[joint]}; units are {', '.join(dimension.units)}"
        raise Unusable((*path, "unit"), rule)
    if log[source.name].by_turns:
        rule = "is moved by several publishers on one topic of the log, sample by sample in turn; keep one in the log"
        raise Unusable(path, rule)
    factor = 1.0 if source.unit is None else float(dimension.units[source.unit])
    time, position = log[source.name].time, log[source.name].position * factor
    if not np.isfinite(position).all():
        raise Unusable(
            path, f"has a position in the log that is no finite number: sample {_first(~np.isfinite(position))}"
        )
    seconds = (time - begin) / 1e9
    steps = np.diff(time)
    if (steps <= 0).any():
        at = _first(steps <= 0)
        raise Unusable(
            path, f"has times in the log that do not increase: after {seconds[at]:.9g} s comes {seconds[at + 1]:.9g} s"
        )
    if (steps * 1e-9 > written.max_gap).any():
        at = _first(steps * 1e-9 > written.max_gap)
        rule = f"has a gap of {steps[at] * 1e-9:.6g} s in the log at {seconds[at]:.6g} s; raise max_gap to bridge it"
        raise Unusable(path, f"{rule} in a straight line")
    return Track(seconds - written.start, position)


def _first(mask: np.ndarray) -> int:
    return int(np.flatnonzero(mask)[0])
