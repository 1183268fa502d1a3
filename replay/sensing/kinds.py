"""The kinds of sensors there are, in the order in which everything lists them."""

from __future__ import annotations

import importlib
import os
from typing import Any

from replay.sensing.capacitive.kind import Capacitive
from replay.sensing.distance.kind import Distance
from replay.sensing.kind import SensorKind

KINDS: dict[str, SensorKind] = {}
"""By name; complete when this module is loaded, because the language is made of them."""


def _add(kind: SensorKind) -> None:
    events = {event for other in KINDS.values() for field in other.columns.fields() for event in field.events}
    assert not events & {event for field in kind.columns.fields() for event in field.events}, "an event has two kinds"
    KINDS[kind.name] = kind


for _kind in (Distance(), Capacitive()):
    _add(_kind)
for _module in os.environ.get("REPLAY_SENSORS", "").split():  # modules outside the package with a KIND each
    _add(importlib.import_module(_module).KIND)


def of_kind(holder: Any, attribute: str, mapping: str, ending: str = "", nothing: Any = None) -> Any:
    """Return what a mapping by kind holds, by an attribute named after the kind; for `__getattr__` of the holder.

    Args:
        holder: has the mapping.
        attribute: the name of the kind, and `ending`.
        mapping: its attribute that is the mapping.
        ending: what follows the name of the kind.
        nothing: for a kind that the mapping does not hold.

    Raises:
        AttributeError: there is no such kind.
    """
    kind = attribute.removesuffix(ending)
    if f"{kind}{ending}" != attribute or kind not in KINDS:
        raise AttributeError(f"{type(holder).__name__!r} object has no attribute {attribute!r}")
    return vars(holder).get(mapping, {}).get(kind, nothing)
