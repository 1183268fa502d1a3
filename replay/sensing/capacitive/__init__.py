"""The capacitive sensor: plates that feel the triangles around them through 1/distance."""

from replay.sensing.capacitive.divider import output_voltage
from replay.sensing.capacitive.integral import plate_integral

__all__ = ["output_voltage", "plate_integral"]
