"""The measured sensor of experiments II to IV: boundary-element curves, read as one of several quantities."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

from replay.language.units import CAPACITANCE
from replay.logs.curve_csv import Column, Curve, read_curve
from replay.scenario.calibration import SensorPath
from replay.scenario.load import load
from replay.sensing.calibration import Quantity
from replay.sensing.capacitive.part import SUPPLY, CapacitiveMethod

PICOFARAD = float(CAPACITANCE.units["pF"])
COUPLING = 10.0
"""C_couple [pF] of the plates in scenarios/experiments, which a delta output needs."""


THESIS, FIELD = "thesis", "field"
"""What predicts: the thesis's model, whose permittivity is a number of the fit, or electrostatics."""


@dataclass(frozen=True)
class MeasuredPlate:
    """A sensor plate that was measured: its name in tables, its name in the scenarios, and its rows in the files."""

    name: str
    sensor: str
    x: str
    y: str
    back: str = ""

    def where(self) -> dict[str, str]:
        """Return the cells that its rows have in both files."""
        return {"sensor_x_cm": self.x, "sensor_y_cm": self.y}


SMALL = MeasuredPlate("5 x 5", "plate_5x5", "5", "5")
LONG = MeasuredPlate("4 x 20", "plate_4x20", "4", "20")
BACKED = MeasuredPlate("4 x 20, grounded back", "plate_4x20", "4", "20", back="22")
PLATES = (SMALL, LONG, BACKED)
SIDES = (10, 20, 30)
"""Edge lengths [cm] of the parallel target plates."""

PIVOT_CENTRES = {20: 11, 10: 6}
"""Distance [cm] of the pivoting plate's centre by its edge length [cm]."""


@dataclass(frozen=True)
class Reading:
    """What is taken as measured: a column of the files plus a stray capacitance [pF], read directly or by a divider."""

    name: str
    column: str
    quantity: Quantity
    stray: float
    offset: bool = True

    def fits_offset(self, model: str) -> bool:
        """Return whether a model has an offset to fit: the thesis's needs one for what the sensor is by itself."""
        return self.offset if model == THESIS else self.stray > 0.0

    def told_by(self, model: str) -> bool:
        """Return whether a model has this quantity: `field` has no charge of the target."""
        return model == THESIS or self.column == SELF_COLUMN


SELF_COLUMN = "self_capacitance_pF"
SELF = Reading("self capacitance, nothing stray", SELF_COLUMN, "capacitance", 0.0)
SELF_STRAY = Reading("self capacitance, 10 pF stray", SELF_COLUMN, "capacitance", 10.0)
DELTA = Reading("delta output, 10 pF coupling, nothing stray", SELF_COLUMN, "delta_output", 0.0)
DELTA_STRAY = Reading("delta output, 10 pF coupling, 10 pF stray", SELF_COLUMN, "delta_output", 10.0)
MUTUAL = Reading("mutual capacitance, fitted without offset", "mutual_capacitance_pF", "capacitance", 0.0, offset=False)
NO_OFFSET = Reading("self capacitance, fitted without offset", SELF_COLUMN, "capacitance", 0.0, offset=False)
READINGS = (SELF, SELF_STRAY, DELTA, DELTA_STRAY, MUTUAL, NO_OFFSET)


@dataclass(frozen=True)
class Bench:
    """The folder with the scenarios of the experiments and, below it, the measured curves."""

    folder: Path

    def parallel(self, plate: MeasuredPlate, reading: Reading, side: int) -> Curve:
        """Return the curve over the distance of a parallel target plate of that edge length [cm]."""
        where = {**plate.where(), "grounded_back_plate_cm": plate.back, "target_side_cm": str(side)}
        file = self.folder / "data" / "parallel_plate_curves.csv"
        return _read_as(reading, read_curve(file, x="distance_cm", y=reading.column, where=where))

    def pivot(self, plate: MeasuredPlate, reading: Reading, side: int) -> Curve:
        """Return the curve over the angle of a pivoting target plate of that edge length [cm]."""
        where = {**plate.where(), "target_side_cm": str(side), "centre_distance_cm": str(PIVOT_CENTRES[side])}
        file = self.folder / "data" / "pivot_curves.csv"
        return _read_as(reading, read_curve(file, x="angle_deg", y=reading.column, where=where))

    def path(self, plate: MeasuredPlate, kind: str, side: int, model: str = THESIS) -> SensorPath:
        """Return the model of a plate in the scenario `parallel` or `pivot` of that target [cm]."""
        return _path(self.folder / f"{kind}_{side}cm.yaml", plate.sensor, model)


@cache
def _path(file: Path, sensor: str, model: str) -> SensorPath:
    scenario = load(file)
    if model == THESIS:
        return SensorPath(scenario, sensor=sensor)
    # the scenario's sensors lie on each other; to electrostatics they would be conductors that touch
    own = {sensor: scenario.sensors.capacitive[sensor]}
    method = CapacitiveMethod(method="field")
    return SensorPath(
        scenario.model_copy(
            update={
                "sensors": scenario.sensors.model_copy(update={"capacitive": own}),
                "model": scenario.model.model_copy(update={"capacitive": method}),
            }
        )
    )


def _read_as(reading: Reading, curve: Curve) -> Curve:
    total = curve.y_values + reading.stray
    if reading.quantity == "capacitance":
        return replace(curve, y=Column("capacitance_pF", "capacitance", "pF"), y_values=total)
    return replace(curve, y=Column("delta_output_V", "delta_output", "V"), y_values=SUPPLY * total / (COUPLING + total))
