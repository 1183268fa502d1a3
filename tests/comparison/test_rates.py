"""Moments do not depend on how often a motion is looked at: runs of one motion at two rates have the same events."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from replay.collision.passages import passages
from replay.comparison.diff import FRAMES, compare
from replay.comparison.difference import DiffVerdict
from replay.comparison.rules import Rule, Rules, Tolerance
from replay.recording.reader import read
from replay.recording.record import record
from replay.scenario.load import load_sources
from replay.simulation import simulate

NOT_COMPARED = (FRAMES, "/collision/clearance*", "/collision/between*", "/collision/evaluated*")
RULES = Rules(
    (
        Rule(NOT_COMPARED, Tolerance(ignore=True), "of frames, and of intervals between them"),
        Rule(("/joint_states/*", "/tf/*"), Tolerance(abs=1e-12), "times of frames are rounded"),
    )
)


def moving(seed: int, rate: int) -> dict[str, bytes]:
    """Return four bodies that turn and slide through each other at random."""
    rng = np.random.default_rng(seed)
    lines = ["version: 1", "name: moving", f"rate: {rate}", "duration: 3", "links:"]
    motion = []
    for k in range(4):
        x, y, z = rng.uniform(-0.5, 0.5, 3)
        axis = rng.normal(size=3)
        axis /= np.linalg.norm(axis)
        size = ", ".join(f"{width:.3f}" for width in rng.uniform(0.01, 0.8, 3))
        joint = ("prismatic", "revolute")[k % 2]
        lines += [
            f"  l{k}:",
            f"    pose: {{xyz: [{x:.3f}, {y:.3f}, {z:.3f}]}}",
            f"    joint: {{name: j{k}, type: {joint}, axis: {axis.tolist()}, lower: -9, upper: 9}}",
            f"    shapes: {{s: {{type: cuboid, size: [{size}]}}}}",
        ]
        points = zip(np.linspace(0.0, 3.0, 7), rng.uniform(-1.5, 1.5, 7), strict=True)
        motion.append(f"    j{k}: [{', '.join(f'{{time: {t:.3f}, position: {q:.3f}}}' for t, q in points)}]")
    return {"moving.yaml": "\n".join([*lines, "motion:", "  points:", *motion]).encode()}


@pytest.mark.parametrize("seed", range(4))
def test_a_motion_has_the_same_moments_at_every_rate(tmp_path: Path, seed: int) -> None:
    often, rarely = (
        read(record(load_sources("moving.yaml", moving(seed, rate)), tmp_path / str(rate), rrd=False).mcap)
        for rate in (30, 10)
    )
    assert len(rarely.events) >= 4
    for baseline, candidate in ((often, rarely), (rarely, often)):
        found = compare(baseline, candidate, rules=RULES)
        assert found.verdict is DiffVerdict.SAME and found.signals == () and found.frames.matched == 31


def test_among_them_are_contacts_that_frames_do_not_show() -> None:
    blocks = [next(simulate(load_sources("moving.yaml", moving(seed, 10)))) for seed in range(4)]
    assert sum(len(passages(block.collision.crossings).pair) for block in blocks if block.collision) > 0
