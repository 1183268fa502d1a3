"""Answers that are asked for again: kept by content for the life of the process, the latest ones, up to a size.

The scenarios of a night share their machine: what is made of its shapes is the same for each of them. A function is
`kept` only if its answer follows from its arguments, and nobody writes into answers.
"""

from __future__ import annotations

import dataclasses
import hashlib
import threading
from collections import OrderedDict
from collections.abc import Callable
from functools import wraps
from typing import Any, Final, ParamSpec, TypeVar

import numpy as np

Arguments = ParamSpec("Arguments")
Answer = TypeVar("Answer")

MOST: Final = 128 << 20
"""Bytes of all answers that are kept."""

_LARGEST = 16 << 20
"""Bytes of arguments: to tell larger ones apart takes a while, and they seldom come twice."""

_OBJECT = 1024
"""Bytes that an answer takes besides its content, roughly."""

_answers: OrderedDict[bytes, tuple[Any, int]] = OrderedDict()
_total = 0
"""Bytes of them."""
_lock = threading.Lock()


def kept(function: Callable[Arguments, Answer]) -> Callable[Arguments, Answer]:
    """Return a function that answers the same question once: arguments are arrays, numbers, texts, and tuples, lists
    and dataclasses of these; with others it is called each time, to say what is wrong with them."""
    name = f"{function.__module__}.{function.__qualname__}"

    @wraps(function)
    def ask(*args: Arguments.args, **kwargs: Arguments.kwargs) -> Answer:
        global _total  # noqa: PLW0603
        try:
            parts = _content((args, kwargs))
        except TypeError:  # the function says what is wrong with them
            return function(*args, **kwargs)
        if sum(map(len, parts)) > _LARGEST:
            return function(*args, **kwargs)
        digest = hashlib.sha256(name.encode())
        for part in parts:
            digest.update(part)
        key = digest.digest()
        with _lock:
            if key in _answers:
                _answers.move_to_end(key)
                known: Answer = _answers[key][0]
                return known
        answer = function(*args, **kwargs)
        size = _OBJECT + sum(map(len, _content(answer)))
        with _lock:
            _total += size - _answers.get(key, (None, 0))[1]  # another thread may have been faster
            _answers[key] = answer, size
            while _total > MOST:
                _total -= _answers.popitem(last=False)[1][1]
        return answer

    return ask


def forget() -> None:
    """Keep no answer: who measures how long it takes to find them."""
    global _total  # noqa: PLW0603
    with _lock:
        _answers.clear()
        _total = 0


def _content(value: Any) -> list[memoryview | bytes]:
    """Return what tells a value from others, in bytes."""
    parts: list[memoryview | bytes] = []
    _add_content(value, parts)
    return parts


def _add_content(value: Any, parts: list[memoryview | bytes]) -> None:
    if isinstance(value, np.ndarray):
        parts.append(f"{value.dtype.str}{value.shape}".encode())
        parts.append(np.ascontiguousarray(value).reshape(-1).view(np.uint8).data)
    elif isinstance(value, bytes):
        parts.append(f"{len(value)} bytes".encode())
        parts.append(value)
    elif value is None or isinstance(value, str | int | float | np.generic):
        parts.append(f"{type(value).__name__} {value!r}".encode())
    elif isinstance(value, dict):
        _add_content(tuple(value.items()), parts)
    elif isinstance(value, tuple | list):
        parts.append(f"{type(value).__name__} {len(value)}".encode())
        for part in value:
            _add_content(part, parts)
    elif dataclasses.is_dataclass(value):
        parts.append(type(value).__name__.encode())
        for entry in dataclasses.fields(value):
            _add_content(getattr(value, entry.name), parts)
    else:
        raise TypeError(f"{type(value).__name__} is nothing that answers are kept for")
