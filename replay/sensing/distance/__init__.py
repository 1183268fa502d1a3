"""The distance sensor: the closest point in a cone, exactly, or as other models see it."""

from replay.sensing.distance.closest import ConeHit, closest_in_cone
from replay.sensing.distance.suite import DistanceSensor, DistanceSuite

__all__ = ["ConeHit", "DistanceSensor", "DistanceSuite", "closest_in_cone"]
