"""The principal axes of a body: covariance of its vertices or of its surface, and its eigenvectors.

By vertices:   C = 1/n sum (p - m)(p - m)^T, m the mean. Where vertices are dense, it leans that way.
By triangles:  C = 1/A sum A_k/12 (9 m_k m_k^T + p p^T + q q^T + r r^T), the covariance of the surface as a thin sheet
               (Gottschalk 1996), with triangle k of area A_k, corners p, q, r, centroid m_k, all seen from the centroid
               of the surface. The formula that subtracts mu mu^T at the end loses the digits that the centroid has.
"""

from __future__ import annotations

import math

import numpy as np
from numba import float64

from replay.numerics.arrays import Floats
from replay.numerics.jit import entry, kernel

_SWEEPS = 30  # a 3x3 matrix needs about 5


@entry(float64[:, ::1])
@kernel
def covariance_of_points(points: Floats) -> Floats:
    """Return the covariance (3, 3) [m^2] of points (n, 3) about their mean."""
    n = len(points)
    mean = np.zeros(3)
    for k in range(n):
        for i in range(3):
            mean[i] += points[k, i] / n
    result = np.zeros((3, 3))
    for k in range(n):
        for i in range(3):
            for j in range(3):
                result[i, j] += (points[k, i] - mean[i]) * (points[k, j] - mean[j]) / n
    return result


@entry(float64[:, :, ::1])
@kernel
def covariance_of_triangles(triangles: Floats) -> tuple[float, Floats]:
    """Return (area [m^2], covariance (3, 3) [m^2]) of the surface triangles (n, 3, 3); zeros for no area."""
    n = len(triangles)
    areas, centroids = np.empty(n), np.empty((n, 3))
    total = 0.0
    mean, result = np.zeros(3), np.zeros((3, 3))
    for k in range(n):
        ux, uy, uz = triangles[k, 1] - triangles[k, 0]
        vx, vy, vz = triangles[k, 2] - triangles[k, 0]
        x, y, z = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        areas[k] = 0.5 * math.sqrt(x * x + y * y + z * z)
        total += areas[k]
        for i in range(3):
            centroids[k, i] = (triangles[k, 0, i] + triangles[k, 1, i] + triangles[k, 2, i]) / 3.0
            mean[i] += areas[k] * centroids[k, i]
    if not total > 0.0:
        return 0.0, result
    mean /= total
    for k in range(n):
        weight = areas[k] / (12.0 * total)
        for i in range(3):
            for j in range(i, 3):
                term = 9.0 * (centroids[k, i] - mean[i]) * (centroids[k, j] - mean[j])
                for corner in range(3):
                    term += (triangles[k, corner, i] - mean[i]) * (triangles[k, corner, j] - mean[j])
                result[i, j] += weight * term
    for i in range(3):
        for j in range(i):
            result[i, j] = result[j, i]
    return total, result


@entry(float64[:, ::1])
@kernel
def eigen(matrix: Floats) -> tuple[Floats, Floats]:
    """Return what `diagonalised` returns: for Python, where kernels call that.

    An entry that returns arrays finds no memory for them once another entry that it is part of was loaded before it.
    """
    return diagonalised(matrix)


@kernel
def diagonalised(matrix: Floats) -> tuple[Floats, Floats]:
    """Return (values (3,) ascending, vectors (3, 3) in rows) of a symmetric matrix, by Jacobi's rotations.

    The vectors are a product of rotations, so they are orthonormal whether or not values repeat.
    """
    a, v = np.empty((3, 3)), np.zeros((3, 3))
    for i in range(3):
        v[i, i] = 1.0
        for j in range(3):
            a[i, j] = matrix[i, j]
    for _ in range(_SWEEPS):
        if a[0, 1] == 0.0 and a[0, 2] == 0.0 and a[1, 2] == 0.0:
            break
        for p in range(2):
            for q in range(p + 1, 3):
                if abs(a[p, q]) <= 1e-18 * (abs(a[p, p]) + abs(a[q, q])):
                    a[p, q], a[q, p] = 0.0, 0.0
                    continue
                theta = 0.5 * (a[q, q] - a[p, p]) / a[p, q]
                t = 1.0 / (abs(theta) + math.sqrt(theta * theta + 1.0))
                t = t if theta >= 0.0 else -t
                c = 1.0 / math.sqrt(t * t + 1.0)
                s = t * c
                for k in range(3):  # columns, then rows: a <- J^T a J
                    x, y = a[k, p], a[k, q]
                    a[k, p], a[k, q] = c * x - s * y, s * x + c * y
                for k in range(3):
                    x, y = a[p, k], a[q, k]
                    a[p, k], a[q, k] = c * x - s * y, s * x + c * y
                for k in range(3):
                    x, y = v[p, k], v[q, k]
                    v[p, k], v[q, k] = c * x - s * y, s * x + c * y
    values, vectors = np.empty(3), np.empty((3, 3))
    for i in range(3):
        rank = 0
        for j in range(3):
            if a[j, j] < a[i, i] or (a[j, j] == a[i, i] and j < i):
                rank += 1
        values[rank] = a[i, i]
        for k in range(3):
            vectors[rank, k] = v[i, k]
    return values, vectors
