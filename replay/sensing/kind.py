"""What the house knows of a kind of sensor: one description, which every room loops over.

A kind is a folder of this room with a `SensorKind` in it, and a line in `kinds`. Its YAML part, its methods, how it is
computed, drawn and charted, and the table of what it reads stand there; nothing else in the house names it. What a
description imports at its top must be light: `replay validate` loads it.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Protocol

from numpy.typing import NDArray

from replay.language.fields import Part, rejected
from replay.language.node import KeyPath
from replay.language.units import Dimension
from replay.numerics.arrays import Flags, Floats
from replay.numerics.columns import Columns

if TYPE_CHECKING:
    from replay.kinematics.linkage import LinkPoses
    from replay.sensing.target import Target

Color = tuple[int, int, int, int]
"""Red, green, blue and opacity, 0 to 255."""


class Method(Part):
    """How sensors of a kind are computed, as it is written in a model; options that are left out are None."""

    method: str

    def options(self) -> dict[str, Any]:
        """Return the options that have an effect with this method, those left out as they are then."""
        return {}

    def _belongs(self, needed: str, *keys: str) -> None:
        """Refuse options that have no effect."""
        for key in keys:
            if getattr(self, key) is not None and self.method != needed:
                rule = f"has no effect with method {self.method}; it belongs to method {needed}"
                raise rejected(rule, at=(key,))


class Suite(Protocol):
    """All sensors of a kind in a scene."""

    def run(self, poses: LinkPoses) -> Columns:
        """Return their readings in all frames of a block."""

    def notes(self) -> tuple[str, ...]:
        """Return what a reader should know of the frames so far, one line each."""


@dataclass(frozen=True)
class Expected:
    """What can be expected of a reading: bounds of a number, or in how many frames something is so.

    Attributes:
        what: as in "largest distance 2 m", "detected in no frame"; the key of an expectation that holds the word
            ("never"), or the mapping with `min` and `max`.
        values: takes the columns, returns (n, S): NaN is no value; something is so where it is above 0.
        unit: of bounds; "" for what is so or not.
        inside: False for bounds that are keys of the expectation itself.
    """

    what: str
    values: Callable[[Any], NDArray[Any]]
    unit: str = ""
    inside: bool = True


@dataclass(frozen=True)
class Output:
    """The number that a sensor's electronics make a signal of; the column `measured` holds the signal.

    Attributes:
        reading: takes the columns, returns (n, S): the ideal one, NaN where there is none.
        beyond: takes the columns, returns (n, S): whether something is nearer than the sensor reads.
        substitute: takes a sensor as it is written, returns what its filter takes where there is no reading.
        condition: what a guard may ask of it, as it is written; the key `name` of the kind names the sensor.
        threshold: takes such a condition, returns below which value it holds.
        dimension: of the reading.
    """

    reading: Callable[[Any], Floats]
    beyond: Callable[[Any], Flags]
    substitute: Callable[[Any], float]
    condition: type[Part]
    threshold: Callable[[Any], float]
    dimension: Dimension


@dataclass(frozen=True, eq=False)
class Drawing:
    """How a sensor is drawn, in its link's frame [m].

    Attributes:
        color: of lines and faces; `width` of lines, in pixels.
        strips: line strips (k, 3).
        faces: rectangles by name, (4, 3) corners, counter-clockwise seen from the front.
        extent: (k, 3) points that the first picture shows; a `beam` begins at the first.
    """

    color: Color
    width: float
    strips: Sequence[Floats]
    extent: Floats
    faces: Mapping[str, Floats]


class SensorKind(ABC):
    """A kind of sensor.

    Attributes:
        name: key of its sensors, methods and expectations in YAML; begins its topics, `/name/<sensor>`, and names its
            group of columns, `block.name`, and of sensors, `layout.name_sensors`.
        part: a sensor as it is written; `link` and `ignore` are among its keys.
        method: its methods as they are written.
        revisions: of each method; raised when its results change beyond the shipped rules, recorded with every result.
        slow: the methods that take seconds a frame.
        models: its method in built-in models, by their names.
        expectation: what can be expected, as it is written; the key `name` names the sensor.
        expected: the same, as what is taken from the columns.
        output: what becomes a signal where a sensor as it is written has a `signal`; None where none can have one.
        columns: what it reads: (n, S, ...) of n frames and S sensors. A field keeps its place, which is its number in
            messages; a new one is the last.
    """

    name: str
    part: type[Part]
    method: type[Method]
    revisions: ClassVar[Mapping[str, int]]
    slow: ClassVar[Collection[str]] = ()
    models: ClassVar[Mapping[str, Method]] = {}
    expectation: type[Part]
    expected: Sequence[Expected]
    output: ClassVar[Output | None] = None
    columns: type[Columns]

    @property
    def message(self) -> str:
        """Name of its message type."""
        return f"replay.{self.name.title().replace('_', '')}Reading"

    def topic(self, sensor: str) -> str:
        """Return the topic of a sensor."""
        return f"/{self.name}/{sensor}"

    def suite(
        self,
        sensors: Sequence[Any],
        targets: Sequence[Target],
        method: Method,
        *,
        savings: bool,
        watched: frozenset[str] = frozenset(),
    ) -> Suite:
        """Return the sensors of a scene.

        Args:
            sensors, targets, method: of the scene.
            savings: see `simulation.simulate`.
            watched: names of the sensors whose readings of a frame must not depend on the frames after it, because
                guards look at them. Where a method computes each frame by itself, that is so anyway.

        Raises:
            MissingPackageError: the method names an engine that is not installed.
        """
        made: Suite = self.module().SUITE(sensors, targets, method=method.method, savings=savings, **method.options())
        return made

    def kernels(self, method: Method, *, savings: bool) -> tuple[Any, ...]:
        """Return the kernels that such a suite calls."""
        found: tuple[Any, ...] = self.module().kernels(method=method.method, savings=savings, **method.options())
        return found

    @abstractmethod
    def module(self) -> Any:
        """Return, imported now, the module with the class `SUITE` of its suites and the function `kernels`.

        Both take `method`, `savings` and the options of the method.
        """

    @abstractmethod
    def sensor(self, name: str, part: Any, link: int, ignored_links: frozenset[int]) -> Any:
        """Return a sensor of how it is written, on a link by its index; it has a `name` and a `link`."""

    def own_shapes(self, part: Any) -> Mapping[KeyPath, str]:
        """Return the shapes of its own link that a sensor as it is written names, by where it does."""
        return {}

    def with_shapes(self, sensor: Any, part: Any, shapes: Mapping[str, Floats]) -> Any:
        """Return a sensor that knows the shapes of its own link: triangles (n, 3, 3) [m] by name; most need none."""
        return sensor

    def faults(
        self, parts: Mapping[str, Any], felt: Callable[[], Mapping[str, Sequence[str]]], method: Any
    ) -> Iterator[tuple[tuple[str, ...], str]]:
        """Yield what of sensors as they are written a method cannot compute; as `notes`, `felt` asked if it matters."""
        yield from ()

    def notes(
        self, parts: Mapping[str, Any], felt: Mapping[str, Sequence[str]], earth: Mapping[str, float], method: Any
    ) -> Iterator[tuple[tuple[str, ...], str]]:
        """Yield what a reader should know of sensors as they are written, each with its path from the kind's on.

        Args:
            parts: the sensors by name.
            felt: the links that each senses.
            earth: of each link, see `sensing.target.Target`.
            method: how they are computed.
        """
        yield from ()

    @abstractmethod
    def drawing(self, sensor: Any) -> Drawing:
        """Return how a sensor is drawn."""

    @abstractmethod
    def cost(self, part: Any, triangles: int) -> float:
        """Return about how long a frame of a sensor takes before so many triangles; 1 is a pair that is not near."""
