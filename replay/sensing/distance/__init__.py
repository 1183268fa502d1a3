"""The distance sensor: the closest point in a cone, exactly, or as other models see it."""

from replay.sensing.distance.closest import ConeHit, closest_in_cone

__all__ = ["ConeHit", "closest_in_cone"]
