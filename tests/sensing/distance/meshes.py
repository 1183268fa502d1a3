"""Small meshes for sensor tests."""

import numpy as np


def torus(around: int, across: int, major: float = 1.0, minor: float = 0.4) -> np.ndarray:
    """Triangles (2 around across, 3, 3) of a torus about z, counter-clockwise seen from outside."""
    u, v = np.meshgrid(np.arange(around) / around, np.arange(across) / across, indexing="ij")
    u, v = 2.0 * np.pi * u, 2.0 * np.pi * v
    radius = major + minor * np.cos(v)
    p = np.stack([radius * np.cos(u), radius * np.sin(u), minor * np.sin(v)], axis=-1)
    q, r, s = np.roll(p, -1, 0), np.roll(np.roll(p, -1, 0), -1, 1), np.roll(p, -1, 1)
    return np.concatenate([np.stack([p, q, r], axis=2), np.stack([p, r, s], axis=2)]).reshape(-1, 3, 3)


def grid_of_cubes(count: int) -> np.ndarray:
    """Triangles of count^3 unit cubes that touch: full of shared corners, edges and equal distances."""
    corner = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = np.array([face for a, b, c, d in quads for face in ((a, b, c), (a, c, d))])
    places = np.array([[x, y, z] for x in range(count) for y in range(count) for z in range(count)], dtype=float)
    return (corner[faces][None] + places[:, None, None]).reshape(-1, 3, 3)
