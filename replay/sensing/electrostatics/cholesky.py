"""Cholesky's factor of a symmetric matrix, rounded alike on every machine, with however many threads.

The matrix is A = U^T U with U upper triangular, row by row in place. Rows are factored in strips of eight, strips in
blocks of _BLOCK rows; what is below is updated tile by tile. A tile of the rows above is copied to where vector
instructions find it at constant places, and each row below takes eight of them at a time. Without contraction every
operation rounds as IEEE 754 says, which a library's own blocking does not promise.
"""

from __future__ import annotations

import math

import numpy as np
from numba import float64, int64

from replay.numerics.arrays import Floats
from replay.numerics.jit import entry, kernel, leaf_kernel

_STRIP = 8
_BLOCK = 64
_TILE = 256


@leaf_kernel
def _update_row(row: Floats, factors: Floats, rows: Floats) -> None:
    """Subtract eight rows of a tile, each times its factor, from one row."""
    f0, f1, f2, f3, f4, f5, f6, f7 = (
        factors[0],
        factors[1],
        factors[2],
        factors[3],
        factors[4],
        factors[5],
        factors[6],
        factors[7],
    )
    for j in range(len(row)):
        row[j] -= (
            (f0 * rows[j] + f1 * rows[_TILE + j])
            + (f2 * rows[2 * _TILE + j] + f3 * rows[3 * _TILE + j])
            + (f4 * rows[4 * _TILE + j] + f5 * rows[5 * _TILE + j])
            + (f6 * rows[6 * _TILE + j] + f7 * rows[7 * _TILE + j])
        )


@leaf_kernel
def _subtract(
    flat: Floats, n: int, above: tuple[int, int], below: tuple[int, int], packed: Floats, factors: Floats
) -> None:
    """Subtract what the rows above[0] .. above[1] - 1 take from the rows below, from the diagonal on."""
    height = above[1] - above[0]
    strips = (height + _STRIP - 1) // _STRIP
    for k in range(height, _STRIP * strips):
        factors[k] = 0.0
        for j in range(_TILE):
            packed[k * _TILE + j] = 0.0
    for left in range(below[0], n, _TILE):
        width = min(_TILE, n - left)
        for k in range(height):
            at = (above[0] + k) * n + left
            for j in range(width):
                packed[k * _TILE + j] = flat[at + j]
        for i in range(below[0], min(below[1], left + width)):
            for k in range(height):
                factors[k] = flat[(above[0] + k) * n + i]
            # a few numbers left of the diagonal are written too; nobody reads them
            shift = max(0, i - left) // _STRIP * _STRIP
            row = flat[i * n + left + shift : i * n + left + width]
            for strip in range(strips):
                first = strip * _STRIP
                _update_row(row, factors[first : first + _STRIP], packed[first * _TILE + shift : (first + 8) * _TILE])


@leaf_kernel
def _scale_row(row: Floats, pivot: float) -> None:
    for j in range(len(row)):
        row[j] /= pivot


@leaf_kernel
def _subtract_row(row: Floats, factor: float, above: Floats) -> None:
    for j in range(len(row)):
        row[j] -= factor * above[j]


@leaf_kernel
def _factor_strip(flat: Floats, n: int, begin: int, end: int) -> int:
    """Factor a strip from which all rows above have been subtracted; return the first bad pivot or -1."""
    for k in range(begin, end):
        row = k * n
        pivot = flat[row + k]
        if not pivot > 0.0:
            return k
        flat[row + k] = math.sqrt(pivot)
        _scale_row(flat[row + k + 1 : row + n], flat[row + k])
        for i in range(k + 1, end):
            _subtract_row(flat[i * n + i : i * n + n], flat[row + i], flat[row + i : row + n])
    return -1


@entry(float64[:, ::1])
@kernel
def factor(matrix: Floats) -> int:
    """Replace the upper triangle of a matrix (n, n) by its factor; what is below the diagonal is spoilt.

    Returns:
        -1, or the first row whose pivot is not above 0: the matrix is not positive definite.
    """
    n = len(matrix)
    flat = matrix.reshape(n * n)
    packed, factors = np.zeros(_BLOCK * _TILE), np.zeros(_BLOCK)
    for begin in range(0, n, _BLOCK):
        end = min(begin + _BLOCK, n)
        for strip in range(begin, end, _STRIP):
            after = min(strip + _STRIP, end)
            bad = _factor_strip(flat, n, strip, after)
            if bad >= 0:
                return bad
            if after < end:
                _subtract(flat, n, (strip, after), (after, end), packed, factors)
        _subtract(flat, n, (begin, end), (end, n), packed, factors)
    return -1


@entry(float64[:, ::1], int64, float64[:, ::1])
@kernel
def solve(upper: Floats, first: int, right: Floats) -> None:
    """Solve with the factor's rows and columns from `first` on, in place of the right sides (k, n - first).

    They are the factor of what is left of the matrix when the unknowns before are eliminated.
    """
    n = len(upper)
    for c in range(len(right)):
        values = right[c]
        for k in range(first, n):
            values[k - first] /= upper[k, k]
            _subtract_row(values[k - first + 1 :], values[k - first], upper[k, k + 1 :])
        for k in range(n - 1, first - 1, -1):
            total = values[k - first]
            row = upper[k]
            for j in range(k + 1, n):
                total -= row[j] * values[j - first]
            values[k - first] = total / upper[k, k]
