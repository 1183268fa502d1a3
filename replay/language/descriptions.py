"""What is said of the keys of the language: the text below each field of a model, read when somebody asks.

pydantic can read it too, but does so whenever a model is made: a third of the time that importing the language takes.
"""

from __future__ import annotations

import ast
import functools
import inspect
import itertools
import sys
from collections.abc import Iterator, Mapping

from pydantic import BaseModel


def described(model: type[BaseModel], key: str) -> str | None:
    """Return what is said of a key of a model, or of the one that it was made from; None if nothing is."""
    if key not in model.model_fields:
        return None
    texts = (_texts(base.__module__).get(base.__qualname__, {}).get(key) for base in model.__mro__)
    return model.model_fields[key].description or next((text for text in texts if text), None)


@functools.cache
def _texts(module: str) -> Mapping[str, Mapping[str, str]]:
    """Return the texts below fields, by name of the class and of the field, of the classes at a module's top level."""
    try:
        tree = ast.parse(inspect.getsource(sys.modules[module]))
    except (KeyError, OSError, TypeError):  # it has no source, as what is typed in
        return {}
    return {entry.name: dict(_below_fields(entry)) for entry in tree.body if isinstance(entry, ast.ClassDef)}


def _below_fields(model: ast.ClassDef) -> Iterator[tuple[str, str]]:
    for field, below in itertools.pairwise(model.body):
        match field, below:
            case ast.AnnAssign(target=ast.Name(id=name)), ast.Expr(value=ast.Constant(value=str(text))):
                yield name, inspect.cleandoc(text)
