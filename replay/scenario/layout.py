"""The names behind the columns of results."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Layout:
    """The names behind the columns, each listed once and sorted.

    Attributes:
        links: L link names.
        joints: J names of scalar joints; `joint_units` their units, "rad" or "m".
        shapes: names "link/shape" of the shapes that sensors sense, for the distance sensor's `shape` column.
        pairs: P names "link/shape|link/shape" of the pairs that are tested.
        distance_sensors: D names.
        capacitive_sensors: C names.
        objects: O names of the shapes that capacitive sensors sense.
    """

    links: tuple[str, ...]
    joints: tuple[str, ...]
    joint_units: tuple[str, ...]
    shapes: tuple[str, ...]
    pairs: tuple[str, ...]
    distance_sensors: tuple[str, ...]
    capacitive_sensors: tuple[str, ...]
    objects: tuple[str, ...]
