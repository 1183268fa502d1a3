"""Which bodies move farther from frame to frame than they are thick: frames alone may not see them pass others."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from fractions import Fraction
from typing import TYPE_CHECKING

import numpy as np

from replay.errors import MotionLimitError, Problem
from replay.geometry.solid import Solid
from replay.numerics import transforms
from replay.numerics.arrays import Floats
from replay.scenario import frames

if TYPE_CHECKING:
    from replay.scenario.model import Scenario


_FRAMES_AT_ONCE = 1024


def speed_notes(scenario: Scenario, solids: Mapping[tuple[str, str], Solid]) -> Iterator[Problem]:
    """Yield a note for each colliding shape that moves farther in a frame than it is thick.

    Args:
        scenario: whose motion it is; one that breaks a limit is told of when it is run, not here.
        solids: shapes by link and name, in the links' frames.
    """
    names = [
        (link, name)
        for link, name in solids
        if scenario.collision.pairs != "none" and scenario.links[link].shapes[name].collide
    ]
    try:
        moved = _moved(scenario, [link for link, _ in names], [_box(solids[name]) for name in names])
    except MotionLimitError:
        return
    for (link, name), way in zip(names, moved.tolist(), strict=True):
        thickness = _thickness(solids[link, name])
        if way > thickness * (1.0 + 1e-9):
            rule = f"moves up to {way:.3g} m in a frame and is {thickness:.3g} m thick: frames alone"
            rule += " (model.collision.between: sampled) may not see it pass through another; write proven, or"
            yield scenario.provenance.problem(("links", link, "shapes", name), f"{rule} raise the rate")


def _moved(scenario: Scenario, links: list[str], boxes: list[Floats]) -> Floats:
    """Return how far the corners of boxes (8, 3) [m] on links move from frame to frame, at most, (k,) [m]."""
    from replay.kinematics.motion import plan
    from replay.scenario.script import linkage, script

    machine = linkage(scenario)
    motion = plan(machine, script(scenario))
    most = np.zeros(len(links))
    places = [machine.link_index(link) for link in links]
    for begin in range(0, scenario.frames - 1, _FRAMES_AT_ONCE):
        end = min(begin + _FRAMES_AT_ONCE + 1, scenario.frames)
        states = motion.states(frames.seconds(Fraction(scenario.rate), begin, end))
        poses = machine.forward(states.positions, states.free_poses).world
        for k, (place, box) in enumerate(zip(places, boxes, strict=True)):
            corners = transforms.apply(poses[:, place, None], box)
            most[k] = max(most[k], float(np.linalg.norm(np.diff(corners, axis=0), axis=2).max()))
    return most


def _box(solid: Solid) -> Floats:
    """Return the corners (8, 3) [m] of the box around a solid along its frame's axes."""
    ends = np.stack([solid.vertices.min(axis=0), solid.vertices.max(axis=0)])
    return np.stack(np.meshgrid(*ends.T, indexing="ij"), axis=-1).reshape(8, 3)


def _thickness(solid: Solid) -> float:
    """Return about how thick a solid is where it is thickest [m]: the least width of its parts, by a few directions."""
    parts = solid.pieces or (solid.vertices,)
    return max(min(float(np.ptp(part @ axes, axis=0).min()) for axes in _axes(part)) for part in parts)


def _axes(points: Floats) -> Iterator[Floats]:
    """Yield the frame's axes, and the principal axes of points, as columns."""
    yield np.eye(3)
    yield np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2].T
