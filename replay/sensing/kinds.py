"""The kinds of sensors there are, in the order in which everything lists them."""

from __future__ import annotations

import importlib
import os
from typing import Any

from replay.sensing.capacitive.kind import Capacitive
from replay.sensing.distance.kind import Distance
from replay.sensing.kind import SensorKind

_OUTSIDE = [importlib.import_module(module).KIND for module in os.environ.get("REPLAY_SENSORS", "").split()]
"""Kinds outside the package, in modules that the environment names: workers get it too, the code identity does not."""

KINDS: dict[str, SensorKind] = {kind.name: kind for kind in (Distance(), Capacitive(), *_OUTSIDE)}
"""By name; complete when this module is loaded, because the language is made of them."""


def of_kind(holder: Any, attribute: str, mapping: str, ending: str = "", nothing: Any = None) -> Any:
    """Return what a mapping by kind, an attribute of its holder, has under the kind's name; for `__getattr__`.

    Args:
        holder, mapping: where to look.
        attribute: the name of the kind, and `ending`.
        ending: what follows the name of the kind.
        nothing: for a kind that the mapping does not have.

    Raises:
        AttributeError: there is no such kind.
    """
    kind = attribute.removesuffix(ending)
    if f"{kind}{ending}" != attribute or kind not in KINDS:
        raise AttributeError(f"{type(holder).__name__!r} object has no attribute {attribute!r}")
    return vars(holder).get(mapping, {}).get(kind, nothing)
