"""A scenario as arrays, ready to be simulated: everything that is constant over its frames is computed here, once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

from replay.collision.pairs import CollisionBody, DisabledPair, Pair, plan_pairs
from replay.errors import InvalidValue, MeshError, Problem, ScenarioError
from replay.geometry import primitives
from replay.geometry.mesh import load_mesh
from replay.geometry.solid import Solid
from replay.kinematics.linkage import Linkage
from replay.kinematics.motion import Script
from replay.numerics.arrays import Floats, Integers
from replay.scenario import frames, shapes
from replay.scenario.expectation_check import ExpectationCheck, matching_pairs
from replay.scenario.expectations import PairExpectation
from replay.scenario.guards import SceneGuards, scene_guards
from replay.scenario.layout import Layout
from replay.scenario.load import load_model
from replay.scenario.methods import Model
from replay.scenario.model import Scenario
from replay.scenario.names import matches
from replay.scenario.notes import notes, piece_notes, sensor_faults
from replay.scenario.script import linkage, script
from replay.sensing.kinds import KINDS, of_kind
from replay.sensing.signal.chain import Chain, Signals
from replay.sensing.target import Target, make_target

Color = tuple[int, int, int, int]
"""Red, green, blue and opacity, 0 to 255."""


@dataclass(frozen=True, eq=False)
class SceneShape:
    """A shape on its link.

    Attributes:
        name: "link/shape".
        link: index of its link.
        solid: in the link's frame.
        color: in recordings.
        collides, sensed: whether it takes part in collision detection, and whether sensors sense it.
    """

    name: str
    link: int
    solid: Solid
    color: Color
    collides: bool
    sensed: bool


@dataclass(frozen=True, eq=False)
class Scene:
    """What a scenario simulates.

    Attributes:
        scenario: where it comes from.
        model: the version of each method: the scenario's own, or the one that replaces it.
        savings: whether work is left out that the scene does not need, see `simulation.simulate`.
        linkage, script: links, joints, and how they move.
        shapes: all shapes, sorted by name.
        bodies, pairs: what is tested for collision; no bodies when no pair is.
        targets: what sensors sense, sorted by name; none when there are no sensors.
        sensors: by kind, sorted by name; those of a kind are `scene.distance_sensors` too.
        signals: the signal chains of the kinds of which a sensor has one.
        guards: what guards look at and do; None when there are none.
        layout: the names behind the columns of results.
        notes: what a reader should know about the scenario and its meshes, one line each.
    """

    scenario: Scenario
    model: Model
    savings: bool
    linkage: Linkage
    script: Script
    shapes: tuple[SceneShape, ...]
    bodies: tuple[CollisionBody, ...]
    pairs: tuple[Pair, ...]
    targets: tuple[Target, ...]
    sensors: Mapping[str, tuple[Any, ...]]
    signals: Mapping[str, Signals]
    guards: SceneGuards | None
    layout: Layout
    notes: tuple[str, ...]

    def __getattr__(self, name: str) -> Any:
        return of_kind(self, name, "sensors", "_sensors", ())

    @property
    def frames(self) -> int:
        """Number of frames."""
        return self.scenario.frames

    @property
    def counts(self) -> dict[str, int]:
        """How many of what there are, by what people call it."""
        return {
            "shapes": len(self.shapes),
            "triangles": sum(len(shape.solid.triangles) for shape in self.shapes),
            "pairs": len(self.pairs),
            **{f"{kind}_sensors": len(sensors) for kind, sensors in self.sensors.items()},
        }

    @property
    def margin(self) -> float:
        """Clearances up to this one are computed [m] when the model says near."""
        return self.scenario.collision.margin

    def time_ns(self, begin: int, end: int) -> Integers:
        """Return the times (end - begin,) [ns] of frames begin..end-1."""
        return frames.time_ns(Fraction(self.scenario.rate), begin, end)

    def seconds(self, begin: int, end: int) -> Floats:
        """Return the times (end - begin,) [s] of frames begin..end-1."""
        return frames.seconds(Fraction(self.scenario.rate), begin, end)

    def expectation_check(self) -> ExpectationCheck:
        """Return what follows the scenario's expectations over all frames."""
        return ExpectationCheck(
            self.scenario.expect,
            self.layout,
            clearance=self.model.collision.clearance,
            margin=self.margin,
            provenance=self.scenario.provenance,
        )


def build(scenario: Scenario, *, model: Model | str | Path | None = None, savings: bool = True) -> Scene:
    """Return the scene of a scenario.

    Args:
        scenario: as loaded.
        model: replaces the scenario's own model; a built-in model's name, or a file that holds one, will do.
        savings: see `Scene`.

    Raises:
        ScenarioError: a mesh cannot be used, a shape needs too many triangles, an expectation is about a pair that is
            not tested, the model cannot compute the sensors, or its file is not valid; each with its place.
    """
    model = load_model(model) if isinstance(model, str | Path) else model or scenario.model
    faults = sensor_faults(scenario, model)
    if faults:
        raise ScenarioError(faults)
    machine = linkage(scenario)
    scene_shapes, mesh_notes = _shapes(scenario, machine)
    bodies, pairs = _collision(scenario, machine, scene_shapes)
    sensors = {kind: _sensors(scenario, machine, kind, scene_shapes) for kind in KINDS}
    signals = {kind: made for kind in KINDS if (made := _signals(scenario, kind)).chains}
    sensed = [shape for shape in scene_shapes if shape.sensed] if any(sensors.values()) else []
    targets = tuple(
        make_target(
            shape.name,
            shape.link,
            shape.solid.triangles,
            closing=shape.solid.closing_of_inside,
            earth=scenario.links[machine.link_names[shape.link]].earth,
        )
        for shape in sensed
    )
    names = tuple(target.name for target in targets)
    layout = Layout(
        links=machine.link_names,
        joints=machine.joint_names,
        joint_units=tuple(joint.type.unit for joint in machine.joints),
        shapes=names,
        pairs=tuple(pair.name for pair in pairs),
        objects=names if any(sensors[kind] and _each_object(kind) for kind in KINDS) else (),
        sensors={kind: tuple(sensor.name for sensor in found) for kind, found in sensors.items()},
        guards=tuple(sorted(scenario.guards)),
        signals={kind: tuple(made.names()) for kind, made in signals.items()},
    )
    _check_expectations(scenario, layout)
    played = script(scenario)
    guards = scene_guards(scenario.guards, Fraction(scenario.rate), machine, played, layout, signals)
    solids = {_link_and_shape(shape.name): shape.solid for shape in scene_shapes}
    return Scene(
        scenario=scenario,
        model=model,
        savings=savings,
        linkage=machine,
        script=played,
        shapes=scene_shapes,
        bodies=bodies,
        pairs=pairs,
        targets=targets,
        sensors=sensors,
        signals=signals,
        guards=guards,
        layout=layout,
        notes=(
            *(note.message for note in notes(scenario, model=model, solids=solids)),
            *mesh_notes,
            *piece_notes(bodies, model.collision.pieces),
        ),
    )


def _shapes(scenario: Scenario, machine: Linkage) -> tuple[tuple[SceneShape, ...], tuple[str, ...]]:
    """Return all shapes sorted by name, and the notes on meshes; a mesh file is read once for each scale."""
    meshes: dict[tuple[str, tuple[float, float, float]], Solid] = {}
    notes: dict[str, None] = {}
    problems: list[Problem] = []
    found = []

    def mesh(link: str, name: str, shape: shapes.MeshPart) -> Solid:
        file = scenario.provenance.meshes.get((link, name))
        if file is None:
            raise MeshError(shape.file, "is not at hand: scenarios with meshes come from `load` or `load_sources`")
        if (file, shape.scales) not in meshes:
            meshes[file, shape.scales] = load_mesh(file, scale=shape.scales, data=scenario.sources[file])
        solid = meshes[file, shape.scales]
        notes.update(dict.fromkeys(f"{file}: {note}" for note in solid.notes))
        return solid

    for link, entry in scenario.links.items():
        for name, shape in entry.shapes.items():
            try:
                solid = mesh(link, name, shape) if isinstance(shape, shapes.MeshPart) else _primitive(shape)
            except MeshError as error:
                path = ("links", link, "shapes", name, "file")
                problems.append(scenario.provenance.problem(path, f"cannot be used: {error.reason}"))
                continue
            placed = solid.transformed(shape.pose.transform())
            index = machine.link_index(link)
            color = _color(shape.color)
            found.append(SceneShape(f"{link}/{name}", index, placed, color, shape.collide, shape.sense))
    if problems:
        raise ScenarioError(problems)
    return tuple(sorted(found, key=lambda shape: shape.name)), tuple(notes)


def primitive_solids(scenario: Scenario) -> dict[tuple[str, str], Solid]:
    """Return the shapes that need no mesh file by link and name, in their links' frames."""
    return {
        (link, name): _primitive(shape).transformed(shape.pose.transform())
        for link, entry in scenario.links.items()
        for name, shape in entry.shapes.items()
        if not isinstance(shape, shapes.MeshPart)
    }


def _link_and_shape(name: str) -> tuple[str, str]:
    link, _, shape = name.partition("/")
    return link, shape


def _primitive(shape: shapes.ShapePart) -> Solid:
    """Return a shape that is no mesh, in its own frame."""
    match shape:
        case shapes.CubePart():
            return primitives.cube(shape.size)
        case shapes.CuboidPart():
            return primitives.cuboid(shape.size)
        case shapes.PlanePart():
            return primitives.plane(shape.size)
        case shapes.SpherePart():
            return primitives.sphere(shape.radius, shape.chord_error)
        case shapes.CylinderPart():
            return primitives.cylinder(shape.radius, shape.height, shape.chord_error)
        case shapes.ConePart():
            return primitives.cone(shape.radius, shape.height, shape.chord_error)
        case shapes.CapsulePart():
            return primitives.capsule(shape.radius, shape.height, shape.chord_error)
        case shapes.EllipsoidPart():
            return primitives.ellipsoid(shape.radii, shape.chord_error)
        case shapes.ArcPart():
            return primitives.arc(shape.radius, shape.span, shape.width, shape.thickness, shape.chord_error)
        case _:
            raise AssertionError(f"{type(shape).__name__} is no primitive shape")


def _color(text: str) -> Color:
    red, green, blue, *opacity = (int(text[k : k + 2], 16) for k in range(1, len(text), 2))
    return red, green, blue, opacity[0] if opacity else 255


def _collision(
    scenario: Scenario, machine: Linkage, scene_shapes: Sequence[SceneShape]
) -> tuple[tuple[CollisionBody, ...], tuple[Pair, ...]]:
    if scenario.collision.pairs == "none":
        return (), ()
    bodies = tuple(CollisionBody(shape.name, shape.link, shape.solid) for shape in scene_shapes if shape.collides)
    disabled = [DisabledPair(entry.pair[0], entry.pair[1], entry.reason) for entry in scenario.collision.disable]
    try:
        return bodies, plan_pairs(bodies, machine, disabled=disabled)
    except InvalidValue as error:
        rule = f"makes {error.value} pairs: {error.rule}"
        raise ScenarioError([scenario.provenance.problem(("collision", "pairs"), rule)]) from None


def _sensors(scenario: Scenario, machine: Linkage, kind: str, scene_shapes: Sequence[SceneShape]) -> tuple[Any, ...]:
    """Return the sensors of a kind, sorted by name."""
    links = list(enumerate(machine.link_names))
    found = []
    for name, written in sorted(scenario.sensors.of(kind).items()):
        link = machine.link_index(written.link)
        ignored = frozenset(k for k, other in links if any(matches(pattern, other) for pattern in written.ignore))
        shapes = {s.name.partition("/")[2]: s.solid.triangles for s in scene_shapes if s.link == link}
        sensor = KINDS[kind].sensor(name, written, link, ignored)
        found.append(KINDS[kind].with_shapes(sensor, written, shapes))
    return tuple(found)


def _signals(scenario: Scenario, kind: str) -> Signals:
    """Return the signal chains of a kind's sensors."""
    output, chains, rate = KINDS[kind].output, {}, Fraction(scenario.rate)
    written = sorted(scenario.sensors.of(kind).items())
    for column, (name, part) in enumerate(written):
        if output is not None and part.signal is not None:
            chains[column] = Chain(kind, name, part.signal, rate, output.substitute(part))
    return Signals(chains, len(written))


def _each_object(kind: str) -> bool:
    return any(field.each == "objects" for field in KINDS[kind].columns.fields())


def _check_expectations(scenario: Scenario, layout: Layout) -> None:
    problems = [
        scenario.provenance.problem(("expect", index, "pair"), f"{list(entry.pair)} matches no pair that is tested")
        for index, entry in enumerate(scenario.expect)
        if isinstance(entry, PairExpectation) and not len(matching_pairs(layout.pairs, entry.pair))
    ]
    if problems:
        raise ScenarioError(problems)
