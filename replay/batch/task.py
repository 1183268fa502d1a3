"""What a worker process is given to do, and what became of it."""

from __future__ import annotations

import enum
from dataclasses import dataclass
from pathlib import Path
from typing import Any


class Ending(enum.Enum):
    """How a task ended."""

    DONE = "done"
    CRASHED = "crashed"
    TIMEOUT = "timeout"
    MEMORY = "memory"


@dataclass(frozen=True)
class Task:
    """One thing to do.

    Attributes:
        name: in messages.
        payload: what the work is called with; it is pickled.
        cost: how long it is expected to take, in any unit; the longest begin first.
        log: file that gets what the task prints.
    """

    name: str
    payload: Any
    cost: float = 1.0
    log: Path | None = None


@dataclass(frozen=True)
class Ended:
    """What became of a task.

    Attributes:
        task: which.
        ending: how it ended.
        value: what the work returned when it was done, else None.
        reason: one line that says why there is no value; "" when it was done.
        seconds: wall time.
        memory: the most resident memory seen [bytes].
    """

    task: Task
    ending: Ending
    value: Any
    reason: str
    seconds: float
    memory: int
