"""Which sensors are one unit, and which electrodes can be."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from replay.errors import InvalidValue
from replay.numerics import transforms
from replay.sensing.capacitive.sensor import CapacitiveSensor, Plate
from replay.sensing.electrostatics.conductors import stations
from replay.sensing.electrostatics.unit import Electrode, Unit
from replay.sensing.target import make_target
from tests.sensing.electrostatics.made_cases import rectangle, shifted


def test_sensors_that_are_no_unit_are_refused_without_a_scenario() -> None:
    plates = [
        Plate("p", transforms.from_translation(np.array([x, 0.0, 0.0])), np.array([0.02, 0.02])) for x in (-0.03, 0.03)
    ]
    sheet = (("sheet", rectangle(0.2, 0.2, -0.01)),)
    target = make_target("body/plate", 1, rectangle(0.1, 0.1, 0.05))

    def unit(first: dict[str, Any], second: dict[str, Any]) -> None:
        sensors = [
            CapacitiveSensor(name, 0, (plate,), 1e-11, **given)
            for name, plate, given in zip("ab", plates, (first, second), strict=True)
        ]
        stations(sensors, [target])

    with pytest.raises(InvalidValue, match=r"'b': ignore .* must ignore the same links as 'a'"):
        unit({}, {"ignored_links": frozenset([1])})
    with pytest.raises(InvalidValue, match=r"'b': driven .* must be as of 'a'"):
        unit({"back": sheet, "driven": True}, {})
    with pytest.raises(InvalidValue, match=r"driven .* has no effect: nothing is in `back`"):
        unit({"driven": True}, {"driven": True})


@pytest.mark.parametrize("z", [0.0, 5e-7])
def test_electrodes_that_touch_are_named(z: float) -> None:
    electrodes = [
        Electrode("far", (shifted(rectangle(0.02, 0.02), 0.1, 0.0, 0.0),)),
        Electrode("plate", (rectangle(0.02, 0.02, z),)),
        Electrode("back", (rectangle(0.3, 0.05),)),
    ]
    with pytest.raises(InvalidValue, match="electrodes = plate, back: must not touch"):
        Unit(electrodes[1:])
    with pytest.raises(InvalidValue, match="electrodes = far, back: must not touch"):
        Unit(electrodes)
    Unit(electrodes[:2])
