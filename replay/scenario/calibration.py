"""A scenario's capacitive sensor and a measured curve: what the model says at each point, and the fitted sensor."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from replay.errors import CalibrationError, CurveError, InvalidValue
from replay.kinematics.linkage import Joint
from replay.kinematics.motion import sample
from replay.language.units import ANGLE, CAPACITANCE, DIMENSION_OF, LENGTH, VOLTAGE, Dimension, quantity_rule
from replay.logs.curve_csv import Column, Curve
from replay.numerics.arrays import Floats
from replay.scenario.model import Scenario
from replay.scenario.scene import build
from replay.sensing.calibration import CONFIDENCE, QUANTITIES, Calibration, Quantity, calibrate
from replay.sensing.capacitive.kind import Capacitive
from replay.sensing.capacitive.part import ELECTROSTATIC, VACUUM_PERMITTIVITY

_DIGITS = 10
"""Of fitted numbers in a sensor file; the model itself is good to 6."""


class SensorPath:
    """A capacitive sensor along the positions of one joint; everything else stands where it is at the start.

    Args:
        scenario: with the sensor, what it senses, and the joint.
        sensor: its name; may be left out when there is only one.
        joint: its name; may be left out when only one revolute, continuous or prismatic joint is scripted to move, or
            there is only one.

    Attributes:
        sensor, joint: the chosen ones.

    Raises:
        InvalidValue: there is no such sensor or joint, or more than one to choose from.
        ScenarioError: a mesh cannot be used.
    """

    def __init__(self, scenario: Scenario, *, sensor: str | None = None, joint: str | None = None) -> None:
        scene = build(scenario)
        sensors = {found.name: found for found in scene.capacitive_sensors}
        machine = scene.linkage
        joints = {found.name: found for found in machine.joints if found.name not in machine.followers}
        moved = {*scene.script.points, *(name for move in scene.script.moves for name in move.to)}
        self.scenario = scenario
        self.sensor = sensors[_only("sensor", sensor, sorted(sensors), sorted(sensors))]
        self.joint: Joint = joints[
            _only("joint", joint, sorted(joints), sorted(moved & joints.keys()) or sorted(joints))
        ]
        self._linkage = scene.linkage
        self._start = sample(scene.linkage, scene.script, np.zeros(1))
        method = scene.model.capacitive
        same_link = [found for found in sensors.values() if found.link == self.sensor.link]
        # to electrostatics, the plates of the sensors beside it belong to what it reads
        own = same_link if method.method in ELECTROSTATIC else [self.sensor]
        self.method = scene.model.identity()["capacitive"]
        self._column = own.index(self.sensor)
        alone = [replace(found, permittivity=1.0, stray_capacitance=0.0) for found in own]
        # the points of a curve are no motion: none is between others
        self._suite: Any = Capacitive().suite(alone, scene.targets, method, savings=method.method not in ELECTROSTATIC)
        self._found: dict[bytes, Floats] = {}

    @property
    def computes_charges(self) -> bool:
        """Whether the model is electrostatics, with the vacuum's permittivity and what the sensor is by itself."""
        return bool(self.scenario.model.capacitive.method in ELECTROSTATIC)

    def integral(self, positions: ArrayLike) -> Floats:
        """Return the sensor's integral (n,) [m] at joint positions (n,) [rad or m]; inf where it is saturated.

        With electrostatics it is what the sensor reads over the vacuum's permittivity, NaN where that is not resolved.
        """
        at = np.asarray(positions, dtype=np.float64)
        if at.tobytes() not in self._found:
            self._found[at.tobytes()] = self._integral(at)
        return self._found[at.tobytes()]

    def _integral(self, at: Floats) -> Floats:
        states = np.repeat(self._start.positions, len(at), axis=0)
        states[:, self._linkage.joint_names.index(self.joint.name)] = at
        states = self._linkage.followed(states)
        poses = self._linkage.forward(states, np.repeat(self._start.free_poses, len(at), axis=0))
        columns = self._suite.run(poses)
        found: Floats = columns.capacitance[:, self._column]
        return found if columns.unresolved is None else np.where(columns.unresolved[:, self._column], np.nan, found)

    def positions(self, curve: Curve) -> Floats:
        """Return a curve's abscissa as joint positions (n,) [rad or m].

        Raises:
            CurveError: its unit is not the joint's, or a point is outside the joint's limits.
        """
        wanted = LENGTH if self.joint.type.unit == "m" else ANGLE
        values = in_si(curve.file, curve.x, curve.x_values, (wanted,))
        for line, value in zip(curve.lines, values, strict=True):
            if not self.joint.lower <= value <= self.joint.upper:
                limits = f"{self.joint.lower:.6g} .. {self.joint.upper:.6g} {wanted.si}"
                raise CurveError(
                    curve.file, line, f"{value:.6g} {wanted.si} is outside joint {self.joint.name!r}: {limits}"
                )
        return values

    def integral_along(self, curve: Curve) -> Floats:
        """Return the integral (n,) [m] at the points of a curve; CurveError also where the sensor is saturated."""
        found = self.integral(self.positions(curve))
        for line, value in zip(curve.lines, found, strict=True):
            if not np.isfinite(value):
                raise CurveError(
                    curve.file, line, "the sensor is in contact there, or too near, and has no reading; leave it out"
                )
        return found


@dataclass(frozen=True, eq=False)
class CurveFit:
    """A calibration with what it is of.

    Attributes:
        path: the sensor and the joint.
        curve: as measured.
        integral: (n,) [m] at its points.
        calibration: the constants.
        unit: size of the curve's y unit [F or V].
    """

    path: SensorPath
    curve: Curve
    integral: Floats
    calibration: Calibration
    unit: float


def fit_curve(
    path: SensorPath,
    curve: Curve,
    *,
    quantity: Quantity | None = None,
    coupling: str | None = None,
    absolute: tuple[str, str] | None = None,
    offset: bool = False,
) -> CurveFit:
    """Fit a sensor's constants to a curve.

    Args:
        path: the sensor, and the joint that moved it.
        curve: as read; its abscissa is the joint's position.
        quantity: what was measured; when left out, capacitance for a curve in farad, and delta output for one in volt
            whose name says so.
        coupling: of the voltage divider, with its unit; the scenario's when left out; "fit" needs `absolute`.
        absolute: position and capacitance, with units, of one measurement of the absolute capacitance.
        offset: whether the stray capacitance is fitted; else it is the scenario's.

    Raises:
        CurveError: a row, a unit or a point cannot be used.
        CalibrationError: the curve does not determine what is asked.
        InvalidValue: an option is not as stated.
    """
    found = _quantity(curve, quantity)
    values = in_si(curve.file, curve.y, curve.y_values, (_DIMENSIONS[found],))
    if coupling == "fit" and absolute is None:
        raise CalibrationError(
            "a capacitance curve does not show the coupling; state it"
            if found == "capacitance"
            else "a delta output shows permittivity / coupling only, never both: state the coupling,"
            " or one absolute capacitance by --capacitance-at"
        )
    if coupling not in (None, "fit") and absolute is not None:
        raise InvalidValue("--coupling", coupling, "and --capacitance-at both fix the coupling; keep one of the two")
    stated = path.sensor.coupling if coupling in (None, "fit") else _si("--coupling", coupling or "", CAPACITANCE)
    integral = path.integral_along(curve)
    fixed = None if absolute is None else _absolute(path, absolute)
    result = calibrate(
        integral,
        values,
        quantity=found,
        coupling=stated,
        supply=path.sensor.supply,
        stray_capacitance=path.sensor.stray_capacitance,
        offset=offset,
        absolute=fixed,
    )
    return CurveFit(path, curve, integral, result, float(_DIMENSIONS[found].units[curve.y.unit]))


def sensor_file(fit: CurveFit) -> str:
    """Return the text of a file that a scenario includes instead of defining the sensor itself."""
    from ruamel.yaml import YAML

    path, found = fit.path, fit.calibration
    written = path.scenario.sensors.capacitive[path.sensor.name].model_dump(exclude_defaults=True)
    for name in ("coupling", "permittivity", "stray_capacitance"):
        written[name] = float(f"{getattr(found, name):.{_DIGITS}g}")
    stream = StringIO()
    yaml = YAML()
    yaml.width = 110
    yaml.dump({"sensors": {"capacitive": {path.sensor.name: _plain(written)}}}, stream)
    remarks = [
        f"Sensor {path.sensor.name!r}, fitted by `replay calibrate` to {json.dumps(Path(fit.curve.file).name)}",
        f"({len(found.measured)} points along joint {path.joint.name!r}, model {path.method}).",
        f"Fitted quantity: {found.quantity}; rms residual {found.rms / fit.unit:.4g} {fit.curve.y.unit}.",
        *(
            f"{entry.name} = {entry.value:.6g} +- {entry.half_width:.2g} {entry.unit} ({CONFIDENCE:.0%})"
            for entry in found.estimates
            if entry.fitted
        ),
        permittivity_said(fit),
        "A scenario includes this file instead of defining the sensor: include: [sensor.yaml]",
    ]
    return "".join(f"# {line}\n" for line in remarks) + stream.getvalue()


def permittivity_said(fit: CurveFit) -> str:
    """Return what the fitted permittivity is."""
    if not fit.path.computes_charges:
        return "The permittivity is a number of this fit, not of a material."
    (found,) = [entry for entry in fit.calibration.estimates if entry.name == "permittivity"]
    factor, width = found.value / VACUUM_PERMITTIVITY, found.half_width / VACUUM_PERMITTIVITY
    fitted = f"The permittivity is the vacuum's times an overall factor of {factor:.4g} +- {width:.2g}"
    return f"{fitted}: 1 where the sensor is as it is drawn."


_DIMENSIONS: Mapping[Quantity, Dimension] = {"capacitance": CAPACITANCE, "delta_output": VOLTAGE}


def in_si(file: str, column: Column, values: Floats, wanted: tuple[Dimension, ...]) -> Floats:
    """Return a column's values in SI; CurveError when its unit is missing, unknown, or of another dimension."""
    what_works = " or ".join(f"{column.name}_{unit}" for dimension in wanted for unit in dimension.units)
    dimension = DIMENSION_OF.get(column.unit)
    if dimension is None:
        raise CurveError(
            file, None, f"column {column.header!r} does not end in a unit that is known; call it {what_works}"
        )
    if dimension not in wanted:
        needed = " or ".join(entry.name for entry in wanted)
        raise CurveError(file, None, f"column {column.header!r} is {dimension.name} where {needed} belongs")
    return np.array([float(Fraction(repr(float(value))) * dimension.units[column.unit]) for value in values])


def _quantity(curve: Curve, quantity: Quantity | None) -> Quantity:
    if quantity is not None:
        return quantity
    dimension = DIMENSION_OF.get(curve.y.unit)
    if dimension is CAPACITANCE:
        return "capacitance"
    if dimension is VOLTAGE and "delta" in curve.y.name.lower():
        return "delta_output"
    choice = " or ".join(QUANTITIES)
    rule = f"column {curve.y.header!r} does not say what was measured; say so by --quantity {choice}"
    raise CurveError(curve.file, None, f"{rule} (the delta output is the supply minus the output voltage)")


def _only(what: str, name: str | None, known: list[str], choices: list[str]) -> str:
    if name is not None and name not in known:
        raise InvalidValue(f"--{what}", name, f"is not there; the scenario has {', '.join(known) or 'none'}")
    if name is None and len(choices) != 1:
        rule = f"say which: {', '.join(choices)}" if choices else f"the scenario has no {what} that could be used"
        raise InvalidValue(f"--{what}", "not given", rule)
    return name or choices[0]


def _si(option: str, text: str, dimension: Dimension) -> float:
    found = quantity_rule(text, (dimension,))
    if isinstance(found, str):
        raise InvalidValue(option, text, found)
    return float(found[0])


def _absolute(path: SensorPath, written: tuple[str, str]) -> tuple[float, float]:
    option = "--capacitance-at"
    position = _si(option, written[0], LENGTH if path.joint.type.unit == "m" else ANGLE)
    capacitance = _si(option, written[1], CAPACITANCE)
    integral = float(path.integral([position])[0])
    if not np.isfinite(integral):
        raise InvalidValue(option, written[0], "the sensor is in contact there and has no finite reading")
    return integral, capacitance


def _plain(value: Any) -> Any:
    """Return what the YAML writer knows, lists on one line."""
    if isinstance(value, Mapping):
        return {key: _plain(entry) for key, entry in value.items()}
    if not isinstance(value, tuple | list):
        return value
    from ruamel.yaml.comments import CommentedSeq

    sequence = CommentedSeq([_plain(entry) for entry in value])
    sequence.fa.set_flow_style()
    return sequence
