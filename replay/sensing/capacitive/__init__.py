"""The capacitive sensor: plates that feel the triangles around them through 1/distance.

The way of a reading, and where each step lives:

- `kind` is what others know of it, `part` how it is written, `columns` what it reads.
- `sensor` declares plates and sensors; `suite` reads all of them in all frames of a block; `divider` gives the voltage.
- One triangle: `contact` decides whether its integral is infinite; `exact` (with `area_share`) and `midpoint` are the
  methods; `integral` is the public function. `triangle_sum` goes over all triangles of a body with them.
- A body with a tolerance: `tree_sum`, where the bounds are derived. Before: `clusters` (with `moments`) is what is kept
  of a body's tree. For every pose: `placed_plate`; `saturation` asks for infinity first; `opening` spends the `budget`,
  with `cluster_bounds` and `triangle_bounds` (with `triangle_rules`) judging and `part_queue` keeping parts;
  `hard_triangles` (with `triangle_pieces`) sums what no rule fits; `part_sum` sums the parts, clusters by `expansion`
  and triangles by `point_sums`. `lanes` and `room` are the memory all of these work in.
"""

from typing import TYPE_CHECKING

from replay import submodules

if TYPE_CHECKING:
    from replay.sensing.capacitive.divider import output_voltage as output_voltage
    from replay.sensing.capacitive.integral import plate_integral as plate_integral
    from replay.sensing.capacitive.sensor import CapacitiveSensor as CapacitiveSensor
    from replay.sensing.capacitive.sensor import Plate as Plate
    from replay.sensing.capacitive.suite import CapacitiveSuite as CapacitiveSuite

__getattr__ = submodules(
    __name__,
    CapacitiveSensor="sensor",
    CapacitiveSuite="suite",
    Plate="sensor",
    output_voltage="divider",
    plate_integral="integral",
)
