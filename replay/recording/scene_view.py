"""What a recording shows of a scene: bodies and sensors, each on its link."""

from __future__ import annotations

import functools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from replay.guarding.guard import PairLeaf, SensorLeaf, leaves
from replay.numerics.arrays import Floats, Integers
from replay.numerics.kept import kept
from replay.recording.blueprint import CHARTED, CLEARANCE
from replay.sensing.kind import Color, Drawing
from replay.sensing.kinds import KINDS

if TYPE_CHECKING:
    from replay.scenario.scene import Scene


@dataclass(frozen=True, eq=False)
class BodyView:
    """A shape as it is drawn.

    Attributes:
        name: "link/shape".
        link: index of its link.
        triangles: (t, 3, 3) [m] in the link's frame.
        color: while nothing is near.
    """

    name: str
    link: int
    triangles: Floats
    color: Color


@dataclass(frozen=True, eq=False)
class SensorView:
    """A sensor as it is drawn.

    Attributes:
        kind, name: which one.
        link: index of its link.
        drawing: in its link's frame.
    """

    kind: str
    name: str
    link: int
    drawing: Drawing


@dataclass(frozen=True, eq=False)
class SceneView:
    """Everything that is drawn.

    Attributes:
        name, description: of the scenario; the description may be several lines of Markdown.
        texts: the scenario's own text files, by name.
        links: L names.
        thresholds: lines in charts: the chart, what the line is called, and where it is.
        slowed: names of the joints that guards slow down.
        bodies, sensors: see there.
    """

    name: str
    description: str
    links: tuple[str, ...]
    bodies: tuple[BodyView, ...]
    sensors: tuple[SensorView, ...] = ()
    texts: Mapping[str, str] = field(default_factory=dict)
    thresholds: tuple[tuple[str, str, float], ...] = ()
    slowed: tuple[str, ...] = ()

    @functools.cached_property
    def meshes(self) -> Meshes:
        """The bodies' triangles with the vertices that they share."""
        return indexed([body.triangles for body in self.bodies])


@dataclass(frozen=True, eq=False)
class Meshes:
    """The triangles of bodies, all in one, with the vertices that those of one body share.

    Attributes:
        triangles: (t, 3, 3) [m], body after body.
        vertices: (v, 3) [m], body after body, sorted.
        index: (t, 3) into `vertices`.
        first_triangle, first_vertex: (bodies + 1,) where each body begins, and the end.
    """

    triangles: Floats
    vertices: Floats
    index: Integers
    first_triangle: Integers
    first_vertex: Integers

    def body(self, k: int) -> tuple[Floats, Integers]:
        """Return vertices (v, 3) of a body and its triangles (t, 3) as indices into them."""
        begin = self.first_vertex[k]
        index = self.index[self.first_triangle[k] : self.first_triangle[k + 1]] - begin
        return self.vertices[begin : self.first_vertex[k + 1]], index


@kept
def indexed(bodies: Sequence[Floats]) -> Meshes:
    """Return triangles (t, 3, 3) [m] of bodies with each vertex once: all in one pass, because bodies are many."""
    triangles = np.concatenate([np.zeros((0, 3, 3)), *bodies]) + 0.0  # -0.0 and 0.0 are one vertex
    counts = [len(body) for body in bodies]
    corner = triangles.reshape(-1, 3)
    owner = np.repeat(np.arange(len(bodies)), 3 * np.array(counts, dtype=np.int64))
    order = np.lexsort((corner[:, 2], corner[:, 1], corner[:, 0], owner))
    corner, owner = corner[order], owner[order]
    new = np.ones(len(corner), dtype=np.bool_)
    new[1:] = (corner[1:] != corner[:-1]).any(axis=1) | (owner[1:] != owner[:-1])
    index = np.empty(len(corner), dtype=np.int64)
    index[order] = np.cumsum(new) - 1
    vertices_of = np.bincount(owner[new], minlength=len(bodies))
    return Meshes(triangles, corner[new], index.reshape(-1, 3), _begins(counts), _begins(vertices_of))


def _begins(counts: Sequence[int] | Integers) -> Integers:
    return np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)


def view(scene: Scene) -> SceneView:
    """Return what a recording shows of a scene."""
    scenario = scene.scenario
    notes = "\n".join(f"- {note}" for note in scene.notes)
    return SceneView(
        name=scenario.name,
        description="\n\n".join(part for part in (scenario.description, notes) if part),
        links=scene.layout.links,
        bodies=tuple(BodyView(s.name, s.link, s.solid.triangles, s.color) for s in scene.shapes),
        sensors=tuple(
            SensorView(kind, sensor.name, sensor.link, KINDS[kind].drawing(sensor))
            for kind, sensors in scene.sensors.items()
            for sensor in sensors
        ),
        texts={
            name: data.decode(errors="replace")
            for name, data in scenario.sources.items()
            if name.endswith((".yaml", ".yml"))
        },
        thresholds=tuple(_thresholds(scene)),
        slowed=tuple(sorted({joint for guard in scenario.guards.values() for joint in guard.joints})),
    )


def _thresholds(scene: Scene) -> Iterator[tuple[str, str, float]]:
    """Yield the thresholds of sensors and clearances at which guards act."""
    made = scene.guards.guards if scene.guards is not None else ()
    for guard in made:
        for leaf in leaves(guard.when):
            if isinstance(leaf, PairLeaf) and leaf.below > 0.0:
                yield CLEARANCE, f"{guard.name} acts", leaf.below
            if isinstance(leaf, SensorLeaf):
                name = scene.layout.sensors[leaf.kind][leaf.column]
                charts = {field.name: chart for chart, field in CHARTED[leaf.kind].items()}
                measured = name in scene.layout.signals.get(leaf.kind, ())
                yield charts["measured"] if measured else leaf.kind, f"{guard.name} acts on {name}", leaf.below
