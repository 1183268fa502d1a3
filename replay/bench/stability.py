"""Hard families through every method and peer, each in a process of its own: wrong answers, NaN, hangs, crashes.

Ours must be all zeros; the table shows where others break.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from replay.bench.arena import Reply, ask
from replay.bench.contestants import Answer, contestants
from replay.bench.engines import Body
from replay.bench.goals import Goal
from replay.bench.hard_pairs import hard_pairs
from replay.bench.hard_sensing import hard_boxes, hard_cones, hard_plates
from replay.bench.report import Grid, Report

Question = dict[str, Any]
Judge = Callable[[Question, list[float], float], tuple[bool, float]]
"""(question, answer, tolerance) -> whether the answer is wrong, and its error."""

OURS = ("replay", "replay, tree rtol 1e-6")
INVALID = "invalid input"
"""A family of questions without an answer: only a refusal is right."""

# Error up to which an answer is right, by subject; others get what is gross by any standard.
_STRICT = {"pairs": 1e-12, "cones": 1e-11, "plates": 1e-12, "boxes": 1e-2}
_LOOSE = {"pairs": 1e-3, "cones": 1e-2, "plates": 1e-2, "boxes": 1e-2}
_STATED = {"replay, tree rtol 1e-6": 1e-6}

_COUNTS = ("wrong", "NaN", "refused", "hangs", "crashes")


def run(*, quick: bool = False, patience: float = 5.0, subjects: Sequence[str] = tuple(_STRICT)) -> Report:
    """Run all hard families through all contestants.

    Args:
        quick: fewer questions a family; some ten seconds.
        patience: after which an answer is a hang [s].
        subjects: of "pairs", "cones", "plates" and "boxes".
    """
    report = Report("stability")
    ours = 0
    for subject in subjects:
        lines = examine(subject, _questions(subject, 8 if quick else 64), patience)
        report.grids[f"hard {subject}"] = Grid(lines)
        ours += sum(int(line[count]) for line in lines if line["method"] in OURS for count in _COUNTS)
    report.goals.append(Goal("stability", float(ours)))
    return report


def examine(
    subject: str,
    questions: Sequence[Question],
    patience: float,
    several: Mapping[str, tuple[str, Answer]] | None = None,
) -> list[dict[str, Any]]:
    """Return a line for every family and contestant: asked, outcomes by kind, worst error of what was answered.

    Args:
        subject: of the questions.
        questions: see `hard_pairs` and `hard_sensing`.
        patience: after which an answer is a hang [s].
        several: contestants, instead of all of the subject.
    """
    families = list(dict.fromkeys(question["family"] for question in questions))
    judge = _JUDGES[subject]
    answered: dict[str, list[Reply] | str] = {}
    for name, (package, answer) in (several or contestants(subject)).items():
        answered[name] = _missing(package) or ask(answer, questions, patience=patience)
    lines = []
    for family in families:
        for name, outcomes in answered.items():
            if isinstance(outcomes, str):
                lines.append(_line(family, name, note=outcomes))
                continue
            tolerance = _STATED.get(name, (_STRICT if name == "replay" else _LOOSE)[subject])
            chosen = [(q, o) for q, o in zip(questions, outcomes, strict=True) if q["family"] == family]
            lines.append(_count(family, name, chosen, judge, tolerance))
    return lines


def _count(
    family: str, name: str, chosen: Sequence[tuple[Question, Reply]], judge: Judge, tolerance: float
) -> dict[str, Any]:
    line = _line(family, name, asked=len(chosen))
    worst = 0.0
    for question, outcome in chosen:
        if outcome.failure in ("hang", "crash"):
            line["hangs" if outcome.failure == "hang" else "crashes"] += 1
        elif outcome.answer is None:
            line["refused"] += family != INVALID
        elif family == INVALID:
            line["wrong"] += 1
        elif any(math.isnan(value) for value in outcome.answer):
            line["NaN"] += 1
        else:
            wrong, error = judge(question, outcome.answer, tolerance)
            line["wrong"] += int(wrong)
            worst = max(worst, error)
    line["worst error"] = "" if family == INVALID else f"{worst:.1e}"
    return line


def _line(family: str, name: str, *, asked: int = 0, note: str = "") -> dict[str, Any]:
    return {
        "family": family,
        "method": name,
        "asked": asked,
        **dict.fromkeys(_COUNTS, 0),
        "worst error": "",
        "note": note,
    }


def _missing(package: str) -> str:
    try:
        if package:
            __import__(package)
    except ImportError as error:
        return f"not installed ({error})"
    return ""


def _questions(subject: str, count: int) -> list[Question]:
    if subject == "pairs":
        return [*_pair_questions(count), *_invalid_pairs()]
    if subject == "cones":
        return hard_cones(count)
    return hard_plates() if subject == "plates" else hard_boxes(max(2, count // 4))


def _pair_questions(count: int) -> list[Question]:
    return [
        {
            "family": pair.family,
            "a": _plain(pair.a),
            "b": _plain(pair.b),
            "T_world_a": pair.T_world_a,
            "T_world_b": pair.T_world_b,
            "truth": pair.distance,
            "meets": pair.meets,
            "size": pair.size,
        }
        for pair in hard_pairs(max(count, 32))
    ]


def _plain(body: Body) -> tuple[Any, Any]:
    return body.vertices, body.size


def _invalid_pairs() -> list[Question]:
    """Return NaN and infinite poses and vertices, and a body without vertices."""
    corners = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    here = np.identity(4)
    nan_pose, far_pose, broken = here.copy(), here.copy(), corners.copy()
    nan_pose[0, 3], far_pose[0, 3], broken[1, 1] = math.nan, math.inf, math.nan
    turned = here.copy()
    turned[:3, :3] = math.nan
    cases = [
        (corners, nan_pose),
        (corners, turned),
        (corners, far_pose),
        (broken, here),
        (np.empty((0, 3)), here),
    ]
    return [
        {"family": INVALID, "a": (corners, None), "b": (points, None), "T_world_a": here, "T_world_b": pose}
        for points, pose in cases
    ]


def _judge_pair(question: Question, answer: list[float], tolerance: float) -> tuple[bool, float]:
    hit, distance = answer
    error = abs(distance - question["truth"]) / question["size"]
    meets = question["meets"]
    contradicts = meets is not None and (bool(hit) != meets or (distance > 0.0) == meets)
    return contradicts or error > tolerance, error


def _judge_cone(question: Question, answer: list[float], tolerance: float) -> tuple[bool, float]:
    found, truth = answer[0], question["truth"]
    if math.isinf(found) or math.isinf(truth):
        return found != truth, 0.0
    error = abs(found - truth) / question["size"]
    return error > tolerance, error


def _judge_plate(question: Question, answer: list[float], tolerance: float) -> tuple[bool, float]:
    found, truth = answer[0], question["truth"]
    if math.isinf(found) or truth == 0.0:
        return found != truth, 0.0
    error = abs(found - truth) / truth
    return error > tolerance, error


def _judge_box(question: Question, answer: list[float], tolerance: float) -> tuple[bool, float]:
    """A box must be orthonormal, hold its points, and be no more than 1 % larger than the tightest box known.

    Points far away are held as far as their box can be told in doubles: to a few ulps of where they are.
    """
    center, half, axes = np.array(answer[:3]), np.array(answer[3:6]), np.array(answer[6:]).reshape(3, 3)
    skew = float(np.abs(axes @ axes.T - np.identity(3)).max())
    points = question["points"]
    outside = float((np.abs((points - center) @ axes.T) - half).max()) / float(np.ptp(points, axis=0).max())
    grain = 8.0 * 2.0**-52 * float(np.abs(points).max()) / float(np.ptp(points, axis=0).max())
    excess = float(np.prod(2.0 * half)) / question["volume"] - 1.0
    return skew > 1e-12 or outside > 1e-12 + grain or excess > tolerance, max(skew, outside, excess)


_JUDGES: dict[str, Judge] = {
    "pairs": _judge_pair,
    "cones": _judge_cone,
    "plates": _judge_plate,
    "boxes": _judge_box,
}
