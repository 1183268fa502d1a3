"""Gauss-Legendre nodes and weights on [0, 1], and symmetric rules on the triangle, as frozen constants of the kernels.

Computed with 40 digits and rounded once; NumPy finds them by an eigenvalue solver, whose last digit depends on the
processor. n nodes integrate polynomials of degree 2 n - 1 exactly.
"""

from __future__ import annotations

from itertools import permutations

import numpy as np

from replay.numerics.arrays import Floats

NODES_4 = np.array([0.06943184420297371, 0.33000947820757187, 0.6699905217924281, 0.9305681557970263])
WEIGHTS_4 = np.array([0.17392742256872692, 0.32607257743127305, 0.32607257743127305, 0.17392742256872692])
NODES_8 = np.array(
    [
        0.019855071751231884,
        0.10166676129318664,
        0.2372337950418355,
        0.4082826787521751,
        0.591717321247825,
        0.7627662049581645,
        0.8983332387068134,
        0.9801449282487681,
    ]
)
WEIGHTS_8 = np.array(
    [
        0.05061426814518813,
        0.11119051722668724,
        0.15685332293894363,
        0.181341891689181,
        0.181341891689181,
        0.15685332293894363,
        0.11119051722668724,
        0.05061426814518813,
    ]
)
NODES_12 = np.array(
    [
        0.009219682876640375,
        0.04794137181476257,
        0.11504866290284765,
        0.2063410228566913,
        0.3160842505009099,
        0.43738329574426554,
        0.5626167042557345,
        0.6839157494990901,
        0.7936589771433087,
        0.8849513370971523,
        0.9520586281852375,
        0.9907803171233597,
    ]
)
WEIGHTS_12 = np.array(
    [
        0.023587668193255914,
        0.05346966299765921,
        0.08003916427167311,
        0.10158371336153296,
        0.1167462682691774,
        0.12457352290670139,
        0.12457352290670139,
        0.1167462682691774,
        0.10158371336153296,
        0.08003916427167311,
        0.05346966299765921,
        0.023587668193255914,
    ]
)
NODES_16 = np.array(
    [
        0.005299532504175033,
        0.02771248846338371,
        0.06718439880608412,
        0.12229779582249849,
        0.19106187779867811,
        0.2709916111713863,
        0.35919822461037054,
        0.4524937450811813,
        0.5475062549188188,
        0.6408017753896295,
        0.7290083888286137,
        0.8089381222013219,
        0.8777022041775016,
        0.9328156011939158,
        0.9722875115366163,
        0.994700467495825,
    ]
)
WEIGHTS_16 = np.array(
    [
        0.013576229705877048,
        0.031126761969323947,
        0.04757925584124639,
        0.06231448562776694,
        0.07479799440828837,
        0.08457825969750127,
        0.09130170752246179,
        0.09472530522753425,
        0.09472530522753425,
        0.09130170752246179,
        0.08457825969750127,
        0.07479799440828837,
        0.06231448562776694,
        0.04757925584124639,
        0.031126761969323947,
        0.013576229705877048,
    ]
)


def _symmetric_rule(centre: float, *orbits: tuple[float, ...]) -> Floats:
    """Return (4, k) barycentric coordinates and weights: orbits (weight, a) of (1-2a, a, a), (weight, a, b) of all."""
    rows: list[tuple[float, ...]] = [(1.0 / 3.0, 1.0 / 3.0, 1.0 / 3.0, centre)]
    for weight, *place in orbits:
        corners = (*place, *place) if len(place) == 1 else tuple(place)
        point = (*corners, 1.0 - corners[0] - corners[1])
        rows += [(*permuted, weight) for permuted in sorted(set(permutations(point)))]
    return np.ascontiguousarray(np.array(rows).T)


TRIANGLE_7 = _symmetric_rule(
    9.0 / 40.0, (0.13239415278850618, 0.47014206410511505), (0.12593918054482717, 0.10128650732345633)
)
"""Means over a triangle, polynomials of degree 5 exactly (Radon 1948)."""

TRIANGLE_16 = _symmetric_rule(
    0.14431560767778717,
    (0.09509163426728462, 0.4592925882927232),
    (0.10321737053471824, 0.1705693077517602),
    (0.03245849762319808, 0.05054722831703098),
    (0.027230314174434993, 0.008394777409957605, 0.2631128296346381),
)
"""Means over a triangle, polynomials of degree 8 exactly (Dunavant 1985, refined to 40 digits)."""
