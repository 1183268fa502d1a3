"""The reference: the electrostatics of conductors by boundary elements, at three finenesses, extrapolated.

Each level has a mesh of the bodies that is fine where they are near the unit or each other, and a mesh of the unit for
its images, fine where it is near the bodies; phi comes from the unit's own meshes (`unit`). Panels double from level to
level. With the levels' values v0, v1, v2,

    value = v2 + (v2 - v1) / (rho - 1),    rho = (v1 - v0) / (v2 - v1) within 1.8 .. 4,
    error = |value - v2| + 2e-4 value + |effect of the extrapolation of phi| / 2.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from replay.errors import InvalidValue
from replay.numerics.arrays import Floats
from replay.sensing.electrostatics import cholesky
from replay.sensing.electrostatics.algebra import Response, response
from replay.sensing.electrostatics.influence import fill_influences
from replay.sensing.electrostatics.panels import Panels, joined
from replay.sensing.electrostatics.placement import PosedBodies
from replay.sensing.electrostatics.refinement import near_tree, refined
from replay.sensing.electrostatics.unit import Unit

LEVELS = (1.5, 1.06, 0.75)
"""Finenesses of the meshes for a pose."""

MOST_UNKNOWNS = 8000
"""Panels of unit and bodies together: their influences fill 0.5 GB."""

_SLOPE, _SMALLEST = 1.1, 0.005
_BODY_SLOPE, _BODY_SMALLEST = 1.4, 0.025
"""Diameter over distance, and the least diameter asked for [m], between unit and bodies, and from body to body; at
fineness 1."""

_COARSER, _COARSEST = 1.25, 2.5
"""Steps in which meshes are made coarser where there would be too many panels, and how far that goes."""

_ROUNDING = 2e-4


@dataclass(frozen=True, eq=False)
class BemReading:
    """What bodies change at a unit with k electrodes, in units of 4 pi eps0.

    Attributes:
        increase: (k, k) [m].
        error: (k, k) [m], estimated.
        shares: (shapes, k, k) [m], what each shape has in the increase; they add up to it.
    """

    increase: Floats
    error: Floats
    shares: Floats


def read(unit: Unit, placement: PosedBodies) -> BemReading | None:
    """Return what bodies change in one pose; None where conductors overlap so that no charges are an answer.

    Raises:
        InvalidValue: there are too many panels even on the coarsest meshes.
    """
    scale = _scale(unit, placement)
    found = []
    for fineness in LEVELS:
        solved = level(unit, placement, scale * fineness)
        if solved is None:
            return None
        found.append(solved)
    values, shares = [each[0].increase for each in found], [each[0].shares for each in found]
    value, share = extrapolated(values), extrapolated(shares)
    share += (value - share.sum(axis=0)) * np.abs(share) / np.maximum(np.abs(share).sum(axis=0), 1e-300)
    error = np.abs(value - values[2]) + _ROUNDING * np.abs(value) + 0.5 * np.abs(found[2][1])
    return BemReading(value, error, share)


def extrapolated(v: Sequence[Floats]) -> Floats:
    """Return what the values of the three levels say of meshes without end."""
    last, before = v[2] - v[1], v[1] - v[0]
    ratio = np.divide(before, last, out=np.full_like(last, 4.0), where=last != 0.0)
    return np.asarray(v[2] + last / (np.clip(ratio, 1.8, 4.0) - 1.0))


def _scale(unit: Unit, placement: PosedBodies) -> float:
    """Return how much coarser all meshes are made for the finest to have no more than MOST_UNKNOWNS panels."""
    scale = 1.0
    while (count := _count(*meshes(unit, placement, scale * LEVELS[-1]))) > MOST_UNKNOWNS:
        scale *= _COARSER
        if scale > _COARSEST:
            rule = f"must be at most {MOST_UNKNOWNS}: use simpler shapes, ignore links, or another method"
            raise InvalidValue("unknowns of method bem", count, rule)
    return scale


def _count(image: Panels, parts: list[Panels]) -> int:
    return len(image.area) + sum(len(part.area) for part in parts)


def level(unit: Unit, placement: PosedBodies, fineness: float) -> tuple[Response, Floats] | None:
    """Return what bodies change at one fineness, and what of it the extrapolation of phi makes."""
    image, parts = meshes(unit, placement, fineness)
    bodies = joined(parts)
    m, n = len(image.area), len(bodies.area)
    upper = np.empty((m + n, m + n))
    fill_influences(joined([image, bodies]), upper)
    if cholesky.factor(upper) >= 0:
        return None
    phi, fine = unit.potential(bodies)
    shape = np.repeat(np.arange(len(parts)), [len(part.area) for part in parts])
    found = response(upper, phi, shape, placement.conductor_of_shape, placement.earth)
    change = -np.einsum("ki,li->kl", found.charges, phi - fine)
    return found, change + change.T


def meshes(unit: Unit, placement: PosedBodies, fineness: float) -> tuple[Panels, list[Panels]]:
    """Return the panels of the unit for images, and those of each shape, for one pose at one fineness."""
    smallest = min(_SMALLEST, placement.gap) * fineness
    near_unit = near_tree(unit.outline)
    samples = [placement.outline(body) for body in range(len(placement.bodies))]
    parts = []
    for body in range(len(placement.bodies)):
        others = samples[:body] + samples[body + 1 :]
        near_bodies = near_tree(np.concatenate(others)) if others else None
        for part in placement.meshes(body, fineness):
            if near_bodies is not None:
                part = refined(part, near_bodies, slope=_BODY_SLOPE * fineness, smallest=_BODY_SMALLEST * fineness)
            parts.append(refined(part, near_unit, slope=_SLOPE * fineness, smallest=smallest))
    coarse, _ = unit.mesh(fineness, outlines=False)
    image = refined(coarse, near_tree(np.concatenate(samples)), slope=_SLOPE * fineness, smallest=smallest)
    return image, placement.uncovered(parts, near_unit)
