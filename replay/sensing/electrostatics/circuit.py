"""The voltages of all sensors of a unit, which the fields between their plates couple.

With Maxwell's matrix C of the sensors, their coupling capacitors D_c and strays D_s on the diagonal, and voltages V_in
behind the coupling capacitors,

    (C + D_s + D_c) V = D_c V_in.

Driven together, all V_in are the supply. Driven alone, one of them is and the others are 0. A conductor behind the
plates that is driven too has the voltage e V of the plates, of the one that is driven or of all in the mean: it adds
C_h e to the matrix, C_h being the column of the sensors' capacitances to it.
"""

from __future__ import annotations

import numpy as np
from numba import boolean, float64

from replay.numerics.arrays import Flags, Floats
from replay.numerics.jit import entry, kernel


@kernel
def _solved(matrix: Floats, right: Floats) -> None:
    """Solve in place by elimination with row pivots."""
    n = len(right)
    for k in range(n):
        pivot = k
        for i in range(k + 1, n):
            if abs(matrix[i, k]) > abs(matrix[pivot, k]):
                pivot = i
        for j in range(n):
            matrix[k, j], matrix[pivot, j] = matrix[pivot, j], matrix[k, j]
        right[k], right[pivot] = right[pivot], right[k]
        for i in range(k + 1, n):
            factor = matrix[i, k] / matrix[k, k]
            for j in range(k, n):
                matrix[i, j] -= factor * matrix[k, j]
            right[i] -= factor * right[k]
    for k in range(n - 1, -1, -1):
        for j in range(k + 1, n):
            right[k] -= matrix[k, j] * right[j]
        right[k] /= matrix[k, k]


@entry(float64[:, :, ::1], float64[:, ::1], float64[::1], float64[::1], float64[::1], boolean[:, ::1], boolean, boolean)
@kernel
def output_voltages(
    capacitance: Floats,
    behind: Floats,
    coupling: Floats,
    stray: Floats,
    supply: Floats,
    saturated: Flags,
    together: bool,
    driven: bool,
) -> Floats:
    """Return the output voltages (n, k) [V] of n frames and k sensors.

    Args:
        capacitance: (n, k, k) [F], Maxwell's matrix of the sensors.
        behind: (n, k) [F], their capacitances (off-diagonal, below 0) to what is behind them.
        coupling, stray: (k,) [F].
        supply: (k,) [V].
        saturated: (n, k), sensors whose plates are earthed: 0 V.
        together: whether all sensors are driven at once.
        driven: whether what is behind has the plates' voltage, not 0 V.
    """
    n, k = saturated.shape
    result = np.zeros((n, k))
    for frame in range(n):
        for driving in range(1 if together else k):
            matrix, right = capacitance[frame].copy(), np.zeros(k)
            for i in range(k):
                matrix[i, i] += stray[i] + coupling[i]
                if together or i == driving:
                    right[i] = coupling[i] * supply[i]
                if driven and together:
                    for j in range(k):
                        matrix[i, j] += behind[frame, i] / k
                elif driven:
                    matrix[i, driving] += behind[frame, i]
            for i in range(k):
                if saturated[frame, i]:
                    right[i] = 0.0
                    for j in range(k):
                        matrix[i, j] = 1.0 if i == j else 0.0
            _solved(matrix, right)
            if together:
                result[frame] = right
            else:
                result[frame, driving] = right[driving]
    return result
