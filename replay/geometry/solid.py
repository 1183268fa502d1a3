"""A shape as its surface triangles and, where it has them, the convex pieces it is the union of."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from replay.numerics import transforms
from replay.numerics.arrays import Floats
from replay.numerics.rows import distinct_rows


@dataclass(frozen=True, eq=False)
class Solid:
    """A polyhedron in its own frame, or, once `transformed`, in its link's frame.

    Attributes:
        triangles: (n, 3, 3) corners [m], counter-clockwise seen from outside.
        pieces: vertex sets (k, 3) [m] whose convex hulls' union is the solid: one for a convex shape; () for a concave
            one that is to be collided by its triangles.
        strictly_convex: whether it is one piece each of whose corners is a vertex of its hull, by far more than
            rounding (see `geometry.convexity`): known of some, and False where nobody looked.
        watertight: whether the triangles close a volume.
        closing: (m, 3, 3) caps [m] of triangles that do not but have an inside all the same, see `geometry.closing`.
        chord_error: largest distance [m] of the triangles from the curved surface they stand for; 0 for flat faces.
        dropped: degenerate and repeated triangles dropped on import.
        notes: what a reader of the scenario should know about an imported mesh, one sentence each.
    """

    triangles: Floats
    pieces: tuple[Floats, ...] = ()
    strictly_convex: bool = False
    watertight: bool = True
    closing: Floats = field(default_factory=lambda: np.zeros((0, 3, 3)))
    chord_error: float = 0.0
    dropped: int = 0
    notes: tuple[str, ...] = field(default=())

    @property
    def is_convex(self) -> bool:
        """Whether one convex set is the whole solid."""
        return len(self.pieces) == 1

    @property
    def has_inside(self) -> bool:
        """Whether points can be inside: it is watertight, or nearly so."""
        return self.watertight or len(self.closing) > 0

    @property
    def closing_of_inside(self) -> Floats | None:
        """The caps of a body that has an inside, none if it is watertight; None where it has no inside."""
        return self.closing if self.has_inside else None

    @property
    def vertices(self) -> Floats:
        """The distinct corners (v, 3) [m], sorted by coordinates."""
        return distinct_rows(self.triangles.reshape(-1, 3) + 0.0).rows  # + 0.0 makes -0.0 and 0.0 one

    @property
    def volume(self) -> float:
        """The enclosed volume [m^3], meaningful when watertight; see `signed_volume`."""
        return signed_volume(self.triangles)

    def transformed(self, T: Floats) -> Solid:
        """Return the solid moved by the rigid transform T (4, 4)."""
        T = np.asarray(T, dtype=np.float64)
        pieces = tuple(transforms.apply(T, piece) for piece in self.pieces)
        triangles, closing = transforms.apply(T, self.triangles), transforms.apply(T, self.closing)
        return replace(self, triangles=triangles, closing=closing, pieces=pieces)


def signed_volume(triangles: Floats) -> float:
    """Return the volume [m^3] that closed triangles (n, 3, 3) [m] enclose, negative when they are inside out.

    The sum of the tetrahedra under the triangles, from a corner of their own: a far origin would cancel digits.
    """
    a, b, c = np.moveaxis(triangles - triangles[0, 0], 1, 0)
    return float(np.sum(a * np.cross(b, c)) / 6.0)
