"""Asks a contestant in a process of its own: a crash, a hang or an error is an outcome, and the next question follows."""

from __future__ import annotations

import multiprocessing
import os
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection
from typing import Any

from replay.bench.contestants import contestants

STARTING = 300.0
"""[s] Time for a process to start and, on a first run, to compile."""


@dataclass(frozen=True)
class Outcome:
    """What became of a question: `answer` if any, and else "hang", "crash" or the error's text."""

    answer: list[float] | None
    failure: str = ""


def ask(subject: str, name: str, questions: Sequence[dict[str, Any]], *, patience: float = 5.0) -> list[Outcome]:
    """Return the outcomes of a contestant's answers, in order; see `contestants.contestants`.

    Args:
        subject, name: of the contestant.
        questions: of its kind; the first one is asked twice, so that compiling is not taken for a hang.
        patience: after which an answer is a hang [s].
    """
    outcomes: list[Outcome] = []
    context = multiprocessing.get_context("spawn")
    while len(outcomes) < len(questions):
        here, there = context.Pipe()
        process = context.Process(target=_serve, args=(subject, name, there), daemon=True)
        process.start()
        there.close()
        try:
            ready = _exchange(here, questions[0], STARTING)
            if ready.failure in ("hang", "crash") and not outcomes:
                outcomes.append(ready)  # not even the first question: the second one gets a fresh process
                continue
            while len(outcomes) < len(questions):
                outcomes.append(_exchange(here, questions[len(outcomes)], patience))
                if outcomes[-1].failure in ("hang", "crash"):
                    break
        finally:
            process.kill()
            process.join()
            here.close()
    return outcomes


def _exchange(connection: Connection, question: dict[str, Any], patience: float) -> Outcome:
    try:
        connection.send(question)
        if not connection.poll(patience):
            return Outcome(None, "hang")
        answer, failure = connection.recv()
    except (EOFError, ConnectionError):
        return Outcome(None, "crash")
    return Outcome(answer, failure)


def _serve(subject: str, name: str, connection: Connection) -> None:
    """Answer until the other side is gone; the process's own output goes nowhere, since libraries print when cornered."""
    sys.stdout.flush()
    sys.stderr.flush()
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    os.dup2(nowhere, 2)
    _, answer = contestants(subject)[name]
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
