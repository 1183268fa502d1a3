"""What decides the pair-frames that the broad phase leaves, and the kernels that a pipeline's options call."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any, Literal, Protocol

from replay.collision import (
    broad,
    candidates,
    crossing_search,
    interval_proof,
    narrow,
    relative,
    scan,
    support,
    traversal,
    way_sieve,
    ways,
)
from replay.collision.bodies import Bodies, Bounds, Pieces
from replay.collision.pair_frames import PairFrames
from replay.collision.pairs import CollisionBody
from replay.geometry import box_search, calipers, decomposition, principal_axes, smallest_ball, tree
from replay.kinematics import travel
from replay.numerics.arrays import Integers
from replay.numerics.jit import entries_of

Engine = Literal["gjk", "fcl"]


def kernels(
    *, bounds: Bounds, narrowphase: str, pieces: Pieces, savings: bool = True, between: str = "sampled"
) -> tuple[Any, ...]:
    """Return the kernels that a pipeline with these options calls; see `pipeline.CollisionPipeline`.

    Args:
        bounds, narrowphase, pieces, savings: its options.
        between: "proven" if it has a motion, else "sampled".
    """
    used = [tree, support, relative, candidates]
    used += {"sphere": [smallest_ball], "aabb": []}.get(bounds, [principal_axes, box_search, calipers])
    used += [decomposition] if pieces == "convex" else []
    used += [traversal] if narrowphase == "fcl" else [narrow if savings else scan]
    if between == "proven":
        used += [travel, ways, way_sieve, interval_proof, crossing_search, *([narrow] if narrowphase == "fcl" else [])]
    return (*entries_of(*used), broad.sieve if savings else broad.keep_all)


class NarrowPhase(Protocol):
    """What decides the pair-frames that the broad phase leaves; see `narrow.decide` for the arguments."""

    def __call__(self, frames: PairFrames, limit: float, counts: Integers) -> None:
        """Finish level, clearance and undecided where the task asks for it."""


def engine_of(name: Engine, bodies: Sequence[CollisionBody], arrays: Bodies, *, savings: bool) -> NarrowPhase:
    """Return what decides, by name.

    Args:
        name: this package's own "gjk", or "fcl" (python-fcl).
        bodies: as they were given.
        arrays: the same, collected.
        savings: whether anything is left out that changes no result.

    Raises:
        MissingPackageError: "fcl" without python-fcl.
    """
    if name == "fcl":
        from replay.collision.fcl_engine import FclEngine

        return FclEngine(bodies, arrays)
    return partial(narrow.decide if savings else scan.decide_without_savings, arrays)
