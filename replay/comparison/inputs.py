"""What differs between two scenarios as they are meant: value by value, whatever units and files they stand in."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from fractions import Fraction
from typing import Any, get_args

from pydantic import BaseModel

from replay.comparison import quantities
from replay.language.node import KeyPath
from replay.language.units import AnyQuantity, Dimensioned, Quantity
from replay.scenario.model import Scenario
from replay.scenario.source import dotted

_SILENT = ("version", "name", "description", "tags", "sweep", "include", "model")
"""Keys of a scenario that change no result, or that the recording's metadata tell better."""
_LONG = 60


def input_changes(baseline: Scenario, candidate: Scenario) -> Iterator[str]:
    """Yield what differs, a line each: "person/body radius 20 -> 21 cm", "links.arm.joint.lower -90 -> -80 deg"."""
    for name in type(candidate).model_fields:
        if name not in _SILENT:
            yield from _model_field(baseline, candidate, name, ())


def _model_field(a: BaseModel, b: BaseModel, name: str, path: KeyPath) -> Iterator[str]:
    info = type(b).model_fields[name]
    key = info.alias or name
    unit = _unit(info.metadata) or _unit(get_args(info.annotation)) or _unit([info.annotation])
    yield from _changes(getattr(a, name), getattr(b, name), (*path, key), unit)


def _changes(a: Any, b: Any, path: KeyPath, unit: str) -> Iterator[str]:
    """Yield the changes at a path and below; `unit` is that of numbers there, where their type says it."""
    if isinstance(a, BaseModel) and isinstance(b, BaseModel):
        kinds = getattr(a, "type", None), getattr(b, "type", None)
        if type(a) is not type(b):
            yield f"{_place((*path, 'type') if kinds[0] else path)} {_text(kinds[0], a)} -> {_text(kinds[1], b)}"
            return
        for name in type(b).model_fields:
            yield from _model_field(a, b, name, path)
    elif isinstance(a, Mapping) and isinstance(b, Mapping):
        for key in dict.fromkeys((*a, *b)):
            if key in a and key in b:
                yield from _changes(a[key], b[key], (*path, key), unit)
            else:
                yield f"{_place((*path, key))} {'added' if key in b else 'removed'}"
    elif isinstance(a, list | tuple) and isinstance(b, list | tuple):
        for index in range(max(len(a), len(b))):
            if index < min(len(a), len(b)):
                yield from _changes(a[index], b[index], (*path, index), unit)
            else:
                yield f"{_place((*path, index))} {'added' if index < len(b) else 'removed'}"
    elif not _same(a, b):
        yield f"{_place(path)} {_change(a, b, unit)}"


def _same(a: Any, b: Any) -> bool:
    return type(a) is type(b) and bool(a == b or (isinstance(a, float) and math.isnan(a) and math.isnan(b)))


def _change(a: Any, b: Any, unit: str) -> str:
    values = [_number(value) for value in (a, b)]
    if values[0] is not None and values[1] is not None:
        known = next((v.dimension.si for v in (a, b) if isinstance(v, Dimensioned) and v.dimension), unit)
        return quantities.written(values[0], values[1], known)
    texts = [quantities.exact(n, unit) if n is not None else _text(v) for n, v in zip(values, (a, b), strict=True)]
    return " -> ".join(texts)


def _number(value: Any) -> float | None:
    if isinstance(value, Dimensioned):
        return value.value
    if isinstance(value, int | float | Fraction) and not isinstance(value, bool):
        return float(value)
    return None


def _text(value: Any, instead: Any = None) -> str:
    """Return a value that is no number, cut to what a line has room for."""
    if value is None and instead is None:
        return "-"
    shown = type(instead).__name__ if value is None else value
    if isinstance(shown, bool):
        return str(shown).lower()
    if isinstance(shown, BaseModel):
        shown = shown.model_dump(exclude_defaults=True)
    text = " ".join(str(shown).split())
    return text if len(text) <= _LONG else f"{text[:_LONG]}..."


def _place(path: KeyPath) -> str:
    """Return "person/body radius" of a shape's key, else the path of the YAML key."""
    if len(path) > 3 and path[0] == "links" and path[2] == "shapes":
        below = dotted(path[4:])
        return f"{path[1]}/{path[3]} {below}".rstrip()
    return dotted(path)


def _unit(annotations: Any) -> str:
    """Return the SI unit of the first quantity in a type; "" without one, or with one of several dimensions."""
    for one in annotations:
        if isinstance(one, Quantity):
            return one.dimension.si
        if isinstance(one, AnyQuantity):
            return ""
        found = _unit((*getattr(one, "__metadata__", ()), *get_args(one)))
        if found:
            return found
    return ""
