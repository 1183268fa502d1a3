"""What is raised on purpose: one clear line, its values as attributes, and the class by which it is caught."""

from __future__ import annotations

import inspect

import pytest

from replay import errors
from replay.errors import Problem, ReplayError, ScenarioError, count, printable

ERRORS: list[tuple[type[ReplayError], tuple, dict, str, dict, tuple[type, ...]]] = [
    # class, arguments, keywords, text, attributes, other classes that it is one of
    (
        errors.InvalidValue,
        ("rate", -1, "must be > 0"),
        {},
        "rate = -1: must be > 0",
        {"name": "rate", "value": -1, "rule": "must be > 0"},
        (),
    ),
    (
        errors.MotionLimitError,
        ("swing", 1.25, "position", 3.4, 2.9, "rad"),
        {},
        "joint 'swing': position = 3.4 rad at t = 1.25 s is above the upper limit 2.9 rad",
        {"joint": "swing", "time": 1.25, "quantity": "position", "value": 3.4, "limit": 2.9, "unit": "rad"},
        (),
    ),
    (
        errors.MotionLimitError,
        ("lift", 0.0, "velocity", -0.5, -0.25, "m/s"),
        {},
        "joint 'lift': velocity = -0.5 m/s at t = 0 s is below the lower limit -0.25 m/s",
        {"joint": "lift", "time": 0.0, "quantity": "velocity", "value": -0.5, "limit": -0.25, "unit": "m/s"},
        (),
    ),
    (errors.MeshError, ("a.stl", "is empty"), {}, "a.stl: is empty", {"file": "a.stl", "reason": "is empty"}, ()),
    (errors.RobotError, ("a.urdf", "no"), {}, "a.urdf: no", {"file": "a.urdf", "reason": "no", "line": None}, ()),
    (
        errors.RobotError,
        ("a.urdf", "no"),
        {"line": 7},
        "a.urdf:7: no",
        {"file": "a.urdf", "reason": "no", "line": 7},
        (),
    ),
    (
        errors.MissingPackageError,
        ("embreex", "rays", "pip install embreex"),
        {},
        "rays needs the Python package 'embreex', which is not installed; pip install embreex",
        {"package": "embreex", "needed_for": "rays", "install": "pip install embreex"},
        (),
    ),
    (
        errors.RecordingError,
        ("a.mcap", "is damaged"),
        {},
        "a.mcap: is damaged",
        {"file": "a.mcap", "reason": "is damaged"},
        (),
    ),
    (
        errors.UndeterminedClockError,
        (Problem("offset cannot be estimated", file="a.yaml", line=3), "it is periodic", (0.5, 1.5)),
        {},
        "a.yaml:3: offset cannot be estimated",
        {"reason": "it is periodic", "candidates": (0.5, 1.5)},
        (),
    ),
    (
        errors.LimitError,
        ("a.mcap", "is large"),
        {},
        "a.mcap: is large",
        {"file": "a.mcap", "reason": "is large"},
        (errors.RecordingError,),
    ),
    (
        errors.ForeignLogError,
        ("a.mcap", "is another's"),
        {},
        "a.mcap: is another's",
        {"file": "a.mcap"},
        (errors.RecordingError,),
    ),
    (
        errors.RecordingExistsError,
        ("out/a",),
        {},
        "out/a: exists already; pass --overwrite to replace it, or -o DIR to write elsewhere",
        {"file": "out/a"},
        (),
    ),
    (
        errors.RecordingExistsError,
        ("out/a",),
        {"resumable": True},
        "out/a: exists already; pass --overwrite to replace it, --resume to keep what is up to date, or -o DIR to write"
        " elsewhere",
        {"file": "out/a"},
        (),
    ),
    (
        errors.WriteError,
        ("a", "read-only"),
        {},
        "a: cannot be written: read-only",
        {"file": "a", "reason": "read-only"},
        (),
    ),
    (
        errors.NoSpaceError,
        ("a", "full"),
        {},
        "a: cannot be written: full",
        {"file": "a", "reason": "full"},
        (errors.WriteError,),
    ),
    (
        errors.BusyError,
        ("out", "replay run (process 7)"),
        {},
        "out: is in use by replay run (process 7); wait until that has ended, or choose another folder",
        {"file": "out", "user": "replay run (process 7)", "reason": "it is in use by replay run (process 7)"},
        (errors.WriteError,),
    ),
    (
        errors.WorkerError,
        ("no memory",),
        {},
        "worker processes cannot be started: no memory",
        {"reason": "no memory"},
        (),
    ),
    (
        errors.CurveError,
        ("a.csv", None, "is empty"),
        {},
        "a.csv: is empty",
        {"file": "a.csv", "line": None, "reason": "is empty"},
        (),
    ),
    (errors.CurveError, ("a.csv", 3, "no"), {}, "a.csv:3: no", {"file": "a.csv", "line": 3, "reason": "no"}, ()),
    (errors.CalibrationError, ("flat",), {}, "flat", {}, ()),
    (errors.ViewerError, ("no screen",), {}, "no screen", {}, ()),
]


@pytest.mark.parametrize(
    ("kind", "given", "named", "text", "kept", "also"),
    ERRORS,
    ids=[f"{e[0].__name__} {k}" for k, e in enumerate(ERRORS)],
)
def test_an_error_is_one_line_and_keeps_its_values(kind, given, named, text, kept, also):
    error = kind(*given, **named)
    assert str(error) == text and isinstance(error, (ReplayError, *also))
    assert {name: getattr(error, name) for name in kept} == kept


def test_no_error_is_left_out():
    found = {kind for _, kind in inspect.getmembers(errors, inspect.isclass) if issubclass(kind, ReplayError)}
    assert found == {kind for kind, *_ in ERRORS} | {ReplayError, ScenarioError}


@pytest.mark.parametrize(
    ("named", "text"),
    [
        ({}, "is wrong"),
        ({"file": "a.yaml"}, "a.yaml: is wrong"),
        ({"file": "a.yaml", "line": 3}, "a.yaml:3: is wrong"),
        ({"file": "a.yaml", "line": 3, "column": 5}, "a.yaml:3:5: is wrong"),
    ],
)
def test_a_problem_begins_with_its_place(named, text):
    problem = Problem("is wrong", **named)
    assert str(problem) == text
    assert (problem.message, problem.file, problem.line) == ("is wrong", named.get("file"), named.get("line"))
    assert problem.column == named.get("column")


def test_each_problem_of_a_scenario_is_a_line_and_told_once():
    one, same, other = Problem("b", file="a"), Problem("b", file="a"), Problem("c\nd", file="a")
    error = ScenarioError([one, same, other])
    assert str(error) == "a: b\na: c\\nd" and [problem.message for problem in error.problems] == ["b", "c\nd"]


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("any text, ü, 漢", "any text, ü, 漢"),
        ("a\nb\x1b[31m", r"a\nb\x1b[31m"),
        ("left\u202eright", r"left\u202eright"),
        ("\ud800", r"\ud800"),
        ("n\u200co\u200dn", "n\u200co\u200dn"),
    ],
)
def test_characters_that_steer_a_terminal_are_shown(text, shown):
    assert printable(text) == shown
    assert str(ReplayError(text)) == shown and str(Problem(text)) == shown


def test_characters_may_be_kept():
    assert printable("a\nb\t", keep="\n") == "a\nb\\t"


def test_numbers_of_things():
    assert [count(number, "frame") for number in (0, 1, 2)] == ["0 frames", "1 frame", "2 frames"]
