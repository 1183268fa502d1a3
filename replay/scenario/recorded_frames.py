"""The frames of a log (TF) as poses of a free link: one transform, or several one after another."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from replay.kinematics.motion import FreePath, FreeTrack
from replay.language.node import KeyPath
from replay.logs.joint_log import Frame, Series
from replay.numerics import transforms
from replay.scenario.recorded_series import Unusable, Window, check_turns, in_window

UNIT = 1e-3
"""Largest deviation of a logged quaternion's length from 1 that is normalised."""


def pose_track(
    path: KeyPath, frames: Mapping[Frame, Series], child: str, parent: str, window: Window
) -> tuple[FreeTrack, list[int]]:
    """Return the poses of one frame in another and the rows of the log that they come from.

    Where the log does not tell the one in the other, transforms are composed along the tree that the log's frames make,
    at every time at which one of them was told; between two times each is interpolated.

    Args:
        path: of the link, for messages.
        frames: of the log.
        child: the frame.
        parent: the frame that its poses are wanted in; "" if the log tells it in one only.
        window: the scenario's time.

    Raises:
        Unusable: the log does not connect the two, or a series on the way cannot be used.
    """
    if not parent:
        parents = sorted(other for one, other in frames if one == child)
        parent = parents[0] if len(parents) == 1 else ""
    way = _way(frames, child, parent)
    if not way:
        known = ", ".join(f"{one} in {other}" for one, other in frames) or "none"
        raise Unusable(path, f"is frame {child!r} in {parent!r}, which is not in the log; its frames are {known}")
    tracks, rows = [], []
    for frame, _ in way:
        series = in_window(path, frames[frame], window)
        check_turns(path, series.time, series.value[:, :3])
        length = np.sqrt((series.value[:, 3:] ** 2).sum(axis=1))
        worst = float(length[np.abs(length - 1.0).argmax()])
        if abs(worst - 1.0) > UNIT:
            raise Unusable(path, f"has a rotation in the log that is no unit quaternion: its length is {worst:.6g}")
        tracks.append(FreeTrack(window.seconds(series.time), series.value[:, :3], series.value[:, 3:]))
        rows += series.row.tolist()
    if way == [((child, parent), False)]:
        return tracks[0], rows
    seconds = np.unique(np.concatenate([track.seconds for track in tracks]))
    T_parent_child = transforms.identity(len(seconds))
    for (_, inverse), track in zip(way, tracks, strict=True):
        T = FreePath.along(child, track).poses(seconds)
        T_parent_child = transforms.compose(transforms.invert(T) if inverse else T, T_parent_child)
    return FreeTrack(seconds, T_parent_child[:, :3, 3], transforms.to_quaternion(T_parent_child)), rows


def _way(frames: Mapping[Frame, Series], child: str, parent: str) -> list[tuple[Frame, bool]]:
    """Return the shortest way up and down the tree from a frame to another: frames, and whether each is inverted."""
    neighbours: dict[str, list[tuple[str, Frame, bool]]] = {}
    for one, other in frames:
        neighbours.setdefault(one, []).append((other, (one, other), False))
        neighbours.setdefault(other, []).append((one, (one, other), True))
    ways: dict[str, list[tuple[Frame, bool]]] = {child: []}
    front = [child]
    while front and parent not in ways:
        reached = []
        for at in front:
            for other, frame, inverse in neighbours.get(at, ()):
                if other not in ways:
                    ways[other] = [*ways[at], (frame, inverse)]
                    reached.append(other)
        front = reached
    return ways.get(parent, [])
