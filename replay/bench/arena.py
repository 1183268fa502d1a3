"""Asks contestants in processes of their own: a crash, a hang or an error is an outcome, and the next is asked."""

from __future__ import annotations

import multiprocessing
import os
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection
from typing import Any

from replay.bench.contestants import Answer

STARTING = 300.0
"""[s] Time for a process to start and, on a first run, to compile."""


@dataclass(frozen=True)
class Reply:
    """What became of a question: `answer` if any, and else "hang", "crash" or the error's text."""

    answer: list[float] | None
    failure: str = ""


def ask(
    answer: Answer, questions: Sequence[dict[str, Any]], *, patience: float = 5.0, starting: float = STARTING
) -> list[Reply]:
    """Return the outcomes of a contestant's answers, in order.

    Args:
        answer: see `contestants`; it must be known by name in its module, or be a `partial` of such.
        questions: of its kind; a fresh process is asked the first one for nothing, so that what compiles or loads then
            is not taken for a hang.
        patience: after which an answer is a hang [s].
        starting: the same for a fresh process's first answer [s].
    """
    outcomes: list[Reply] = []
    spare = True  # whether a fresh process survives the question that is for nothing
    while len(outcomes) < len(questions):
        with _Contestant(answer) as other:
            if spare:
                spare = other.ask(questions[0], starting).failure not in _ENDS
                if not spare:
                    continue
            first = True
            while len(outcomes) < len(questions):
                outcomes.append(other.ask(questions[len(outcomes)], starting if first and not spare else patience))
                first = False
                if outcomes[-1].failure in _ENDS:
                    break
    return outcomes


_ENDS = ("hang", "crash")


class _Contestant:
    """A process that answers; use as a context."""

    def __init__(self, answer: Answer) -> None:
        context = multiprocessing.get_context("spawn")
        self._here, there = context.Pipe()
        self._process = context.Process(target=_serve, args=(answer, there), daemon=True)
        self._process.start()
        there.close()

    def __enter__(self) -> _Contestant:
        return self

    def __exit__(self, *_: object) -> None:
        self._process.kill()
        self._process.join()
        self._here.close()

    def ask(self, question: dict[str, Any], patience: float) -> Reply:
        """Return what becomes of a question."""
        try:
            self._here.send(question)
            if not self._here.poll(patience):
                return Reply(None, "hang")
            answer, failure = self._here.recv()
        except (EOFError, ConnectionError):
            return Reply(None, "crash")
        return Reply(answer, failure)


def _serve(answer: Answer, connection: Connection) -> None:
    """Answer until the other side is gone; what libraries print or write when cornered goes nowhere."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    os.dup2(nowhere, 2)
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)  # MuJoCo leaves a log where it is called
        _answer_all(answer, connection)


def _answer_all(answer: Answer, connection: Connection) -> None:
    while True:
        try:
            question = connection.recv()
        except EOFError:
            return
        try:
            reply: tuple[list[float] | None, str] = (answer(question), "")
        except Exception as error:  # every library has errors of its own; their text is the outcome
            reply = (None, f"{type(error).__name__}: {error}")
        connection.send(reply)
