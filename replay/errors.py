"""Everything `replay` raises on purpose, one class per cause, values kept as attributes; and how to say things."""

from __future__ import annotations

from collections.abc import Sequence


def count(number: int, noun: str) -> str:
    """Return "1 frame", "2 frames"."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


_JOINERS = "\u200c\u200d"
"""Show nothing, but are part of how words of some scripts, and emoji, are written."""


def printable(text: str, *, keep: str = "") -> str:
    """Return text with each character that shows nothing, or steers what shows it, as an escape such as `\\x1b`.

    Names and texts of files may hold anything: control characters, marks that turn the direction of writing, line
    breaks that make one line look like two, halves of characters that cannot be encoded.

    Args:
        text: of anyone.
        keep: characters that stay, such as line breaks in a text of several lines.
    """
    if text.isprintable():
        return text
    keep += _JOINERS
    return "".join(c if c.isprintable() or c in keep else c.encode("unicode_escape").decode() for c in text)


class ReplayError(Exception):
    """Base of every error that `replay` raises on purpose; its text is one clear line for the user."""

    def __str__(self) -> str:
        return printable(super().__str__())


class InvalidValue(ReplayError):
    """An argument of a public function is outside what the function accepts."""

    def __init__(self, name: str, value: object, rule: str) -> None:
        self.name = name
        self.value = value
        self.rule = rule
        super().__init__(f"{name} = {value}: {rule}")


class Problem:
    """One thing wrong at one place of a scenario, rules or model file."""

    def __init__(
        self, message: str, *, file: str | None = None, line: int | None = None, column: int | None = None
    ) -> None:
        self.message = message
        self.file = file
        self.line = line
        self.column = column

    def __str__(self) -> str:
        place = ":".join(str(part) for part in (self.file, self.line, self.column) if part is not None)
        return printable(f"{place}: {self.message}" if place else self.message)


class ScenarioError(ReplayError):
    """A scenario (or a file it includes) is not valid; every problem found is listed once, one line each."""

    def __init__(self, problems: Sequence[Problem]) -> None:
        self.problems = tuple({str(problem): problem for problem in problems}.values())
        super().__init__("\n".join(str(problem) for problem in self.problems))

    def __str__(self) -> str:
        return "\n".join(str(problem) for problem in self.problems)


class UndeterminedClockError(ReplayError):
    """A log's clock is to be found from its signals, and they do not tell it."""

    def __init__(self, problem: Problem, reason: str, candidates: Sequence[float]) -> None:
        self.problem = problem
        self.reason = reason
        self.candidates = tuple(candidates)
        super().__init__(str(problem))


class MotionLimitError(ReplayError):
    """A script drives a joint beyond one of its limits."""

    def __init__(self, joint: str, time: float, quantity: str, value: float, limit: float, unit: str) -> None:
        self.joint = joint
        self.time = time
        self.quantity = quantity
        self.value = value
        self.limit = limit
        self.unit = unit
        side = "above the upper" if value > limit else "below the lower"
        super().__init__(
            f"joint {joint!r}: {quantity} = {value:.6g} {unit} at t = {time:.6g} s is {side} limit {limit:.6g} {unit}"
        )


class MeshError(ReplayError):
    """A mesh file cannot be read, or what it holds cannot be used as a body."""

    def __init__(self, file: str, reason: str) -> None:
        self.file = file
        self.reason = reason
        super().__init__(f"{file}: {reason}")


class RobotError(ReplayError):
    """A description of a robot cannot be read, contradicts itself, or names a file that is not to be found."""

    def __init__(self, file: str, reason: str, *, line: int | None = None) -> None:
        self.file = file
        self.line = line
        self.reason = reason
        super().__init__(f"{file}: {reason}" if line is None else f"{file}:{line}: {reason}")


class MissingPackageError(ReplayError):
    """A Python package that this input or option needs is not installed."""

    def __init__(self, package: str, needed_for: str, install: str) -> None:
        self.package = package
        self.needed_for = needed_for
        self.install = install
        super().__init__(f"{needed_for} needs the Python package {package!r}, which is not installed; {install}")


class RecordingError(ReplayError):
    """A recording cannot be read: not a recording, another format version, or damaged beyond use."""

    def __init__(self, file: str, reason: str) -> None:
        self.file = file
        self.reason = reason
        super().__init__(f"{file}: {reason}")


class LimitError(RecordingError):
    """A recording or log holds more than is read of it, see `replay.limits`; no part of it is salvaged."""


class ForeignLogError(RecordingError):
    """An MCAP file that others wrote, where a recording of `replay` is meant."""


class RecordingExistsError(ReplayError):
    """The target of a run exists already and overwriting was not asked for."""

    def __init__(self, file: str, *, resumable: bool = False) -> None:
        self.file = file
        resume = " --resume to keep what is up to date," if resumable else ""
        super().__init__(
            f"{file}: exists already; pass --overwrite to replace it,{resume} or -o DIR to write elsewhere"
        )


class WriteError(ReplayError):
    """A file cannot be written: read-only target, full disk, missing folder."""

    def __init__(self, file: str, reason: str) -> None:
        self.file = file
        self.reason = reason
        super().__init__(f"{file}: cannot be written: {reason}")


class NoSpaceError(WriteError):
    """A file cannot be written because no room is left, which ends everything that writes there."""


class BusyError(WriteError):
    """A folder is in use by another command, which is named."""

    def __init__(self, file: str, user: str) -> None:
        ReplayError.__init__(self, f"{file}: is in use by {user}; wait until that has ended, or choose another folder")
        self.file = file
        self.user = user
        self.reason = f"it is in use by {user}"


class WorkerError(ReplayError):
    """Worker processes cannot be used: they die before they have begun."""

    def __init__(self, reason: str) -> None:
        self.reason = reason
        super().__init__(f"worker processes cannot be started: {reason}")


class CurveError(ReplayError):
    """A file with a measured curve cannot be read, or one of its rows cannot be used."""

    def __init__(self, file: str, line: int | None, reason: str) -> None:
        self.file = file
        self.line = line
        self.reason = reason
        super().__init__(f"{file}: {reason}" if line is None else f"{file}:{line}: {reason}")


class CalibrationError(ReplayError):
    """A curve does not determine what was to be fitted to it, or what it determines cannot be a sensor's."""


class ViewerError(ReplayError):
    """The rerun viewer could not show or render a recording."""
