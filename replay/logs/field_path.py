"""Paths to a value in a message: names of fields, entries of lists by number, joints of joint states by name."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

from replay.errors import InvalidValue

ABSENT: Final = object()
"""Stands for a value that a message does not have."""
_STEP = re.compile(r"\.?([^.\[\]]+)|\[([^\[\]]*)\]")


@dataclass(frozen=True)
class FieldPath:
    """A path such as `data[0]`, `pose.position.x`, `position[elbow]` or `joints[elbow].position`.

    Attributes:
        text: as it is written.
        steps: names of fields, numbers of entries, and, as a tuple of one, the name of an entry: of a list of mappings
            the one of that `name`, of a list of numbers the one whose place a list `name` beside it gives.
    """

    text: str
    steps: tuple[str | int | tuple[str], ...]

    @staticmethod
    def of(text: str) -> FieldPath:
        """Return the path that a text is; InvalidValue when it is none."""
        steps: list[str | int | tuple[str]] = []
        at = 0
        while at < len(text):
            found = _STEP.match(text, at)
            if found is None or (at == 0 and text[0] in ".["):
                break
            name, entry = found.groups()
            steps.append(name if name is not None else int(entry) if re.fullmatch(r"[0-9]{1,9}", entry) else (entry,))
            at = found.end()
        if at < len(text) or not steps or ("",) in steps:
            raise InvalidValue("field", text, "is no path to a value, such as range, pose.position.x or data[0]")
        return FieldPath(text, tuple(steps))

    def value(self, message: Any) -> Any:
        """Return what stands there in a message of mappings and lists; `ABSENT` where there is nothing."""
        above: Any = None
        for step in self.steps:
            found = below(message, step, above)
            if found is ABSENT:
                return ABSENT
            message, above = found, message
        return message


def below(value: Any, step: str | int | tuple[str], above: Any) -> Any:
    """Return what is one step below a value, which is itself in `above`; `ABSENT` where there is nothing."""
    if isinstance(step, str):
        # of a plain mapping without asking the abstract one, which takes longer than all else
        return value.get(step, ABSENT) if type(value) is dict or isinstance(value, Mapping) else ABSENT
    if isinstance(step, tuple):
        if isinstance(value, str | bytes | Mapping) or not hasattr(value, "__getitem__"):
            return ABSENT
        names: Any = [one.get("name") if isinstance(one, Mapping) else None for one in value]
        if isinstance(above, Mapping) and not any(name is not None for name in names):
            names = above.get("name")
        if not isinstance(names, list | tuple) or step[0] not in names:
            return ABSENT
        step = names.index(step[0])
    if isinstance(value, str | bytes | Mapping) or not hasattr(value, "__getitem__"):
        return ABSENT
    return value[step] if step < len(value) else ABSENT
