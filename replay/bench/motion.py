"""66 pairs over the frames of a motion: our pipeline against python-fcl and coal frame by frame."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from replay.bench import carm
from replay.bench.engines import PEERS, coal_geometry, fcl_geometry
from replay.bench.goals import advantage
from replay.bench.measure import Check, Contender, absent, compete
from replay.bench.report import Report
from replay.bench.truth import proven_distance
from replay.collision.columns import Level
from replay.collision.pipeline import CollisionPipeline
from replay.kinematics.linkage import LinkPoses
from replay.numerics.arrays import Flags
from replay.simulation import BLOCK_FRAMES

Answer = Callable[[], Flags]

TITLE = "a motion: contacts of 66 pairs in every frame"
OURS, OURS_NEAR = "replay, blocks of frames", "replay, with clearances below 5 cm"
FCL, FCL_MANAGER = "python-fcl, each pair each frame", "python-fcl, its broad phase each frame"
COAL = "coal, each pair each frame"

UNDETERMINED = 1e-12
"""[m] Nearer to touching than this, either answer is right."""


def add_to(report: Report, *, frames: int, rounds: int) -> None:
    """Run the benchmark; a query is one pair in one frame."""
    case = f"66 pairs x {frames} frames"
    poses = carm.poses(frames)
    ours = pipeline(poses, clearance="never")
    expected = ours()
    proofs: dict[int, bool | None] = {}

    def check(found: Flags) -> Check:
        """Count wrong answers: what is seen differently is decided by proof, as are 200 random pair-frames."""
        sample = np.random.default_rng(0).choice(found.size, min(200, found.size), replace=False)
        wrong = 0
        for place in {*np.flatnonzero(found != expected).tolist(), *sample.tolist()}:
            if place not in proofs:
                proofs[place] = _proven(poses, *divmod(place, expected.shape[1]))
            wrong += proofs[place] is not None and bool(found.flat[place]) != proofs[place]
        return Check(float(wrong > 0), wrong)

    near = pipeline(poses, clearance="near")
    contenders = [Contender(OURS, ours, expected.size, check), Contender(OURS_NEAR, near, expected.size, check)]
    missing = []
    for package, peers in _PEERS.items():
        why = next(peer for peer in PEERS if peer.package == package).missing()
        missing += [absent(case, name, why) for name in peers if why]
        contenders += [Contender(name, make(poses), expected.size, check) for name, make in peers.items() if not why]
    rows = compete(case, contenders, rounds=rounds) + missing
    report.tables[TITLE] = rows
    report.notes.append(f"Contacts are {expected.mean():.1%} of the pair-frames of the motion.")
    report.goals.append(advantage("motion.fcl", rows, [case], FCL, OURS))
    report.goals.append(advantage("motion.coal", rows, [case], COAL, OURS))


def pipeline(poses: LinkPoses, **options: Any) -> Answer:
    """Return what answers (frames, 66): contact, in blocks as a run does."""
    engine = CollisionPipeline(carm.collision_bodies(), carm.all_pairs(), poses.linkage, **options)
    frames = len(poses.local)

    def answer() -> Flags:
        blocks = (poses.slice(k, min(k + BLOCK_FRAMES, frames)) for k in range(0, frames, BLOCK_FRAMES))
        return np.concatenate([engine.run(block).level == Level.CONTACT for block in blocks])

    return answer


def _proven(poses: LinkPoses, frame: int, pair: int) -> bool | None:
    """Return whether the pair meets in the frame by proof; None where rounding decides."""
    bodies, chosen = carm.bodies(), carm.all_pairs()[pair]
    T_a_b = poses.slice(frame, frame + 1).relative(chosen.a, chosen.b)[0]
    low, high = proven_distance(bodies[chosen.a].vertices, bodies[chosen.b].vertices, T_a_b)
    if low > UNDETERMINED:
        return False
    return True if high <= 0.0 else None


def _fcl_objects(poses: LinkPoses) -> tuple[list[Any], list[Any], list[list[Any]]]:
    """Return geometries, objects, and their transforms in every frame, all made before the clock runs."""
    import fcl

    shapes = [fcl_geometry(fcl, body) for body in carm.bodies()]
    objects = [fcl.CollisionObject(shape, fcl.Transform()) for shape in shapes]
    placed = [[fcl.Transform(T[:3, :3].copy(), T[:3, 3].copy()) for T in frame] for frame in poses.world]
    return shapes, objects, placed


def _fcl_pairs(poses: LinkPoses) -> Answer:
    import fcl

    _, objects, placed = _fcl_objects(poses)
    pairs = [(objects[pair.a], objects[pair.b]) for pair in carm.all_pairs()]

    def answer() -> Flags:
        found = np.empty((len(placed), len(pairs)), dtype=np.bool_)
        for f, frame in enumerate(placed):
            for body, place in zip(objects, frame, strict=True):
                body.setTransform(place)
            for p, (a, b) in enumerate(pairs):
                found[f, p] = fcl.collide(a, b, fcl.CollisionRequest(), fcl.CollisionResult()) > 0
        return found

    return answer


def _fcl_manager(poses: LinkPoses) -> Answer:
    import fcl

    shapes, objects, placed = _fcl_objects(poses)
    manager = fcl.DynamicAABBTreeCollisionManager()
    manager.registerObjects(objects)
    manager.setup()
    body_of = {id(shape): k for k, shape in enumerate(shapes)}
    pair_of = {(pair.a, pair.b): p for p, pair in enumerate(carm.all_pairs())}

    def answer() -> Flags:
        found = np.zeros((len(placed), len(pair_of)), dtype=np.bool_)
        for f, frame in enumerate(placed):
            for body, place in zip(objects, frame, strict=True):
                body.setTransform(place)
            manager.update()
            data = fcl.CollisionData(request=fcl.CollisionRequest(num_max_contacts=1000))
            manager.collide(data, fcl.defaultCollisionCallback)
            for contact in data.result.contacts:
                a, b = body_of[id(contact.o1)], body_of[id(contact.o2)]
                found[f, pair_of[min(a, b), max(a, b)]] = True
        return found

    return answer


def _coal_pairs(poses: LinkPoses) -> Answer:
    import coal

    shapes = [coal_geometry(coal, body) for body in carm.bodies()]
    placed = [[coal.Transform3s(T[:3, :3].copy(), T[:3, 3].copy()) for T in frame] for frame in poses.world]
    pairs = [(pair.a, pair.b, coal.ComputeCollision(shapes[pair.a], shapes[pair.b])) for pair in carm.all_pairs()]
    question, contacts = coal.CollisionRequest(), coal.CollisionResult()
    question.enable_contact = False  # a boolean is asked for, no depth

    def answer() -> Flags:
        found = np.empty((len(placed), len(pairs)), dtype=np.bool_)
        for f, frame in enumerate(placed):
            for p, (a, b, collide) in enumerate(pairs):
                contacts.clear()
                collide(frame[a], frame[b], question, contacts)
                found[f, p] = contacts.isCollision()
        return found

    answer.keep = shapes  # type: ignore[attr-defined]  # the functors hold bare pointers
    return answer


_PEERS: dict[str, dict[str, Callable[[LinkPoses], Answer]]] = {
    "fcl": {FCL: _fcl_pairs, FCL_MANAGER: _fcl_manager},
    "coal": {COAL: _coal_pairs},
}
