"""The broad phase: what each bounding volume lets pass for nothing, what it costs, and how cost grows with bodies."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Literal, get_args

import numpy as np

from replay.bench import carm
from replay.bench.inputs import rotations
from replay.bench.measure import Check, Contender, compete, exponent
from replay.bench.report import Grid, LogLogPlot, Report
from replay.collision.bodies import Bounds, Volumes, collect, fit_volumes
from replay.collision.broad import COUNTS, sieve
from replay.collision.columns import Level
from replay.collision.pair_frames import PairFrames, unanswered
from replay.collision.pairs import CollisionBody, PairRules
from replay.collision.pipeline import CollisionPipeline
from replay.geometry.primitives import cuboid
from replay.kinematics.linkage import Joint, JointType, Link, Linkage, LinkPoses
from replay.numerics.arrays import Flags

VOLUMES: tuple[Literal["obb", "obb_vertices", "aabb", "sphere"], ...] = get_args(Bounds)
FRAMES = 64
"""Frames in which the cost against the number of bodies is measured."""


def growth(report: Report, *, most: int, rounds: int) -> None:
    """Add the cost of a frame against the number of bodies up to `most`."""
    sizes = [n for n in (10, 30, 100, 300, 1000, 3000, 10_000) if n <= most]
    rows = []
    for n in sizes:
        poses, bodies = crowd(n)
        rules = PairRules(bodies, poses.linkage)
        contenders = [_contender(bodies, rules, poses, bounds) for bounds in ("obb", "sphere")]
        rows += compete(f"{n} bodies", contenders, rounds=rounds)
    report.tables[f"cost of a frame against the number of bodies ({FRAMES} frames)"] = rows
    lines = {
        name: [(float(n), row.median) for n, row in zip(sizes, (r for r in rows if r.method == name), strict=True)]
        for name in ("replay, obb", "replay, sphere")
    }
    named = {f"{name}, n^{exponent(points):.2f}": points for name, points in lines.items()}
    report.plots.append(LogLogPlot("a frame against its bodies", "bodies", "s per frame", named, joined=True))
    half = min(len(sizes) // 2, len(sizes) - 2)
    for name, points in lines.items():
        report.notes.append(
            f"{name}: the cost of a frame grows like n^{exponent(points):.2f} from {sizes[0]} to {sizes[-1]} bodies, "
            f"from {sizes[half]} on like n^{exponent(points[half:]):.2f}."
        )


def tightness(frames: int, rounds: int) -> Grid:
    """Return, for each volume, the pair-frames that pass it, those of them that do not touch, and the sieve's time."""
    poses, pairs, bodies = carm.poses(frames), carm.all_pairs(), carm.collision_bodies()
    arrays = collect(bodies, pieces="exact")
    rows = np.array([[pair.a, pair.b, p, pair.a] for p, pair in enumerate(pairs)], dtype=np.int64)
    relative = np.stack([poses.relative(pair.a, pair.b) for pair in pairs])
    turns = np.ascontiguousarray(np.moveaxis(poses.world[:, :, :3, :3], 1, 0))
    asked = unanswered(rows, relative, turns)
    contenders: list[Contender] = []
    passed: dict[str, Flags] = {}
    for bounds in VOLUMES:
        volumes = fit_volumes(bodies, arrays, bounds=bounds, pieces="exact")
        run = _sieve(volumes, asked)
        run()
        passed[bounds] = asked.level > 0
        contenders.append(Contender(bounds, run, asked.level.size, lambda _: Check(0.0)))
    engine = CollisionPipeline(bodies, pairs, poses.linkage, clearance="always")
    touching = engine.run(poses).level == Level.CONTACT
    cells = []
    for row in compete("tightness", contenders, rounds=rounds):
        passes = passed[row.method]
        false, lost = int((passes & ~touching).sum()), int((touching & ~passes).sum())
        cells.append(
            {
                "volume": row.method,
                "pass": int(passes.sum()),
                "touch": int(touching.sum()),
                "pass for nothing": false,
                "of those apart": f"{false / max(1, int((~touching).sum())):.2%}",
                "contacts lost": lost,
                "ns per pair-frame": f"{1e9 * row.median:.1f}",
            }
        )
    return Grid(cells)


def _sieve(volumes: Volumes, asked: PairFrames) -> Callable[[], None]:
    spreads, scratch, counts = np.empty((len(asked.poses), 2)), np.zeros((8, 4)), np.zeros(COUNTS, np.int64)
    return lambda: sieve(volumes, asked, 0.0, counts, spreads, scratch)


def crowd(count: int) -> tuple[LinkPoses, list[CollisionBody]]:
    """Return boxes that float in a cube, each with about as many neighbours whatever their number."""
    rng = np.random.default_rng(23)
    names = [f"l{k:05}" for k in range(count)]
    linkage = Linkage([Link(name, None, np.identity(4), Joint(name, JointType.FREE)) for name in names])
    edge = 0.8 * count ** (1.0 / 3.0)
    start = rotations(rng, count)
    start[:, :3, 3] = rng.uniform(0.0, edge, (count, 3))
    poses = np.broadcast_to(start, (FRAMES, count, 4, 4)).copy()
    drift = 0.2 * rng.normal(size=(count, 3))
    time = np.arange(FRAMES)[:, None, None] / 60.0
    poses[..., :3, 3] += drift * np.sin(math.pi * time)
    sizes = np.exp(rng.uniform(-1.6, -0.7, (count, 3)))
    bodies = [CollisionBody(f"{name}/box", k, cuboid(sizes[k].tolist())) for k, name in enumerate(names)]
    return linkage.forward(np.zeros((FRAMES, 0)), poses), bodies


def _contender(
    bodies: list[CollisionBody], rules: PairRules, poses: LinkPoses, bounds: Literal["obb", "sphere"]
) -> Contender:
    """Return what lists the contacts of a crowd; every volume must find the same."""
    engine = CollisionPipeline(bodies, rules, poses.linkage, bounds=bounds, clearance="never")
    return Contender(f"replay, {bounds}", lambda: engine.contacts(poses), FRAMES, lambda _: Check(0.0))
