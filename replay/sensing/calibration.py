"""Fit of a capacitive sensor's constants to a measured curve.

Model: C = eps I + C_0, where I [m] is the integral of dA/dist over what the sensor senses, its reading at permittivity
1, and C_0 its stray capacitance. Two quantities can be measured:

    capacitance     y = C                               determines eps and C_0
    delta output    y = V_in C / (C_couple + C)         determines kappa = eps / C_couple and C_0 / C_couple only

All constants of the second can be scaled together without any change of y, so C_couple must be stated, or follow from
one absolute capacitance C_a measured where the integral is I_a: C_couple = C_a / (kappa I_a + C_0 / C_couple).

Both are fitted in z = q_0 I/I_max + q_1 (q_1 is held when C_0 is stated), with y = y_max z for a capacitance and
y = V_in z / (1 + z) for a delta output.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from replay.errors import CalibrationError, InvalidValue
from replay.numerics.arrays import Floats
from replay.sensing.capacitive.part import SUPPLY
from replay.sensing.robust_fit import robust_fit

Quantity = Literal["capacitance", "delta_output"]

QUANTITIES: tuple[Quantity, ...] = ("capacitance", "delta_output")
CONFIDENCE = 0.95


@dataclass(frozen=True)
class Estimate:
    """One constant.

    Attributes:
        name, unit: what it is.
        value: in that unit.
        half_width: of the confidence interval value +- half_width; 0 for a constant that was stated; NaN when there are
            as many parameters as points.
        fitted: whether the curve determined it.
    """

    name: str
    unit: str
    value: float
    half_width: float
    fitted: bool


@dataclass(frozen=True, eq=False)
class Calibration:
    """What a curve says of a sensor.

    Attributes:
        quantity: what was fitted.
        permittivity: eps [F/m].
        stray_capacitance: C_0 [F].
        coupling: C_couple [F].
        estimates: all constants with their confidence intervals.
        measured, fitted: (n,) [F] or [V], the curve and the model's.
        parameters: number of fitted parameters.
    """

    quantity: Quantity
    permittivity: float
    stray_capacitance: float
    coupling: float
    estimates: tuple[Estimate, ...]
    measured: Floats
    fitted: Floats
    parameters: int

    @property
    def residuals(self) -> Floats:
        """Measured minus fitted, (n,) [F] or [V]."""
        return self.measured - self.fitted

    @property
    def rms(self) -> float:
        """Root mean square of the residuals [F] or [V]."""
        return float(np.sqrt(np.mean(self.residuals**2)))


def response(
    integral: ArrayLike,
    *,
    quantity: Quantity,
    permittivity: float,
    stray_capacitance: float,
    coupling: float,
    supply: float,
) -> Floats:
    """Return the capacitance [F] or the delta output [V] of a sensor whose integral is given [m]."""
    capacitance = permittivity * np.asarray(integral, dtype=np.float64) + stray_capacitance
    return capacitance if quantity == "capacitance" else supply * capacitance / (coupling + capacitance)


def calibrate(
    integral: ArrayLike,
    measured: ArrayLike,
    *,
    quantity: Quantity,
    coupling: float,
    supply: float = SUPPLY,
    stray_capacitance: float = 0.0,
    offset: bool = False,
    absolute: tuple[float, float] | None = None,
) -> Calibration:
    """Fit eps, and C_0 if asked, by robust least squares (soft_l1 at the scale of the residuals' median).

    Args:
        integral: (n,) [m], the sensor's integral at each point, finite and >= 0.
        measured: (n,) [F] or [V].
        quantity: "capacitance" or "delta_output" = V_in - V_out.
        coupling: C_couple [F]; not used where `absolute` gives it, kept as it is for a capacitance.
        supply: V_in [V].
        stray_capacitance: C_0 [F], held unless `offset` is fitted.
        offset: whether C_0 is fitted.
        absolute: (integral [m], capacitance [F]) of one absolute measurement that fixes C_couple for a delta output.

    Returns:
        The constants. Confidence intervals (95 %) are those of an M-estimator with independent errors of one size; they
        say how well the curve pins the constants down, not that the model is right.

    Raises:
        InvalidValue: an argument is not as stated.
        CalibrationError: the points do not determine the parameters, or determine values that no sensor has.

    Accuracy: constants of a curve without noise come back to 1e-9; intervals of a noisy one hold the truth in 90 to
    99 % of cases (test_calibration).

    Source: P. J. Huber, Robust Statistics (1981), section 7.6, for the covariance; the model is Huijgens 2015.
    """
    I, y = _points(integral, measured)
    divided = quantity == "delta_output"
    if quantity not in QUANTITIES:
        raise InvalidValue("quantity", quantity, f"must be one of {', '.join(QUANTITIES)}")
    for name, value in (("coupling", coupling), ("supply", supply)):
        if not (np.isfinite(value) and value > 0.0):
            raise InvalidValue(name, value, "must be finite and > 0")
    if not (np.isfinite(stray_capacitance) and stray_capacitance >= 0.0):
        raise InvalidValue("stray_capacitance", stray_capacitance, "must be finite and >= 0")
    if absolute is not None and not divided:
        raise CalibrationError("a capacitance curve does not show the coupling; fit a delta output to find it")
    if absolute is not None and stray_capacitance > 0.0 and not offset:
        raise CalibrationError(
            "a stated stray capacitance cannot be held while the coupling is fitted; fit the offset too"
        )
    if absolute is not None and not (absolute[0] >= 0.0 and absolute[1] > 0.0 and np.isfinite(absolute).all()):
        raise InvalidValue("absolute", absolute, "must be a finite integral >= 0 m and a finite capacitance > 0 F")
    if divided and not (y < supply).all():
        raise CalibrationError(f"a delta output of {y.max():g} V is not below the supply of {supply:g} V")
    if len(I) < 1 + offset:
        raise CalibrationError(f"{len(I)} point(s) cannot determine {1 + offset} parameters")
    largest = float(I.max())
    if largest <= 0.0:
        raise CalibrationError("the sensor senses nothing at any point of the curve")
    scale = supply if divided else float(np.abs(y).max())
    if scale <= 0.0:
        raise CalibrationError("the measured curve is 0 throughout")

    design = np.column_stack([I / largest, np.ones_like(I)])[:, : 1 + offset]
    held = 0.0 if offset else stray_capacitance / (coupling if divided else scale)
    q, covariance = robust_fit(design, held, y / scale, divided)
    if q[0] <= 0.0:
        raise CalibrationError(
            "the measured curve falls where the model's rises, so the fitted permittivity is not above 0;"
            " check the joint, the direction of the abscissa and the measured column"
        )
    if offset and q[1] < 0.0:
        what = f"C_0 / C_couple = {q[1]:.4g}" if divided else f"C_0 = {scale * q[1]:.4g} F"
        raise CalibrationError(f"the fitted offset, {what}, is below 0, which no stray capacitance is; fit without one")
    spread = _t_quantile(len(I) - len(q))
    if divided:
        constants, estimates = _from_delta_output(q, covariance, spread, largest, held, coupling, absolute)
    else:
        constants, estimates = _from_capacitance(q, covariance, spread, largest, scale, held, coupling)
    eps, stray, coupling = constants
    fitted = response(I, quantity=quantity, permittivity=eps, stray_capacitance=stray, coupling=coupling, supply=supply)
    return Calibration(quantity, eps, stray, coupling, estimates, y, fitted, len(q))


def _points(integral: ArrayLike, measured: ArrayLike) -> tuple[Floats, Floats]:
    I, y = np.array(integral, dtype=np.float64), np.array(measured, dtype=np.float64)
    if I.ndim != 1 or I.shape != y.shape or len(I) == 0:
        raise InvalidValue(
            "measured", f"array of shape {y.shape}", f"must be (n,) like the integral's {I.shape}, n >= 1"
        )
    if not (np.isfinite(I).all() and (I >= 0.0).all()):
        raise InvalidValue("integral", "array", "must be finite and >= 0 m; a saturated point cannot be fitted")
    if not np.isfinite(y).all():
        raise InvalidValue("measured", "array", "must be finite")
    return I, y


def _t_quantile(dof: int) -> float:
    from scipy.special import stdtrit

    return float(stdtrit(dof, 0.5 + 0.5 * CONFIDENCE)) if dof > 0 else float("nan")


def _half_widths(covariance: Floats, gradient: Floats, spread: float) -> Floats:
    """Return the half widths of functions of the parameters whose gradients are the rows of `gradient`."""
    return np.asarray(spread * np.sqrt(np.maximum(np.einsum("ki,ij,kj->k", gradient, covariance, gradient), 0.0)))


def _from_capacitance(
    q: Floats, covariance: Floats, spread: float, largest: float, scale: float, held: float, coupling: float
) -> tuple[tuple[float, float, float], tuple[Estimate, ...]]:
    offset = len(q) == 2
    values = scale * q / np.array([largest, 1.0])[: len(q)]
    widths = _half_widths(covariance, np.diag(scale / np.array([largest, 1.0])[: len(q)]), spread)
    eps, stray = float(values[0]), float(values[1]) if offset else scale * held
    return (eps, stray, coupling), (
        Estimate("permittivity", "F/m", eps, float(widths[0]), True),
        Estimate("stray_capacitance", "F", stray, float(widths[1]) if offset else 0.0, offset),
        Estimate("coupling", "F", coupling, 0.0, False),
    )


def _from_delta_output(
    q: Floats,
    covariance: Floats,
    spread: float,
    largest: float,
    held: float,
    coupling: float,
    absolute: tuple[float, float] | None,
) -> tuple[tuple[float, float, float], tuple[Estimate, ...]]:
    """Return eps, C_0, C_couple and the estimates; with z_a = kappa I_a + ratio, C_couple = C_a / z_a."""
    offset = len(q) == 2
    kappa, ratio = float(q[0]) / largest, float(q[1]) if offset else held
    d_kappa, d_ratio = np.array([1.0 / largest, 0.0]), np.array([0.0, 1.0])
    d_coupling = np.zeros(2)
    if absolute is not None:
        seen = kappa * absolute[0] + ratio
        if seen <= 0.0:
            raise CalibrationError("the sensor senses nothing where the absolute capacitance was measured")
        coupling = absolute[1] / seen
        d_coupling = -coupling / seen * (absolute[0] * d_kappa + (d_ratio if offset else 0.0))
    gradient = np.array(
        [d_kappa, d_ratio, coupling * d_kappa + kappa * d_coupling, coupling * d_ratio + ratio * d_coupling, d_coupling]
    )
    widths = [float(width) for width in _half_widths(covariance, gradient[:, : len(q)], spread)]
    if not offset:
        widths[1] = widths[3] = 0.0
    if absolute is None:
        widths[4] = 0.0
    eps, stray = coupling * kappa, coupling * ratio
    return (eps, stray, coupling), (
        Estimate("permittivity / coupling", "1/m", kappa, widths[0], True),
        Estimate("stray_capacitance / coupling", "1", ratio, widths[1], offset),
        Estimate("permittivity", "F/m", eps, widths[2], True),
        Estimate("stray_capacitance", "F", stray, widths[3], offset),
        Estimate("coupling", "F", coupling, widths[4], absolute is not None),
    )
