"""A calibration as text, as data for programs, and as a drawing."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from replay.errors import RecordingExistsError
from replay.logs.part_file import write_file
from replay.scenario.calibration import CurveFit, permittivity_said, sensor_file
from replay.scenario.curve_plot import Line, Panel, draw
from replay.sensing.calibration import CONFIDENCE, Estimate


def text(fit: CurveFit) -> str:
    """Return what a person wants to know: the constants with their intervals, what was fitted, every residual."""
    found, curve, path = fit.calibration, fit.curve, fit.path
    name, unit = curve.y.header, curve.y.unit
    lines = [
        f"sensor {path.sensor.name!r} of {path.scenario.name!r} along joint {path.joint.name!r}, model {path.method}",
        f"fitted quantity: {found.quantity} ({name} of {Path(curve.file).name}, {len(found.measured)} points)",
        f"robust least squares (soft_l1), {CONFIDENCE:.0%} confidence intervals:",
        *(f"  {entry.name:<30}{_value(entry)}" for entry in found.estimates),
        f"residuals: rms {found.rms / fit.unit:.4g} {unit} ({_share(fit):.1%} of the curve's range)",
        f"  {curve.x.header:>16}{name:>24}{'fitted':>14}{'residual':>14}",
    ]
    for x, y, fitted in zip(curve.x_values, curve.y_values, found.fitted / fit.unit, strict=True):
        lines.append(f"  {x:>16.6g}{y:>24.6g}{fitted:>14.6g}{y - fitted:>14.3g}")
    lines.append(permittivity_said(fit))
    lines += [f"not pinned down: the interval of {entry.name} holds 0" for entry in found.estimates if _is_loose(entry)]
    return "\n".join(lines)


def as_json(fit: CurveFit) -> dict[str, Any]:
    """Return the same as data, in SI; a confidence interval is null where there is none."""
    found, curve, path = fit.calibration, fit.curve, fit.path
    return {
        "scenario": path.scenario.name,
        "sensor": path.sensor.name,
        "joint": path.joint.name,
        "model": path.method,
        "curve": Path(curve.file).name,
        "quantity": found.quantity,
        "confidence": CONFIDENCE,
        "estimates": [
            {
                "name": entry.name,
                "unit": entry.unit,
                "value": entry.value,
                "fitted": entry.fitted,
                "interval": _interval(entry),
            }
            for entry in found.estimates
        ],
        "residuals": {
            "unit": "F" if found.quantity == "capacitance" else "V",
            "rms": found.rms,
            "largest": float(np.abs(found.residuals).max()),
            "points": [
                {"line": line, "position": position, "measured": measured, "fitted": fitted}
                for line, position, measured, fitted in zip(
                    curve.lines,
                    path.positions(curve).tolist(),
                    found.measured.tolist(),
                    found.fitted.tolist(),
                    strict=True,
                )
            ],
        },
    }


def write(fit: CurveFit, sensor: Path, drawing: Path, *, overwrite: bool) -> None:
    """Write the sensor file and the drawing (PNG), or neither.

    Raises:
        RecordingExistsError: one of them exists and `overwrite` is false.
        WriteError: one of them cannot be written.
    """
    for path in (sensor, drawing):
        if path.exists() and not overwrite:
            raise RecordingExistsError(str(path))
    draw(drawing, panels(fit), overwrite=overwrite, named=True)
    write_file(sensor, sensor_file(fit).encode(), overwrite=overwrite, named=True)


def panels(fit: CurveFit) -> list[Panel]:
    """Return the drawing: the curve with the fit, and the residuals below."""
    curve, found = fit.curve, fit.calibration
    x, unit = curve.x.header, curve.y.unit
    title = f"{fit.path.sensor.name}: {found.quantity} fitted"
    return [
        Panel(
            title,
            x,
            curve.y.header,
            [
                Line("measured", curve.x_values, curve.y_values, points=True),
                Line("fitted", curve.x_values, found.fitted / fit.unit, color=1),
            ],
        ),
        Panel(
            "residuals",
            x,
            f"measured - fitted [{unit}]",
            [Line("residual", curve.x_values, found.residuals / fit.unit, points=True)],
        ),
    ]


def _interval(entry: Estimate) -> list[float] | None:
    if not entry.fitted or math.isnan(entry.half_width):
        return None
    return [entry.value - entry.half_width, entry.value + entry.half_width]


def _value(entry: Estimate) -> str:
    number = f"{entry.value:>14.6g} {entry.unit:<4}"
    if not entry.fitted:
        return f"{number} stated, not fitted"
    interval = _interval(entry)
    return (
        f"{number} {interval[0]:.4g} .. {interval[1]:.4g}" if interval else f"{number} no interval: no point to spare"
    )


def _is_loose(entry: Estimate) -> bool:
    return entry.fitted and not entry.half_width < entry.value


def _share(fit: CurveFit) -> float:
    """Return the rms residual over the range of the measured values; over their size when they are all the same."""
    found = fit.calibration
    span = float(np.ptp(found.measured)) or float(np.abs(found.measured).max())
    return found.rms / span
