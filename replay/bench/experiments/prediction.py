"""Experiments II to IV: fit the model on one plate size, then predict other sizes and a pivoting plate."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from replay.bench.experiments.measured import (
    DELTA_STRAY,
    FIELD,
    PICOFARAD,
    PLATES,
    READINGS,
    SELF,
    SIDES,
    SMALL,
    THESIS,
    Bench,
    MeasuredPlate,
    Reading,
)
from replay.bench.experiments.tables import Cell, Table
from replay.logs.curve_csv import Curve
from replay.numerics.arrays import Floats
from replay.scenario.calibration import CurveFit, SensorPath, fit_curve
from replay.scenario.curve_plot import Line, Panel
from replay.sensing.calibration import response

FITTED_SIDE = 20
"""Edge length [cm] of the target plate that experiment II fits."""

PIVOTS = ((20, 20), (10, 20), (10, 10))
"""Experiment IV: edge length [cm] of the pivoting plate, and of the parallel one that was fitted."""


_HONEST = (
    "The measured sensor is electrostatics of ideal conductors too: of field this says how well it solves them,"
    " not how well they describe a real sensor."
)


@dataclass(frozen=True, eq=False)
class Prediction:
    """A curve that was measured and what a fit on another one says of it.

    Attributes:
        plate, reading: of the sensor.
        model: `THESIS` or `FIELD`.
        fitted_side, side: edge lengths [cm] of the target fitted and of the target predicted.
        curve: measured.
        predicted: (n,) in the curve's unit.
    """

    plate: MeasuredPlate
    reading: Reading
    model: str
    fitted_side: int
    side: int
    curve: Curve
    predicted: Floats

    @cached_property
    def deviation(self) -> Floats:
        """Predicted over measured minus 1, (n,): above 0 where the prediction is too high."""
        return np.asarray(self.predicted / self.curve.y_values - 1.0)

    @property
    def worst_of_range(self) -> float:
        """Largest error over the range of the measured curve, which a constant offset does not flatter."""
        error = np.abs(self.predicted - self.curve.y_values)
        return float(error.max() / np.ptp(self.curve.y_values))

    @property
    def worst(self) -> int:
        """Index of the point with the largest deviation, up or down."""
        return int(np.argmax(np.abs(self.deviation)))


def fit(
    bench: Bench, plate: MeasuredPlate, reading: Reading, side: int = FITTED_SIDE, *, model: str = THESIS
) -> CurveFit:
    """Return the fit on a parallel target plate of an edge length [cm]."""
    path, curve = bench.path(plate, "parallel", side, model), bench.parallel(plate, reading, side)
    return fit_curve(path, curve, quantity=reading.quantity, offset=reading.fits_offset(model))


def predict_parallel(
    bench: Bench, plate: MeasuredPlate, reading: Reading, side: int, *, model: str = THESIS
) -> Prediction:
    """Return what the fit on 20 cm says of a parallel plate of another edge length [cm]."""
    found = fit(bench, plate, reading, model=model)
    path, curve = bench.path(plate, "parallel", side, model), bench.parallel(plate, reading, side)
    return Prediction(plate, reading, model, FITTED_SIDE, side, curve, _predicted(found, path, curve))


def predict_pivot(
    bench: Bench, plate: MeasuredPlate, reading: Reading, side: int, fitted_side: int, *, model: str = THESIS
) -> Prediction:
    """Return what the fit on a parallel plate says of a pivoting one; edge lengths [cm]."""
    found = fit(bench, plate, reading, fitted_side, model=model)
    path, curve = bench.path(plate, "pivot", side, model), bench.pivot(plate, reading, side)
    return Prediction(plate, reading, model, fitted_side, side, curve, _predicted(found, path, curve))


def _asked(plates: Sequence[MeasuredPlate]) -> list[tuple[str, Reading, MeasuredPlate]]:
    """Return what each model can be asked; how far a back plate is behind its sensor is not on record."""
    return [
        (model, reading, plate)
        for reading in READINGS
        for model in (THESIS, FIELD)
        for plate in plates
        if model == THESIS or (reading.told_by(model) and not plate.back)
    ]


def _predicted(found: CurveFit, path: SensorPath, curve: Curve) -> Floats:
    constants = found.calibration
    values = response(
        path.integral_along(curve),
        quantity=constants.quantity,
        permittivity=constants.permittivity,
        stray_capacitance=constants.stray_capacitance,
        coupling=constants.coupling,
        supply=path.sensor.supply,
    )
    return np.asarray(values / found.unit)


def run_fit(folder: Path) -> tuple[list[Table], list[Panel]]:
    """Return tables and drawings of experiment II: the constants and the residual for each quantity."""
    bench = Bench(folder)
    rows: list[dict[str, Cell]] = []
    panels = []
    for model, reading, plate in _asked(PLATES):
        found = fit(bench, plate, reading, model=model)
        constants = found.calibration
        eps = next(entry for entry in constants.estimates if entry.name == "permittivity")
        misfit = np.abs(constants.residuals / constants.measured)
        rows.append(
            {
                "fitted quantity": reading.name,
                "model": model,
                "sensor [cm]": plate.name,
                "eps [pF/m]": constants.permittivity / PICOFARAD,
                "+- (95%)": eps.half_width / PICOFARAD,
                "C_0 [pF]": constants.stray_capacitance / PICOFARAD,
                "rms residual": constants.rms / found.unit,
                "unit": found.curve.y.unit,
                "worst [%]": 100.0 * float(misfit.max()),
            }
        )
        if model == THESIS and reading in (SELF, DELTA_STRAY) and not plate.back:
            x, y = found.curve.x_values, found.curve.y_values
            lines = [Line("measured", x, y, points=True), Line("fitted", x, constants.fitted / found.unit, color=1)]
            title = f"II. {plate.name} cm sensor, {FITTED_SIDE} cm plate\n{reading.name}"
            panels.append(Panel(title, found.curve.x.header, found.curve.y.header, lines))
    remarks = [
        "eps is a number of this fit, not of a material: the vacuum's is 8.854 pF/m.",
        "field knows what the sensor is by itself, so eps is the vacuum's times what is left to fit, and C_0 is stray.",
        _HONEST,
    ]
    title = f"II. Fit on a parallel plate of {FITTED_SIDE} cm (worst: largest residual over the measured value)"
    return [Table("experiment_2_fit", title, rows, remarks)], panels


def run_sizes(folder: Path) -> tuple[list[Table], list[Panel]]:
    """Return tables and drawings of experiment III: the other plate sizes predicted from the fit on 20 cm."""
    bench = Bench(folder)
    found = [
        predict_parallel(bench, plate, reading, side, model=model)
        for model, reading, plate in _asked(PLATES)
        for side in SIDES
        if side != FITTED_SIDE
    ]
    told = dict.fromkeys((entry.model, entry.reading) for entry in found)
    remarks = [*(_signs(model, reading, found) for model, reading in told), _HONEST]
    title = f"III. Other plate sizes, predicted from the fit on {FITTED_SIDE} cm: predicted over measured - 1"
    tables = [
        Table("experiment_3_sizes", title, [_summary(entry) for entry in found], remarks),
        Table("experiment_3_points", "III. Point by point", [row for entry in found for row in _points(entry)]),
    ]
    return tables, _panels("III", found)


def run_pivot(folder: Path) -> tuple[list[Table], list[Panel]]:
    """Return tables and drawings of experiment IV: the pivoting plate predicted from the fit on a parallel one."""
    bench = Bench(folder)
    found = [
        predict_pivot(bench, plate, reading, *sides, model=model)
        for model, reading, plate in _asked([SMALL])
        for sides in PIVOTS
    ]
    tables = [
        Table(
            "experiment_4_pivot",
            "IV. Pivoting plate, predicted from the fit on a parallel one: predicted over measured - 1",
            [_summary(entry) for entry in found],
            [_HONEST],
        ),
        Table("experiment_4_points", "IV. Point by point", [row for entry in found for row in _points(entry)]),
    ]
    return tables, _panels("IV", found)


def _summary(entry: Prediction) -> dict[str, Cell]:
    percent, worst = 100.0 * entry.deviation, entry.worst
    return {
        "fitted quantity": entry.reading.name,
        "model": entry.model,
        "sensor [cm]": entry.plate.name,
        "fitted [cm]": entry.fitted_side,
        "plate [cm]": entry.side,
        "worst [%]": float(percent[worst]),
        f"at {entry.curve.x.header}": float(entry.curve.x_values[worst]),
        "lowest [%]": float(percent.min()),
        "highest [%]": float(percent.max()),
        "mean [%]": float(percent.mean()),
        "worst / range [%]": 100.0 * entry.worst_of_range,
    }


def _points(entry: Prediction) -> list[dict[str, Cell]]:
    columns = (entry.curve.x_values, entry.curve.y_values, entry.predicted, entry.deviation)
    return [
        {
            "fitted quantity": entry.reading.name,
            "model": entry.model,
            "sensor [cm]": entry.plate.name,
            "fitted [cm]": entry.fitted_side,
            "plate [cm]": entry.side,
            entry.curve.x.header: x,
            "measured": y,
            "predicted": predicted,
            "unit": entry.curve.y.unit,
            "deviation [%]": 100.0 * deviation,
        }
        for x, y, predicted, deviation in zip(*(column.tolist() for column in columns), strict=True)
    ]


def _signs(model: str, reading: Reading, predictions: Iterable[Prediction]) -> str:
    """Return one line: the worst deviations for each size, of the sensors without a back plate and of the one with."""
    parts = []
    chosen = [entry for entry in predictions if entry.reading is reading and entry.model == model]
    for side in SIDES:
        worst = [(entry.plate.back, float(entry.deviation[entry.worst])) for entry in chosen if entry.side == side]
        if worst:
            open_ones = _span([value for back, value in worst if not back])
            backed = _span([value for back, value in worst if back])
            beside = f" ({backed} with a grounded back plate)" if backed else ""
            parts.append(f"{side} cm plate {open_ones}{beside}")
    of_range = [100.0 * entry.worst_of_range for entry in chosen]
    range_part = f"{min(of_range):.2g} .. {max(of_range):.2g} % of the curve's own range"
    by = "" if model == THESIS else f"{model}, "
    return f"{by}{reading.name}, worst point: {'; '.join(parts)}; {range_part}."


def _span(values: Sequence[float]) -> str:
    if not values:
        return ""
    low, high = 100.0 * min(values), 100.0 * max(values)
    digits = 0 if max(-low, high) >= 1.0 else 1
    if round(low, digits) == round(high, digits):
        return f"{low:+.{digits}f} %"
    return f"{low:+.{digits}f} .. {high:+.{digits}f} %"


def _panels(title: str, predictions: Iterable[Prediction]) -> list[Panel]:
    """Return one drawing for each shown quantity and sensor, with all its curves."""
    groups: dict[tuple[Reading, MeasuredPlate], list[Prediction]] = {}
    for entry in predictions:
        if entry.reading in (SELF, DELTA_STRAY) and not entry.plate.back:
            groups.setdefault((entry.reading, entry.plate), []).append(entry)
    panels = []
    for (reading, plate), entries in groups.items():
        lines = []
        for color, entry in enumerate(entries):
            x = entry.curve.x_values
            name = f"{entry.side} cm plate"
            if entry.model == THESIS:
                lines.append(Line(f"{name}, measured", x, entry.curve.y_values, points=True, color=color))
            label = f"{name}, predicted from {entry.fitted_side} cm"
            lines.append(Line(f"{label} by {entry.model}", x, entry.predicted, color=color))
        first = entries[0].curve
        panels.append(Panel(f"{title}. {plate.name} cm sensor\n{reading.name}", first.x.header, first.y.header, lines))
    return panels
