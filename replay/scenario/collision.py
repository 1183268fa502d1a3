"""What is tested for collision."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AfterValidator, StringConstraints

from replay.collision.columns import MARGIN
from replay.language.fields import Glob, Part, rejected
from replay.language.units import Distance

GlobPair = tuple[Glob, Glob]


def _reaches(margin: float) -> float:
    if margin == 0.0:
        raise rejected("must be > 0 m; with model.collision.clearance: never no clearance is computed")
    return margin


class DisablePart(Part):
    """Pairs that are not tested."""

    pair: GlobPair
    """Two patterns, each of a link's name or of "link/shape"; a pair is left out when they match its two sides."""
    reason: Annotated[str, StringConstraints(min_length=1, max_length=1000, strip_whitespace=True)]
    """Why these may touch, or never can."""


class CollisionPart(Part):
    """Which pairs of shapes are tested, and how closely clearances are followed."""

    pairs: Literal["all", "none"] = "all"
    """"all": every pair of shapes on different links that are not joined by a joint; "none": no pair."""
    margin: Annotated[Distance, AfterValidator(_reaches)] = MARGIN
    """Clearances up to this one are computed [m] (model.collision.clearance: near)."""
    disable: tuple[DisablePart, ...] = ()
    """Pairs that are left out, each with its reason."""
