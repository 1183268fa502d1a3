"""The same bundle of rays, shot by Embree (through embreex, in float32)."""

from __future__ import annotations

from typing import Any

import numpy as np

from replay.errors import MissingPackageError
from replay.numerics.arrays import Floats
from replay.sensing.distance.readings import Nearest


class EmbreeBundle:
    """One target as an Embree scene.

    Args:
        triangles: (n, 3, 3) in the link's frame [m].

    Raises:
        MissingPackageError: embreex is not installed.
    """

    def __init__(self, triangles: Floats) -> None:
        try:
            from embreex.mesh_construction import TriangleMesh
            from embreex.rtcore_scene import EmbreeScene
        except ImportError as error:
            raise MissingPackageError("embreex", "the ray engine 'embree'", "pip install embreex") from error
        self._scene: Any = EmbreeScene()
        self._mesh = TriangleMesh(self._scene, triangles.astype(np.float32))

    def sweep(self, T_target_sensor: Floats, directions: Floats, reach: float, target: int, nearest: Nearest) -> None:
        """Update `nearest` in every frame; arguments as `replay.sensing.distance.rays.sweep_rays`."""
        x, y, z = directions[:, 0], directions[:, 1], directions[:, 2]
        for i, pose in enumerate(T_target_sensor):
            turned = np.stack([pose[r, 0] * x + pose[r, 1] * y + pose[r, 2] * z for r in range(3)], axis=-1)
            origins = np.repeat(pose[None, :3, 3], len(turned), axis=0)
            hits = self._scene.run(origins.astype(np.float32), turned.astype(np.float32), output=True)
            lengths = np.where(hits["primID"] >= 0, hits["tfar"].astype(np.float64), np.inf)
            ray = int(np.argmin(lengths))
            if lengths[ray] <= reach and lengths[ray] < nearest.distance[i]:
                nearest.distance[i] = lengths[ray]
                nearest.offset[i] = lengths[ray] * turned[ray]
                nearest.target[i] = target
                nearest.triangle[i] = hits["primID"][ray]
                nearest.case[i] = 0
