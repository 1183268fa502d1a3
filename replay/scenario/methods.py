"""Models: which version of each method computes a scenario, and the revision of each method."""

from __future__ import annotations

from typing import Annotated, Any, Final, Literal, Self

from pydantic import Field, StrictInt, model_validator

from replay.scenario.fields import Part, rejected
from replay.scenario.units import NUMBER, Quantity

Tolerance = Annotated[float, Quantity("Tolerance", NUMBER, at_least=1e-12, below=1.0)]

METHOD_REVISIONS: Final = {
    "collision.bounds.obb": 1,
    "collision.bounds.obb_vertices": 1,
    "collision.bounds.aabb": 1,
    "collision.bounds.sphere": 1,
    "collision.narrowphase.gjk": 1,
    "collision.narrowphase.fcl": 1,
    "collision.pieces.exact": 3,
    "collision.pieces.convex": 1,
    "collision.pieces.hull": 1,
    "distance.exact": 3,
    "distance.rays": 2,
    "distance.thesis": 2,
    "capacitive.tree": 5,
    "capacitive.exact": 4,
    "capacitive.midpoint": 3,
}
"""Bumped when a method's results change beyond the shipped rules; recorded with every result."""


class CollisionMethod(Part):
    """How collisions are computed."""

    bounds: Literal["obb", "obb_vertices", "aabb", "sphere"] = "obb"
    """Bounding volumes that define the level "bounds": boxes oriented by triangles or by vertices, boxes along the
    link's axes, or spheres."""
    narrowphase: Literal["gjk", "fcl"] = "gjk"
    """The engine that decides contact."""
    pieces: Literal["exact", "convex", "hull"] = "exact"
    """How a concave shape is collided: by its triangles, by convex pieces, or by its convex hull."""
    clearance: Literal["near", "never", "always"] = "near"
    """Which clearances are computed: those within collision.margin, none, or all."""


class DistanceMethod(Part):
    """How distance sensors are computed."""

    method: Literal["exact", "rays", "thesis"] = "exact"
    """The exact cone, a bundle of rays, or the thesis's five cases."""
    count: Annotated[StrictInt, Field(ge=1, le=1_000_000)] | None = None
    """Number of rays; only for method rays, 1000 when left out."""
    engine: Literal["own", "embree"] | None = None
    """What casts the rays; only for method rays, own when left out."""

    @model_validator(mode="after")
    def _options_belong(self) -> Self:
        _belongs(self.method, "rays", {"count": self.count, "engine": self.engine})
        return self


class CapacitiveMethod(Part):
    """How capacitive sensors are computed."""

    method: Literal["tree", "exact", "midpoint"] = "tree"
    """A tree that meets a tolerance, every triangle in closed form, or the thesis's midpoint splitting."""
    rtol: Tolerance | None = None
    """Relative tolerance of the sum; only for method tree, 1e-6 when left out."""
    splits: Annotated[StrictInt, Field(ge=0, le=8)] | None = None
    """Each triangle is split into 4^splits; only for method midpoint, 4 when left out."""

    @model_validator(mode="after")
    def _options_belong(self) -> Self:
        _belongs(self.method, "tree", {"rtol": self.rtol})
        _belongs(self.method, "midpoint", {"splits": self.splits})
        return self


def _belongs(method: str, needed: str, options: dict[str, object]) -> None:
    for key, value in options.items():
        if value is not None and method != needed:
            raise rejected(f"has no effect with method {method}; it belongs to method {needed}", at=(key,))


class Model(Part):
    """The version of each method."""

    collision: CollisionMethod = CollisionMethod()
    """Version of the collision methods."""
    distance: DistanceMethod = DistanceMethod()
    """Version of the distance method."""
    capacitive: CapacitiveMethod = CapacitiveMethod()
    """Version of the capacitive method."""

    @property
    def ray_count(self) -> int:
        """Number of rays of method rays."""
        return 1000 if self.distance.count is None else self.distance.count

    @property
    def ray_engine(self) -> Literal["own", "embree"]:
        """What casts the rays of method rays."""
        return self.distance.engine or "own"

    @property
    def rtol(self) -> float:
        """Relative tolerance of method tree."""
        return 1e-6 if self.capacitive.rtol is None else self.capacitive.rtol

    @property
    def splits(self) -> int:
        """Splits of method midpoint."""
        return 4 if self.capacitive.splits is None else self.capacitive.splits

    def identity(self, *, savings: bool = True) -> dict[str, str]:
        """Return what is recorded of the model: every option that has an effect, methods with their revisions.

        Where savings were off, "savings" says so: last digits of some columns may differ, see `simulation.simulate`.
        """
        result = {}
        for option in ("bounds", "narrowphase", "pieces"):
            choice = getattr(self.collision, option)
            result[f"collision.{option}"] = f"{choice}@{METHOD_REVISIONS[f'collision.{option}.{choice}']}"
        result["collision.clearance"] = self.collision.clearance
        distance, capacitive = self.distance.method, self.capacitive.method
        result["distance"] = f"{distance}@{METHOD_REVISIONS[f'distance.{distance}']}"
        if distance == "rays":
            result |= {"distance.count": str(self.ray_count), "distance.engine": self.ray_engine}
        result["capacitive"] = f"{capacitive}@{METHOD_REVISIONS[f'capacitive.{capacitive}']}"
        if capacitive == "tree":
            result["capacitive.rtol"] = repr(self.rtol)
        if capacitive == "midpoint":
            result["capacitive.splits"] = str(self.splits)
        if not savings:
            result["savings"] = "off"
        return result


BUILTIN_MODELS: Final = {
    "thesis2015": Model(
        collision=CollisionMethod(bounds="obb_vertices", narrowphase="gjk", pieces="convex", clearance="never"),
        distance=DistanceMethod(method="thesis"),
        capacitive=CapacitiveMethod(method="midpoint", splits=4),
    ),
}
"""Models by name: `thesis2015` are the methods of the thesis itself."""


def builtin_model(value: Any) -> Any:
    """Let a name stand for the built-in model of that name."""
    if not isinstance(value, str):
        return value
    if value not in BUILTIN_MODELS:
        names = ", ".join(sorted(BUILTIN_MODELS))
        raise rejected(f"is no built-in model; write one of {names}, or a mapping of collision, distance, capacitive")
    return BUILTIN_MODELS[value]
