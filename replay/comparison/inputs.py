"""What differs between two scenarios as they are meant: value by value, whatever units and files they stand in."""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from typing import Any, get_args

import numpy as np
from pydantic import BaseModel

from replay.comparison import quantities
from replay.language.fields import Placement
from replay.language.node import KeyPath
from replay.language.units import AnyQuantity, Dimensioned, Quantity
from replay.scenario.model import Scenario
from replay.scenario.shapes import MeshPart
from replay.scenario.source import dotted

_SILENT = ("version", "name", "description", "tags", "sweep", "include", "model")
"""Keys of a scenario that change no result, or that the recording's metadata tell better."""
_LONG = 60
_ALIGNED = 500
"""Entries of a list that are looked for at other places, where entries were put in or taken out."""
_SAME_ROTATION = 1e-12
"""Largest difference of the matrices of rotations that are the same but for how they are written."""


def input_changes(baseline: Scenario, candidate: Scenario) -> Iterator[str]:
    """Yield what differs, a line each: "person/body radius 20 -> 21 cm", "links.arm.joint.lower -90 -> -80 deg".

    Names of mesh files are left out: what changes a result is their triangles.
    """
    for name in type(candidate).model_fields:
        if name not in _SILENT:
            yield from _model_field(baseline, candidate, name, ())


def _model_field(a: BaseModel, b: BaseModel, name: str, path: KeyPath) -> Iterator[str]:
    key, quantity = _field(b, name)
    if name != "reason" and not (name == "file" and isinstance(b, MeshPart)):
        yield from _changes(getattr(a, name), getattr(b, name), (*path, key), quantity)


def _field(part: BaseModel, name: str) -> tuple[str, Quantity | None]:
    """Return the key of a field, and the quantity that numbers in it are."""
    info = type(part).model_fields[name]
    found = _quantity(info.metadata) or _quantity(get_args(info.annotation)) or _quantity([info.annotation])
    return info.alias or name, found


def _changes(a: Any, b: Any, path: KeyPath, quantity: Quantity | None) -> Iterator[str]:
    """Yield the changes at a path and below; `quantity` is what numbers are there, where their type says it."""
    if isinstance(a, BaseModel) and isinstance(b, BaseModel):
        kinds = getattr(a, "type", None), getattr(b, "type", None)
        if type(a) is not type(b):
            texts = _text(kinds[0] or a, None), _text(kinds[1] or b, None)
            yield f"{_place((*path, 'type') if kinds[0] else path)} {texts[0]} -> {texts[1]}"
        elif isinstance(a, Placement) and isinstance(b, Placement):
            yield from _placements(a, b, path)
        else:
            for name in type(b).model_fields:
                yield from _model_field(a, b, name, path)
    elif isinstance(a, Mapping) and isinstance(b, Mapping):
        yield from _mappings(a, b, path, quantity)
    elif isinstance(a, list | tuple) and isinstance(b, list | tuple):
        yield from _lists(a, b, path, quantity)
    elif a is None and isinstance(b, BaseModel | Mapping | list | tuple):
        yield f"{_place(path)} added"
    elif b is None and isinstance(a, BaseModel | Mapping | list | tuple):
        yield f"{_place(path)} removed"
    elif not _same(a, b):
        yield f"{_place(path)} {_change(a, b, quantity)}"


def _placements(a: Placement, b: Placement, path: KeyPath) -> Iterator[str]:
    """Yield how two poses differ; a rotation may be written in two ways, and be left out."""
    for name in type(b).model_fields:
        if name not in ("rpy", "quat_xyzw"):
            yield from _model_field(a, b, name, path)
    if a.quat_xyzw is None and b.quat_xyzw is None:
        level = (0.0, 0.0, 0.0)
        yield from _changes(a.rpy or level, b.rpy or level, (*path, "rpy"), _field(b, "rpy")[1])
        return
    turned = a.transform()[:3, :3].T @ b.transform()[:3, :3]
    if np.abs(turned - np.eye(3)).max() <= _SAME_ROTATION:
        return
    if a.quat_xyzw is not None and b.quat_xyzw is not None:
        yield from _model_field(a, b, "quat_xyzw", path)
    else:
        angle = math.atan2(np.linalg.norm(turned - turned.T) / math.sqrt(2.0), np.trace(turned) - 1.0)
        yield f"{_place(path)} turned by {quantities.shown(angle, 'rad')}"


def _mappings(a: Mapping[Any, Any], b: Mapping[Any, Any], path: KeyPath, quantity: Quantity | None) -> Iterator[str]:
    """Yield how two mappings differ; parts that go and come again under another name are renamed."""
    gone: dict[str, list[Any]] = {}
    for key, value in a.items():
        if key not in b and isinstance(value, BaseModel):
            gone.setdefault(repr(value), []).append(key)
    renamed = {of.pop(0): key for key, value in b.items() if key not in a and (of := gone.get(repr(value)))}
    new = set(renamed.values())
    for key in dict.fromkeys((*a, *b)):
        if key in a and key in b:
            yield from _changes(a[key], b[key], (*path, key), quantity)
        elif key in renamed:
            yield f"{_place((*path, key))} renamed {renamed[key]}"
        elif key not in new:
            yield f"{_place((*path, key))} {'added' if key in b else 'removed'}"


def _lists(a: Sequence[Any], b: Sequence[Any], path: KeyPath, quantity: Quantity | None) -> Iterator[str]:
    """Yield how two lists differ: what was put in or taken out, wherever that is, and what changed of the rest."""
    for old, new in _pairs(a, b):
        if old is not None and new is not None:
            yield from _changes(a[old], b[new], (*path, new), quantity)
        elif new is not None:
            yield f"{_place((*path, new))} added"
        elif old is not None:
            yield f"{_place((*path, old))} removed"


def _pairs(a: Sequence[Any], b: Sequence[Any]) -> Iterator[tuple[int | None, int | None]]:
    """Yield the numbers of the entries that correspond, None for one that the other list does not have.

    Numbers, such as those of a vector, correspond by their places.
    """
    blocks: Sequence[tuple[str, int, int, int, int]] = [("replace", 0, len(a), 0, len(b))]
    if max(len(a), len(b)) <= _ALIGNED and not any(isinstance(value, int | float) for value in (*a, *b)):
        blocks = difflib.SequenceMatcher(None, list(map(repr, a)), list(map(repr, b)), autojunk=False).get_opcodes()
    for kind, begin_a, end_a, begin_b, end_b in blocks:
        if kind == "equal":
            continue
        for k in range(max(end_a - begin_a, end_b - begin_b)):
            old, new = begin_a + k, begin_b + k
            yield (old if old < end_a else None), (new if new < end_b else None)


def _same(a: Any, b: Any) -> bool:
    if isinstance(a, Dimensioned) and isinstance(b, Dimensioned) and None in (a.dimension, b.dimension):
        return a.value == b.value
    return type(a) is type(b) and bool(a == b or (isinstance(a, float) and math.isnan(a) and math.isnan(b)))


def _change(a: Any, b: Any, quantity: Quantity | None) -> str:
    """Return "20 -> 21 cm" of two numbers in one unit, else each value with its own."""
    numbers = [value for value in (_number(a), _number(b)) if value is not None and math.isfinite(value)]
    units = {unit for unit in (_unit(a, quantity), _unit(b, quantity)) if unit}
    if len(numbers) == 2 and len(units) <= 1 and not any(_word(value, quantity) for value in numbers):
        return quantities.written(numbers[0], numbers[1], "".join(units))
    return f"{_text(a, quantity)} -> {_text(b, quantity)}"


def _number(value: Any) -> float | None:
    if isinstance(value, Dimensioned):
        return value.value
    if isinstance(value, int | float | Fraction) and not isinstance(value, bool):
        return float(value)
    return None


def _unit(value: Any, quantity: Quantity | None) -> str:
    if isinstance(value, Dimensioned) and value.dimension is not None:
        return value.dimension.si
    return "" if quantity is None else quantity.dimension.si


def _word(value: Any, quantity: Quantity | None) -> str:
    """Return the word that a value may be written as; "" for none."""
    return next((word for word, meant in quantity.words if meant == value), "") if quantity is not None else ""


def _text(value: Any, quantity: Quantity | None) -> str:
    """Return a value as it may be written, cut to what a line has room for."""
    text = _flow(value, quantity)
    return text if len(text) <= _LONG else f"{text[:_LONG]}..."


def _flow(value: Any, quantity: Quantity | None) -> str:
    """Return a value as YAML in one line; of a part the keys that were written."""
    number = _number(value)
    if number is not None:
        unit = _unit(value, quantity) if math.isfinite(number) else ""
        return _word(value, quantity) or quantities.exact(number, unit)
    match value:
        case None:
            return "-"
        case bool():
            return str(value).lower()
        case BaseModel():
            told = [name for name in type(value).model_fields if name in value.model_fields_set]
            parts = (f"{key}: {_flow(getattr(value, name), of)}" for name in told for key, of in [_field(value, name)])
            return f"{{{', '.join(parts)}}}"
        case Mapping():
            return f"{{{', '.join(f'{key}: {_flow(one, quantity)}' for key, one in value.items())}}}"
        case list() | tuple():
            return f"[{', '.join(_flow(one, quantity) for one in value)}]"
    return " ".join(str(value).split())


def _place(path: KeyPath) -> str:
    """Return "person/body radius" of a shape's key, else the path of the YAML key."""
    if len(path) > 3 and path[0] == "links" and path[2] == "shapes":
        below = dotted(path[4:])
        return f"{path[1]}/{path[3]} {below}".rstrip()
    return dotted(path)


def _quantity(annotations: Any) -> Quantity | None:
    """Return the first quantity in a type; None without one, or with one of several dimensions."""
    for one in annotations:
        if isinstance(one, Quantity):
            return one
        if isinstance(one, AnyQuantity):
            return None
        found = _quantity((*getattr(one, "__metadata__", ()), *get_args(one)))
        if found:
            return found
    return None
