"""The capacitive sensor: plates that feel the triangles around them through 1/distance."""

from replay.sensing.capacitive.divider import output_voltage
from replay.sensing.capacitive.integral import plate_integral
from replay.sensing.capacitive.sensor import CapacitiveSensor, Plate
from replay.sensing.capacitive.suite import CapacitiveSuite

__all__ = ["CapacitiveSensor", "CapacitiveSuite", "Plate", "output_voltage", "plate_integral"]
