"""The capacitive sensor: plates that feel the triangles around them through 1/distance.

The way of a reading, and where each step lives:

- What a sensor is: `part` as it is written, `sensor` as it is computed, with its voltage divider; `columns` is what it
  reads, `kind` what other rooms know of it.
- `suite` reads all sensors in all frames of a block, by one of three methods.
- The integral over one triangle: `integral` is the public function, with the thesis's midpoints; `exact`, with
  `area_share`, is the closed form. `placed_plate` is a plate in its pose.
- Touching and saturation: `contact`, by signs, before anything is integrated.
- Over a body: `triangle_sum`, all triangles one by one ("exact" and "midpoint"), or `tree`, to a tolerance.
"""

from typing import TYPE_CHECKING

from replay import submodules

if TYPE_CHECKING:
    from replay.sensing.capacitive.integral import plate_integral as plate_integral
    from replay.sensing.capacitive.sensor import CapacitiveSensor as CapacitiveSensor
    from replay.sensing.capacitive.sensor import Plate as Plate
    from replay.sensing.capacitive.sensor import output_voltage as output_voltage
    from replay.sensing.capacitive.suite import CapacitiveSuite as CapacitiveSuite

__getattr__ = submodules(
    __name__,
    CapacitiveSensor="sensor",
    CapacitiveSuite="suite",
    Plate="sensor",
    output_voltage="sensor",
    plate_integral="integral",
)
