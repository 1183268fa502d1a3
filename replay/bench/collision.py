"""Collision queries: time and error of our kernel and of public engines, on easy and on hard pairs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from replay.bench import broad_phase, motion
from replay.bench.engines import OURS, OURS_CHECKED, PEERS, Body, Engine
from replay.bench.goals import Goal, advantage
from replay.bench.hard_pairs import HardPair, by_family, hard_pairs
from replay.bench.inputs import box, ellipsoid, rotations
from replay.bench.measure import Check, Contender, Row, absent, compete
from replay.bench.report import Report, pareto_plot
from replay.bench.truth import proven_distance
from replay.collision.gjk import distance
from replay.numerics.arrays import Floats

GROSS = 1e-3
"""A distance that is off by more than this part of the scene's size is wrong, not merely inexact."""

BODIES = {
    "box": Body(box((1.0, 0.8, 0.6)), (1.0, 0.8, 0.6)),
    "42 vertices": Body(ellipsoid(42, (0.5, 0.4, 0.3))),
    "642 vertices": Body(ellipsoid(642, (0.5, 0.4, 0.3))),
}
PLACES = ("overlapping", "near", "far")
CALLS = ("boolean", "distance")


def run(*, quick: bool = False, rounds: int | None = None, engines: Sequence[Engine] | None = None) -> Report:
    """Run all collision benchmarks.

    Args:
        quick: fewer queries and frames; some ten seconds.
        rounds: times that every contender is timed; 9, or 5 when quick, if None.
        engines: instead of ours and the peers; the first one is the one that goals are about.
    """
    several = (OURS, OURS_CHECKED, *PEERS) if engines is None else tuple(engines)
    rounds = rounds or (5 if quick else 9)
    report = Report("collision")
    rows = easy(several, count=200 if quick else 1000, rounds=rounds)
    report.tables["queries of unrelated pairs"] = rows
    report.tables["hard pairs, one call each (read the errors; the times are the calls')"] = hard(
        several, count=32 if quick else 64, rounds=1
    )
    report.goals += _goals(rows, several)
    report.plots += [
        pareto_plot(f"{call}: {body}", [row for row in rows if row.case == f"{body}, near, {call}"], "error / size")
        for body in BODIES
        for call in ("distance",)
    ]
    motion.add_to(report, frames=512 if quick else 2000, rounds=min(rounds, 5))
    report.grids["bounding volumes on the motion"] = broad_phase.tightness(512 if quick else 2000, min(rounds, 3))
    return report


def easy(engines: Sequence[Engine], *, count: int, rounds: int, bodies: Sequence[str] = tuple(BODIES)) -> list[Row]:
    """Time every engine on every body against a copy of itself, overlapping, near and far."""
    rows: list[Row] = []
    for number, name in enumerate(bodies):
        body = BODIES[name]
        size = 2.0 * float(np.abs(body.vertices).max())
        for place in PLACES:
            T = placements(body, place, count, np.random.default_rng([17, number, PLACES.index(place)]))
            bounds = np.array([proven_distance(body.vertices, body.vertices, pose) for pose in T])
            scales = size + np.abs(T[:, :3, 3]).max(axis=1)
            here = np.broadcast_to(np.identity(4), T.shape)
            for call in CALLS:
                check = _check(call, place == "overlapping", bounds, scales)
                rows += race(f"{name}, {place}, {call}", engines, [(body, body, here, T)], call, check, rounds)
    return rows


def race(
    case: str,
    engines: Sequence[Engine],
    questions: Sequence[tuple[Body, Body, Floats, Floats]],
    call: str,
    check: Callable[[Floats], Check],
    rounds: int,
) -> list[Row]:
    """Let engines answer questions (a, b, T_world_a (n, 4, 4), T_world_b) and return their rows in the order given.

    A body that an engine refuses is answered with NaN, which a check counts as wrong.
    """
    contenders, missing = [], {}
    for engine in engines:
        why = engine.missing()
        if why:
            missing[engine.name] = absent(case, engine.name, why)
            continue
        asked = [_question(engine, call, question) for question in questions]
        total = sum(len(question[2]) for question in questions)
        contenders.append(Contender(engine.name, partial(_all, asked), total, check))
    found = {row.method: row for row in compete(case, contenders, rounds=rounds)} | missing
    return [found[engine.name] for engine in engines]


def _question(engine: Engine, call: str, question: tuple[Body, Body, Floats, Floats]) -> Callable[[], Floats]:
    count = len(question[2])
    try:
        queries = engine.queries(*question)
    except Exception:  # a peer's refusal of a thin hull; each library has errors of its own
        return lambda: np.full(count, np.nan)
    return queries.distances if call == "distance" else lambda: np.where(queries.hits(), 1.0, 0.0)


def _all(asked: Sequence[Callable[[], Floats]]) -> Floats:
    return np.concatenate([ask() for ask in asked])


def placements(body: Body, place: str, count: int, rng: np.random.Generator) -> Floats:
    """Return `count` poses (n, 4, 4) of a copy of a body: sharing inner points, 1e-3..1e-1 m apart, or far away."""
    T = rotations(rng, count)
    size = float(np.abs(body.vertices).max())
    direction = rotations(rng, count)[:, :3, 0]
    if place == "far":
        T[:, :3, 3] = direction * size * rng.uniform(5.0, 20.0, (count, 1))
        return T
    if place == "overlapping":
        inner = 0.5 * rng.dirichlet(np.ones(len(body.vertices)), (count, 2)) @ body.vertices
        T[:, :3, 3] = inner[:, 0] - np.sum(T[:, :3, :3] * inner[:, 1, None, :], axis=2)
        return T
    T[:, :3, 3] = direction * 4.0 * size
    for pose in T:
        apart = distance(body.vertices, body.vertices, pose_b=pose)
        assert apart.direction is not None
        # moved along the shortest way, the way stays the shortest
        pose[:3, 3] -= (apart.distance - 10.0 ** rng.uniform(-3.0, -1.0)) * apart.direction
    return T


def _check(call: str, meets: bool, bounds: Floats, scales: Floats) -> Callable[[Floats], Check]:
    """Return what judges answers: proven bounds (n, 2) of the distances, and the scenes' sizes (n,)."""
    low, high = bounds[:, 0], bounds[:, 1]
    proven = high - low <= 1e-11 * scales

    def boolean(answers: Floats) -> Check:
        wrong = ~proven | (answers != (1.0 if meets else 0.0))
        return Check(float(wrong.mean()), int(wrong.sum()))

    def measured(answers: Floats) -> Check:
        error = np.maximum(np.maximum(low - answers, answers - high), 0.0) / scales
        wrong = ~proven | ~(error <= GROSS) | ((answers > 0.0) == meets)
        return Check(float(np.max(error)), int(wrong.sum()), GROSS)

    return boolean if call == "boolean" else measured


def hard(engines: Sequence[Engine], *, count: int, rounds: int) -> list[Row]:
    """Return the rows of every hard family: booleans and distances against the longdouble reference."""
    rows: list[Row] = []
    for family, pairs in by_family(hard_pairs(count)):
        questions = [(pair.a, pair.b, pair.T_world_a[None], pair.T_world_b[None]) for pair in pairs]
        for call in CALLS:
            rows += race(f"{family}, {call}", engines, questions, call, judge(call, pairs), rounds)
    return rows


def judge(call: str, pairs: Sequence[HardPair]) -> Callable[[Floats], Check]:
    """Return what judges answers about hard pairs; where rounding decides, either boolean is right."""
    truth = np.array([pair.distance for pair in pairs])
    sizes = np.array([pair.size for pair in pairs])
    decided = np.array([pair.meets is not None for pair in pairs])
    meets = np.array([pair.meets is True for pair in pairs])

    def boolean(answers: Floats) -> Check:
        wrong = np.isnan(answers) | (decided & (answers != meets))
        return Check(float(wrong.mean()), int(wrong.sum()))

    def measured(answers: Floats) -> Check:
        error = np.abs(answers - truth) / sizes
        wrong = ~(error <= GROSS) | (decided & ((answers > 0.0) == meets))
        return Check(float(np.max(error)), int(wrong.sum()), GROSS)

    return boolean if call == "boolean" else measured


def _goals(rows: Sequence[Row], engines: Sequence[Engine]) -> list[Goal]:
    """Return the goals: the least advantage over a peer that takes part, over all bodies and places."""
    ours = engines[0].name
    cases = [f"{body}, {place}, boolean" for body in BODIES for place in PLACES]
    goals = [advantage(key, rows, cases, peer, ours) for key, peer in (("gjk.fcl", "python-fcl"), ("gjk.coal", "coal"))]
    wrong = sum(row.wrong for row in rows if row.method == ours)
    goals.append(Goal("gjk.wrong", float(wrong)))
    return goals
