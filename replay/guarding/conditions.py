"""Whether the conditions of guards hold in frames that come: what was read last holds until there is a reading."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from replay.guarding.guard import Combined, Guard, Leaf, PairLeaf, SensorLeaf, SeparationLeaf, leaves
from replay.numerics.arrays import Flags, Floats

UNKNOWN = 64.0
"""Frames until a threshold is passed, as far as anybody knows who has no reading."""

Told = Callable[[str, int], tuple[Floats, Flags]]
"""Takes a kind and a column; returns what the sensor tells of n frames and whether it is of something too near."""


class Conditions:
    """The conditions of guards, with what their parts said last.

    Args:
        guards: whose conditions they are.

    Attributes:
        soonest: in how many frames one may pass its threshold, if it goes on as between the last two looked at.
    """

    def __init__(self, guards: Sequence[Guard]) -> None:
        self._guards = tuple(guards)
        self._leaves = [list(leaves(guard.when)) for guard in guards]
        self.restart()

    def restart(self) -> None:
        """Go back to before the first frame: nothing holds."""
        self._last = [np.zeros((2, len(parts)), dtype=np.bool_) for parts in self._leaves]
        self._found: list[Flags] = []
        self.soonest = np.inf

    def look(self, told: Told, clearance: Floats, velocity: Floats, script_velocity: Floats) -> tuple[Flags, Flags]:
        """Return whether conditions hold in n frames, and whether they do not count as gone for a release, (n, G) each.

        Args:
            told: see `Told`.
            clearance: (n, P) [m] of the pairs that guards look at, 0 in contact, inf where beyond all thresholds.
            velocity: (n, J) [per s] of joints.
            script_velocity: (n, J) [per s], what their scripts say.
        """
        frames = len(velocity)
        holds = np.zeros((2, frames, len(self._guards)), dtype=np.bool_)
        self._found, self.soonest = [], np.inf
        for g, guard in enumerate(self._guards):
            found = np.zeros((2, frames, len(self._leaves[g])), dtype=np.bool_)
            for k, leaf in enumerate(self._leaves[g]):
                value, near, limits = self._value(guard, leaf, told, clearance, velocity)
                known = ~np.isnan(value)
                self.soonest = min(self.soonest, _frames_until(value, limits[0]))
                for which, limit in enumerate(limits):
                    below = near | (value < limit)
                    found[which, :, k] = _held(known, below, bool(self._last[g][which, k]))
            moving = np.ones(frames, dtype=np.bool_)
            if guard.directions:
                moving = np.any([sign * script_velocity[:, joint] > 0.0 for joint, sign in guard.directions], axis=0)
            for which in range(2):
                parts = dict(zip(map(id, self._leaves[g]), found[which].T, strict=True))
                holds[which, :, g] = _combined(guard.when, parts, frames) & moving
            self._found.append(found)
        return holds[0], holds[1]

    def keep(self, frames: int) -> None:
        """Let the first frames of those last looked at be past."""
        if frames:
            self._last = [found[:, frames - 1].copy() for found in self._found]

    @staticmethod
    def _value(
        guard: Guard, leaf: Leaf, told: Told, clearance: Floats, velocity: Floats
    ) -> tuple[Floats, Flags, tuple[Floats | float, Floats | float]]:
        """Return what a part of a condition looks at, whether it is too near anyway, and its two thresholds."""
        if isinstance(leaf, SeparationLeaf):
            speeds = np.abs(velocity[:, guard.joints])
            stopping = np.max(speeds / np.array(guard.deceleration), axis=1)
            limit = leaf.constant + leaf.speed * stopping
            inner = leaf.sensor or leaf.pairs
            assert inner is not None
            value, near, _ = Conditions._value(guard, inner, told, clearance, velocity)
            return value, near, (limit, limit + leaf.hysteresis)
        if isinstance(leaf, SensorLeaf):
            value, near = told(leaf.kind, leaf.column)
            return value, near, (leaf.below, leaf.released)
        assert isinstance(leaf, PairLeaf)
        value = np.min(clearance[:, leaf.columns], axis=1)
        return value, value == 0.0, (leaf.below, leaf.released)


def _frames_until(value: Floats, limit: Floats | float) -> float:
    """Return in how many frames a value passes a limit from above, by its last two; inf if it does not come nearer."""
    if len(value) < 2 or not np.isfinite(value[-2:]).all():
        return UNKNOWN
    above = value[-2:] - (limit if isinstance(limit, float) else limit[-2:])
    nearer = float(above[0] - above[1])
    return float(above[1]) / nearer if nearer > 0.0 and above[1] > 0.0 else np.inf


def _held(known: Flags, value: Flags, last: bool) -> Flags:
    """Return values (n,) where they are known, and the one before where they are not."""
    place = np.maximum.accumulate(np.where(known, np.arange(len(known)), -1))
    held: Flags = np.where(place >= 0, value[np.maximum(place, 0)], last)
    return held


def _combined(condition: Leaf | Combined, parts: Mapping[int, Flags], frames: int) -> Flags:
    if not isinstance(condition, Combined):
        return parts[id(condition)]
    found = [_combined(part, parts, frames) for part in condition.parts]
    result: Flags = np.all(found, axis=0) if condition.all else np.any(found, axis=0)
    return result
