"""Seeded random rotations and poses."""

import numpy as np


def rotation(rng):
    """Return a random rotation matrix (3, 3)."""
    w, x, y, z = (q := rng.normal(size=4)) / np.sqrt((q**2).sum())
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def pose(turn, position):
    """Return a (4, 4) transform."""
    result = np.identity(4)
    result[:3, :3], result[:3, 3] = turn, position
    return result


def random_pose(rng, reach=1.0):
    """Return a random (4, 4) transform, origin normally distributed with standard deviation `reach`."""
    return pose(rotation(rng), reach * rng.normal(size=3))
