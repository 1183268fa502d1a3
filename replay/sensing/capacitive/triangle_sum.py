"""The sum over all triangles of a body, one by one: `exact` and `midpoint` for every pose and plate."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from replay.numerics.double_double import two_sum
from replay.numerics.exact_sign import area_or_zero
from replay.numerics.jit import kernel, leaf_kernel
from replay.sensing.capacitive.contact import CLEAR, contact
from replay.sensing.capacitive.exact import SCRATCH, integral_over_triangle
from replay.sensing.capacitive.midpoint import midpoint_over_triangle

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

EXACT = -1
"""As `splits`: the closed forms instead of the midpoint rule."""


@kernel
def triangle_areas(triangles: Floats) -> Floats:
    """Return the areas (n,) [m^2] of triangles (n, 3, 3) [m]."""
    result = np.empty(len(triangles))
    for k in range(len(triangles)):
        result[k] = area_or_zero(triangles[k])
    return result


@leaf_kernel
def into_plate(T_plate_body: Floats, triangles: Floats, index: int, result: Floats) -> None:
    """Write the corners of a triangle of (n, 3, 3) in the plate's frame to the first three rows of `result[0]`.

    Here and elsewhere an array goes with an index instead of a row of it: a view costs as much as the arithmetic.
    """
    for k in range(3):
        x, y, z = triangles[index, k, 0], triangles[index, k, 1], triangles[index, k, 2]
        for r in range(3):
            result[0, k, r] = (
                T_plate_body[r, 0] * x + T_plate_body[r, 1] * y + T_plate_body[r, 2] * z + T_plate_body[r, 3]
            )


@leaf_kernel
def part_into_plate(T_plate_body: Floats, parts: Floats, index: int, result: Floats) -> None:
    """Do what `into_plate` does, to the last bit, for a row of `Clusters.parts`, which begins with the corners."""
    for k in range(3):
        x, y, z = parts[index, 3 * k], parts[index, 3 * k + 1], parts[index, 3 * k + 2]
        for r in range(3):
            result[0, k, r] = (
                T_plate_body[r, 0] * x + T_plate_body[r, 1] * y + T_plate_body[r, 2] * z + T_plate_body[r, 3]
            )


@leaf_kernel
def faces_centre(corners: Floats) -> bool:
    """Return whether the outer side of corners[0], in the plate's frame, holds the plate's centre, n.(0 - a) > 0."""
    ax, ay, az = corners[0, 0, 0], corners[0, 0, 1], corners[0, 0, 2]
    bx, by, bz = corners[0, 1, 0] - ax, corners[0, 1, 1] - ay, corners[0, 1, 2] - az
    cx, cy, cz = corners[0, 2, 0] - ax, corners[0, 2, 1] - ay, corners[0, 2, 2] - az
    outward = (by * cz - bz * cy) * ax + (bz * cx - bx * cz) * ay + (bx * cy - by * cx) * az
    return outward < 0.0  # type: ignore[no-any-return]


@kernel
def sum_triangles(
    triangles: Floats,
    areas: Floats,
    T_plate_body: Floats,
    half_sizes: Floats,
    both: bool,
    facing: bool,
    splits: int,
) -> tuple[Floats, Flags]:
    """Return the integral over a body and whether the body touches the plate, for every pose and plate.

    Args:
        triangles: (k, 3, 3) [m], in the body's frame; areas: (k,) [m^2].
        T_plate_body: (n, p, 4, 4).
        half_sizes: (p, 2) [m].
        both, facing: what counts, see `CapacitiveSensor`.
        splits: of the midpoint rule, or EXACT.

    Returns:
        (n, p) [m], inf when saturated, and (n, p) flags. The sum is compensated and in the order of the triangles.
    """
    n, plates = len(T_plate_body), len(half_sizes)
    integral, touching = np.zeros((n, plates)), np.zeros((n, plates), np.bool_)
    scratch, corners = np.empty(SCRATCH), np.empty((1, 3, 3))
    for frame in range(n):
        for plate in range(plates):
            half_x, half_y = half_sizes[plate, 0], half_sizes[plate, 1]
            T = T_plate_body[frame, plate]
            total, lost = 0.0, 0.0
            for k in range(len(triangles)):
                into_plate(T, triangles, k, corners)
                if contact(corners[0], half_x, half_y, both) != CLEAR:
                    touching[frame, plate] = True
                if facing and not faces_centre(corners):
                    continue
                if splits == EXACT:
                    value = integral_over_triangle(corners[0], areas[k], half_x, half_y, both, scratch)
                else:
                    value = midpoint_over_triangle(corners[0], areas[k], half_x, half_y, both, splits)
                if value == np.inf:
                    total, lost = np.inf, 0.0
                elif total < np.inf:
                    total, error = two_sum(total, value)
                    lost += error
            integral[frame, plate] = total + lost
    return integral, touching
