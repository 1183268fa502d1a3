"""What bodies change at a unit: exact, given the influences (METHODS 4.5).

With the unit's panels s, the bodies' t, P their influences, phi the potential of the unit alone at the bodies, one row
an electrode, and U the indicators of the bodies that are not grounded,

    A = P_tt - P_ts P_ss^-1 P_st,    A y = [phi, U],
    G = U y_U,   F = U y_phi,   V = (G + C_b)^-1 F,
    charges q = -y_phi + V y_U,   increase = phi y_phi - F V,

C_b the capacitance of each body to earth through what is not modelled: none for one that floats. A is what the Cholesky
factor of all panels together leaves for the last ones when s come first. The increase is never the difference of two
capacitances; its error is of second order in the charges.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from replay.numerics.arrays import Floats, Integers
from replay.sensing.electrostatics import cholesky
from replay.sensing.electrostatics.products import products


@dataclass(frozen=True, eq=False)
class Response:
    """What bodies change at a unit with k electrodes.

    Attributes:
        increase: (k, k) [m], of Maxwell's matrix, in units of 4 pi eps0.
        shares: (shapes, k, k) [m], what each shape has in the increase; they add up to it.
        charges: (k, n) [m], on the bodies' panels, each electrode alone at 1 V.
    """

    increase: Floats
    shares: Floats
    charges: Floats


def response(upper: Floats, phi: Floats, shape: Integers, body: Integers, earth: Floats) -> Response:
    """Return what bodies change.

    Args:
        upper: (m + n, m + n), the factor of the influences of the unit's m panels and the bodies' n; see `cholesky`.
        phi: (k, n) [1], the unit's potential at the bodies' panels, each electrode alone at 1 V.
        shape: (n,) index of each panel's shape.
        body: (shapes,) index of each shape's body.
        earth: (bodies,) [m], each body's capacitance to earth in units of 4 pi eps0; inf for one that is grounded.
    """
    first = len(upper) - len(shape)
    floating = np.flatnonzero(np.isfinite(earth))
    U = np.ascontiguousarray((body[shape][None, :] == floating[:, None]).astype(np.float64))
    y = np.concatenate([phi, U])
    cholesky.solve(upper, first, y)
    y_phi, y_U = np.ascontiguousarray(y[: len(phi)]), np.ascontiguousarray(y[len(phi) :])
    increase, charges = products(phi, y_phi), -y_phi
    if len(floating):
        F, G = products(U, y_phi), products(U, y_U)
        G[np.diag_indices_from(G)] += earth[floating]
        cholesky.factor(G)
        V = F.T.copy()
        cholesky.solve(G, 0, V)
        increase -= products(V, np.ascontiguousarray(F.T))
        charges += products(V, np.ascontiguousarray(y_U.T))
    increase = 0.5 * (increase + increase.T)
    own = [np.flatnonzero(shape == s) for s in range(len(body))]
    shares = np.stack([-products(np.ascontiguousarray(phi[:, at]), np.ascontiguousarray(charges[:, at])) for at in own])
    return Response(increase, 0.5 * (shares + shares.transpose(0, 2, 1)), charges)
