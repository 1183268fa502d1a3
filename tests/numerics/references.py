"""The same means with 60 and more digits, by the textbook forms that double precision cannot bear."""

from __future__ import annotations

from collections.abc import Sequence

import mpmath as mp

Vector = Sequence[object]


def _mp(v: Vector) -> list[mp.mpf]:
    return [mp.mpf(x) for x in v]


def _minus(a: Vector, b: Vector) -> list[mp.mpf]:
    return [x - y for x, y in zip(a, b, strict=True)]


def _dot(a: Vector, b: Vector) -> mp.mpf:
    return sum((x * y for x, y in zip(a, b, strict=True)), mp.mpf(0))


def _cross(a: Vector, b: Vector) -> list[mp.mpf]:
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def mean_inverse_linear(z0: object, z1: object, z2: object) -> mp.mpf:
    """Second divided difference of z ln z, doubled; equal values are moved apart by 1e-45."""
    with mp.workdps(200):
        z = _mp([z0, z1, z2])
        z = [z[0], z[1] * (1 + mp.mpf(10) ** -45), z[2] * (1 - mp.mpf(10) ** -45)]
        total = mp.mpf(0)
        for i in range(3):
            if z[i] > 0:
                total += z[i] * mp.log(z[i]) / ((z[i] - z[i - 1]) * (z[i] - z[i - 2]))
        return 2 * total


def mean_over_triangle(a: Vector, b: Vector, c: Vector) -> mp.mpf:
    """Wilton's form with 200 digits; degenerate triangles are opened by 1e-60 of their size."""
    with mp.workdps(200):
        corners = [_mp(a), _mp(b), _mp(c)]
        n = _cross(_minus(corners[1], corners[0]), _minus(corners[2], corners[0]))
        longest = max(_dot(_minus(p, q), _minus(p, q)) for p in corners for q in corners)
        if longest == 0:
            return 1 / mp.sqrt(_dot(corners[0], corners[0]))
        if _dot(n, n) < longest**2 * mp.mpf(10) ** -80:
            size = mp.sqrt(longest)
            directions = ((0.3, 0.5, -0.7), (-0.6, 0.2, 0.4), (0.1, -0.9, 0.25))
            for corner, direction in zip(corners, directions, strict=True):
                for k in range(3):
                    corner[k] += mp.mpf(direction[k]) * size * mp.mpf(10) ** -38
            n = _cross(_minus(corners[1], corners[0]), _minus(corners[2], corners[0]))
        double_area = mp.sqrt(_dot(n, n))
        n = [x / double_area for x in n]
        d = abs(_dot(n, corners[0]))
        total = mp.mpf(0)
        for i in range(3):
            p, q = corners[i - 1], corners[i]
            edge = _minus(q, p)
            length = mp.sqrt(_dot(edge, edge))
            t = [x / length for x in edge]
            outward = _dot(_cross(t, n), p)
            minus, plus = _dot(t, p), _dot(t, q)
            near, far = mp.sqrt(_dot(p, p)), mp.sqrt(_dot(q, q))
            squared = outward**2 + d**2
            if outward == 0 or squared < mp.mpf(10) ** -150:
                continue
            if plus + far > 0 and minus + near > mp.mpf(10) ** -120 * near:
                integral = mp.log((plus + far) / (minus + near))
            else:
                integral = mp.log((near - minus) / (far - plus))
            total += outward * integral
            if d > 0:
                total -= d * (
                    mp.atan(outward * plus / (squared + d * far)) - mp.atan(outward * minus / (squared + d * near))
                )
        return total / (double_area / 2)
