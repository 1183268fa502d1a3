"""The distance sensor: the closest point in a cone, exactly, or as other models see it; `kind` is what others know."""

from typing import TYPE_CHECKING

from replay import submodules

if TYPE_CHECKING:
    from replay.sensing.distance.closest import ConeHit as ConeHit
    from replay.sensing.distance.closest import closest_in_cone as closest_in_cone
    from replay.sensing.distance.suite import DistanceSensor as DistanceSensor
    from replay.sensing.distance.suite import DistanceSuite as DistanceSuite

__getattr__ = submodules(
    __name__, ConeHit="closest", closest_in_cone="closest", DistanceSensor="suite", DistanceSuite="suite"
)
