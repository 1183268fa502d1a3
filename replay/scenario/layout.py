"""The names behind the columns of results."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from replay.numerics.columns import Field
from replay.sensing.kinds import KINDS, of_kind


@dataclass(frozen=True)
class Layout:
    """The names behind the columns, each listed once and sorted.

    Attributes:
        links: L link names.
        joints: J names of scalar joints; `joint_units` their units, "rad" or "m".
        shapes: names "link/shape" of the shapes that sensors sense, for columns that count them.
        pairs: P names "link/shape|link/shape" of the pairs that are tested.
        objects: O names of the shapes that sensors with a value for each shape sense.
        guards: G names of guards.
        signals: names of the sensors with a signal chain, by kind.
        sensors: names by kind; those of a kind are `layout.distance_sensors` too, none where it is not there.
    """

    links: tuple[str, ...] = ()
    joints: tuple[str, ...] = ()
    joint_units: tuple[str, ...] = ()
    shapes: tuple[str, ...] = ()
    pairs: tuple[str, ...] = ()
    objects: tuple[str, ...] = ()
    guards: tuple[str, ...] = ()
    sensors: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    signals: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    def __getattr__(self, name: str) -> Any:
        return of_kind(self, name, "sensors", "_sensors", ())

    def topics(self) -> dict[str, tuple[str, str]]:
        """Return kind and name of each sensor by its topic."""
        return {KINDS[kind].topic(name): (kind, name) for kind, names in self.sensors.items() for name in names}

    def has(self, kind: str, sensor: str, column: Field) -> bool:
        """Return whether a sensor has a value in a column that its kind has."""
        return not column.signal or sensor in self.signals.get(kind, ())

    def to_json(self) -> dict[str, tuple[str, ...]]:
        """Return all names as a recording's metadata holds them; of guards and signals only where there are any."""
        values = {key: names for key, names in vars(self).items() if key not in ("sensors", "signals", "guards")}
        values |= {"guards": self.guards} if self.guards else {}
        signals = {f"{kind}_signals": names for kind, names in self.signals.items() if names}
        return values | {f"{kind}_sensors": self.sensors.get(kind, ()) for kind in KINDS} | signals

    @staticmethod
    def from_json(values: Mapping[str, Sequence[str]]) -> Layout:
        """Return the names that metadata hold; KeyError when a group is missing.

        Of a kind that the recording does not know there are no sensors.
        """
        groups = {key: values[key] for key in ("links", "joints", "joint_units", "shapes", "pairs", "objects")}
        sensors = {kind: values.get(f"{kind}_sensors", ()) for kind in KINDS}
        signals = {kind: tuple(values[f"{kind}_signals"]) for kind in KINDS if f"{kind}_signals" in values}
        return Layout(
            **{key: tuple(names) for key, names in groups.items()},
            guards=tuple(values.get("guards", ())),
            sensors={kind: tuple(names) for kind, names in sensors.items()},
            signals=signals,
        )
