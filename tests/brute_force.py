"""What a mesh says to sensors and of its inside, by brute force: no tree and no closed form of ours."""

import math

import numba
import numpy as np


@numba.njit(cache=True)
def winding_numbers(triangles, points):
    """How often triangles (n, 3, 3) wind about points (m, 3): the sum of the solid angles over 4 pi."""
    result = np.zeros(len(points))
    for k in range(len(points)):
        x, y, z = points[k]
        for t in range(len(triangles)):
            ax, ay, az = triangles[t, 0, 0] - x, triangles[t, 0, 1] - y, triangles[t, 0, 2] - z
            bx, by, bz = triangles[t, 1, 0] - x, triangles[t, 1, 1] - y, triangles[t, 1, 2] - z
            cx, cy, cz = triangles[t, 2, 0] - x, triangles[t, 2, 1] - y, triangles[t, 2, 2] - z
            a, b, c = (
                math.sqrt(ax**2 + ay**2 + az**2),
                math.sqrt(bx**2 + by**2 + bz**2),
                math.sqrt(cx**2 + cy**2 + cz**2),
            )
            ab, bc, ca = ax * bx + ay * by + az * bz, bx * cx + by * cy + bz * cz, cx * ax + cy * ay + cz * az
            volume = ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz) + az * (bx * cy - by * cx)
            result[k] += math.atan2(volume, a * b * c + ab * c + bc * a + ca * b)
    return result / (2.0 * np.pi)


def nearest_in_cone(triangles, apex, axis, half_angle, accuracy):
    """Bounds of the smallest distance (m) from the apex to triangles (n, 3, 3) within a cone; (inf, inf) for none.

    Triangles that may hold it are split in four until the bounds are `accuracy` apart, or nothing larger than that is
    left: then the upper bound stays inf where the cone only grazes them.
    """
    best, parts = np.inf, triangles - apex
    for _ in range(80):
        middle = parts.mean(axis=1)
        near = nearest_points(parts)
        samples = np.concatenate([near, middle, parts.reshape(-1, 3)])
        length = np.linalg.norm(samples, axis=1)
        angle = np.arctan2(np.linalg.norm(np.cross(axis, samples), axis=1), samples @ axis)
        best = min(best, np.min(length[angle <= half_angle], initial=np.inf))
        radius = np.linalg.norm(parts - middle[:, None], axis=2).max(axis=1)
        reach = np.linalg.norm(middle, axis=1)
        least = np.linalg.norm(near, axis=1)
        angle = np.arctan2(np.linalg.norm(np.cross(axis, middle), axis=1), middle @ axis)
        seen = (reach <= radius) | (
            angle - np.arcsin(np.minimum(1.0, radius / np.maximum(reach, radius))) <= half_angle
        )
        kept = seen & (least < best - accuracy)
        if not kept.any():
            return min(best, np.min(least[seen], initial=np.inf)), best
        if radius[kept].max() < 1e-3 * accuracy:
            return float(least[kept].min()), best
        parts = quartered(parts[kept])
    return float(least[kept].min()), best


def nearest_points(triangles):
    """The points (n, 3) of triangles (n, 3, 3) that are nearest to the origin: on an edge, or the foot in the plane."""
    a, ends = triangles, np.roll(triangles, -1, axis=1)
    way = ends - a
    length = np.einsum("ijk,ijk->ij", way, way)
    t = -np.einsum("ijk,ijk->ij", a, way) / np.where(length > 0.0, length, 1.0)
    on_edges = a + np.clip(t, 0.0, 1.0)[..., None] * way
    normal = np.cross(way[:, 0], way[:, 1])
    square = np.einsum("ij,ij->i", normal, normal)
    foot = (np.einsum("ij,ij->i", a[:, 0], normal) / np.where(square > 0.0, square, 1.0))[:, None] * normal
    sides = np.einsum("ijk,ik->ij", np.cross(way, foot[:, None] - a), normal)
    best = on_edges[np.arange(len(a)), np.argmin(np.einsum("ijk,ijk->ij", on_edges, on_edges), axis=1)]
    return np.where(((sides > 0.0).all(axis=1) & (square > 0.0))[:, None], foot, best)


def plate_integral(triangles, half, both):
    """The integral of dA / dist to the rectangle |x| <= hx, |y| <= hy, z = 0, of what lies at z > 0 or all [m].

    Triangles are split in four until they are small beside their distance, and then summed by a rule of degree 5.
    """
    total, parts = 0.0, triangles if both else _above(triangles)
    for level in range(40):
        middle = parts.mean(axis=1)
        radius = np.linalg.norm(parts - middle[:, None], axis=2).max(axis=1)
        done = radius <= (0.05 if level < 30 else np.inf) * distance_to_plate(middle, half)
        total += _degree_5(parts[done], half).sum()
        parts = quartered(parts[~done])
        if len(parts) == 0:
            return total
    return np.inf


def nearest_to_plate(triangles, half, accuracy):
    """A distance (m) from the rectangle to triangles that is at most `accuracy` more than the smallest one."""
    best, parts = np.inf, triangles
    while len(parts):
        middle = parts.mean(axis=1)
        radius = np.linalg.norm(parts - middle[:, None], axis=2).max(axis=1)
        distance = distance_to_plate(middle, half)
        best = min(best, distance.min())
        parts = quartered(parts[distance - radius < best - accuracy])
    return float(best)


def distance_to_plate(points, half):
    """Distances of points (..., 3) to the rectangle."""
    beyond = np.maximum(np.abs(points[..., :2]) - half, 0.0)
    return np.sqrt((beyond**2).sum(axis=-1) + points[..., 2] ** 2)


def quartered(triangles):
    """Each triangle's four quarters."""
    a, b, c = np.moveaxis(triangles, 1, 0)
    ab, bc, ca = 0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a)
    quarters = ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))
    return np.concatenate([np.stack(quarter, axis=1) for quarter in quarters])


def _degree_5(triangles, half):
    a, b, c = np.moveaxis(triangles, 1, 0)
    area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
    total = 0.225 / distance_to_plate(triangles.mean(axis=1), half)
    for weight, u in ((0.1323941527885062, 0.4701420641051151), (0.1259391805448271, 0.1012865073234563)):
        for corner in range(3):
            point = u * triangles.sum(axis=1) + (1.0 - 3.0 * u) * triangles[:, corner]
            total += weight / distance_to_plate(point, half)
    return area * total


def _above(triangles):
    """What of triangles lies at z >= 0, as triangles."""
    low, high = triangles[..., 2].min(axis=1), triangles[..., 2].max(axis=1)
    found = [triangles[(low >= 0.0) & (high > 0.0)]]
    for corners in triangles[(low < 0.0) & (high > 0.0)]:
        polygon = []
        for p, q in zip(corners, np.roll(corners, -1, axis=0), strict=True):
            if p[2] >= 0.0:
                polygon.append(p)
            if (p[2] >= 0.0) != (q[2] >= 0.0):
                polygon.append(p + p[2] / (p[2] - q[2]) * (q - p))
        found += [np.array([[polygon[0], polygon[k], polygon[k + 1]]]) for k in range(1, len(polygon) - 1)]
    return np.concatenate(found)
