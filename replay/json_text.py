"""JSON from files that nobody vouches for: within bounds, and as values of the types that are asked for."""

from __future__ import annotations

import functools
import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

from pydantic_core import from_json

from replay import limits

_SURROGATE = re.compile(rb"\\u[dD][89a-fA-F]")

Value = TypeVar("Value")


def read_json(text: bytes | str, *, most: int = limits.JSON_BYTES, surrogates: bool = False) -> Any:
    """Return what a JSON text holds.

    Args:
        text: in UTF-8.
        most: its largest size [bytes].
        surrogates: take halves of surrogate pairs too: names of files that are no text hold them.

    Raises:
        ValueError: it is no JSON, or more or deeper than is read; its text is one line.
    """
    if len(text) > most:
        raise ValueError(f"it has {len(text)} bytes; at most {most} are read")
    data = text.encode(errors="replace") if isinstance(text, str) else text
    groups = data.count(b"[") + data.count(b"{") if len(data) > limits.JSON_GROUPS else 0
    if groups > limits.JSON_GROUPS:
        raise ValueError(f"it has {groups} lists and objects; at most {limits.JSON_GROUPS} are read")
    try:
        return from_json(text)
    except ValueError:
        pass  # what it takes is JSON, but not all JSON is taken: `json` judges the rest, and says what is wrong
    try:
        value = json.loads(text)
        if not surrogates and _SURROGATE.search(data):
            json.dumps(value, ensure_ascii=False).encode()
        return value
    except UnicodeEncodeError:
        raise ValueError("a text in it holds half of a surrogate pair, which is no character") from None
    except UnicodeDecodeError:
        raise ValueError("it is not UTF-8") from None
    except json.JSONDecodeError as error:
        raise ValueError(f"it is no JSON: {error.msg} in line {error.lineno}, column {error.colno}") from None
    except ValueError:
        raise ValueError("a number in it is too long") from None
    except RecursionError:
        raise ValueError("its lists and objects are nested too deeply") from None


def read_json_file(path: Path, *, surrogates: bool = False) -> Any:
    """Return what a file of JSON beside recordings holds; OSError or ValueError when there is none.

    What is no plain file, such as a pipe, is none. `surrogates` as of `read_json`.
    """
    if not path.is_file():
        raise FileNotFoundError(str(path))
    if path.stat().st_size > limits.RECORD_JSON:
        raise ValueError(f"it has more than {limits.RECORD_JSON} bytes")
    return read_json(path.read_bytes(), surrogates=surrogates)


def typed(value: Any, type_: Callable[..., Value]) -> Value:
    """Return a value of JSON as one of a type that pydantic knows; nothing is converted, and what is more is left out.

    Raises:
        ValueError: it is not of that type; its text is one line that names the place.
    """
    from pydantic import ValidationError

    try:
        checked: Value = _adapter(type_).validate_python(value, strict=True)
        return checked
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False, include_context=False)[0]
        place = ".".join(str(step)[:60] for step in first["loc"])
        raise ValueError(f"{place}: {first['msg']}" if place else first["msg"]) from None


@functools.cache
def _adapter(type_: Callable[..., Any]) -> Any:
    from pydantic import TypeAdapter

    kind: Any = type_
    return TypeAdapter(kind)
