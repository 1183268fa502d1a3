"""Models: which version of each method computes a scenario, and the revision of each method."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final, Literal

from pydantic import Field

from replay.language.fields import Part, rejected, with_keys
from replay.sensing.kinds import KINDS

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
    "collision.between.proven": 2,
    "collision.between.sampled": 1,
} | {f"{kind.name}.{method}": revision for kind in KINDS.values() for method, revision in kind.revisions.items()}
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
    between: Literal["proven", "sampled"] = "proven"
    """Between two frames, contacts are proven absent or found with their time; or frames alone are looked at."""


class _Model(Part):
    """The version of each method."""

    collision: CollisionMethod = CollisionMethod()
    """Version of the collision methods."""

    if TYPE_CHECKING:

        def __init__(self, **methods: Any) -> None: ...
        def __getattr__(self, kind: str) -> Any: ...

    def identity(self, *, savings: bool = True) -> dict[str, str]:
        """Return what is recorded of the model: every option that has an effect, methods with their revisions.

        Where savings were off, "savings" says so: last digits of some columns may differ, see `simulation.simulate`.
        """
        result = {}
        for option in ("bounds", "narrowphase", "pieces", "between"):
            choice = getattr(self.collision, option)
            result[f"collision.{option}"] = f"{choice}@{METHOD_REVISIONS[f'collision.{option}.{choice}']}"
        result["collision.clearance"] = self.collision.clearance
        for name, kind in KINDS.items():
            written = getattr(self, name)
            result[name] = f"{written.method}@{kind.revisions[written.method]}"
            result |= {f"{name}.{option}": str(value) for option, value in written.options().items()}
        if not savings:
            result["savings"] = "off"
        return result


if TYPE_CHECKING:
    Model = _Model
else:
    _keys = {
        name: (kind.method, Field(kind.method(), description=f"Version of the {name} method."))
        for name, kind in KINDS.items()
    }
    Model = with_keys(_Model, **_keys)

_COLLISION = {
    "thesis2015": CollisionMethod(
        bounds="obb_vertices", narrowphase="gjk", pieces="convex", clearance="never", between="sampled"
    )
}
BUILTIN_MODELS: Final = {
    name: Model(collision=collision, **{kind.name: kind.models[name] for kind in KINDS.values() if name in kind.models})
    for name, collision in _COLLISION.items()
}
"""Models by name: `thesis2015` are the methods of the thesis itself."""


def builtin_model(value: Any) -> Any:
    """Let a name stand for the built-in model of that name."""
    if not isinstance(value, str):
        return value
    if value not in BUILTIN_MODELS:
        names = ", ".join(sorted(BUILTIN_MODELS))
        raise rejected(f"is no built-in model; write one of {names}, or a mapping of {', '.join(Model.model_fields)}")
    return BUILTIN_MODELS[value]
