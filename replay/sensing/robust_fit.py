"""Robust least squares in the two forms that a calibration needs, with the covariance of the result."""

from __future__ import annotations

from typing import Any

import numpy as np

from replay.errors import CalibrationError
from replay.numerics.arrays import Floats

SMALLEST_INDEPENDENCE = 1e-4
"""Two parameters whose effects on the curve agree to this part of the larger are not told apart: the model's integrals
are only good to `rtol` (1e-6 when not stated), and no measurement is better than 0.01 %."""

_EXACT = 1e-9
"""Residuals below this part of the curve's size are rounding: there is nothing to be robust against."""

_LOWEST = -0.49
"""Lower bound of a divided fit's parameters, which keeps z away from the pole at -1."""

_MAD_TO_SIGMA = 1.4826
"""Standard deviation of a normal distribution over its median absolute deviation."""


def robust_fit(design: Floats, held: float, y: Floats, divided: bool) -> tuple[Floats, Floats]:
    """Return the parameters and their covariance of y = z, or y = z / (1 + z) if divided, with z = design q + held.

    With residuals r at scale s, psi(r) = r / sqrt(1 + (r/s)^2) is the derivative of soft_l1, and the covariance of an
    M-estimate is  sum psi^2 / (n - p) / mean(psi')^2 (J^T J)^-1.  The scale is taken from the plain least-squares fit.
    A wrong value is outvoted by the other points only where they say much of the same parameter: at the one point where
    a curve is steepest no residual gives it away.

    Args:
        design: (n, p), columns of size 1, n >= p.
        held: part of z that is not fitted.
        y: (n,) of size 1, below 1 if divided.
        divided: see above.

    Returns:
        q (p,) and its covariance (p, p), NaN when n = p.

    Raises:
        CalibrationError: the columns' effects on y are not independent.

    Source: P. J. Huber, Robust Statistics (1981), section 7.6, for the covariance.
    """
    from scipy.optimize import least_squares

    n, p = design.shape

    def residuals(q: Floats) -> Floats:
        z = design @ q + held
        return np.asarray((z / (1.0 + z) if divided else z) - y)

    def jacobian(q: Floats) -> Floats:
        return np.asarray(design / (1.0 + design @ q + held)[:, None] ** 2 if divided else design)

    lowest = np.full(p, _LOWEST if divided else -np.inf)
    start = np.linalg.lstsq(design, (y / (1.0 - y) if divided else y) - held, rcond=None)[0]
    start = np.maximum(start, lowest + 1e-3)
    _check_independence(jacobian(start))
    settings: dict[str, Any] = {
        "bounds": (lowest, np.inf),
        "xtol": 1e-15,
        "ftol": 1e-15,
        "gtol": 1e-15,
        "x_scale": "jac",
        "max_nfev": 1000,
    }
    q = least_squares(residuals, start, jacobian, **settings).x
    s = _MAD_TO_SIGMA * float(np.median(np.abs(residuals(q))))
    psi, slope = residuals(q), 1.0
    if s > _EXACT and n > p:
        q = least_squares(residuals, q, jacobian, loss="soft_l1", f_scale=s, **settings).x
        weight = 1.0 / np.sqrt(1.0 + (residuals(q) / s) ** 2)
        psi, slope = residuals(q) * weight, float(np.mean(weight**3))
    if n == p:
        return q, np.full((p, p), np.nan)
    J = jacobian(q)
    return q, np.asarray(np.sum(psi**2) / (n - p) / slope**2 * np.linalg.inv(J.T @ J))


def _check_independence(J: Floats) -> None:
    if J.shape[1] == 1:
        return
    singular = np.linalg.svd(J / np.sqrt(np.sum(J**2, axis=0)), compute_uv=False)
    if singular[-1] < SMALLEST_INDEPENDENCE * singular[0]:
        raise CalibrationError(
            "the curve cannot tell the offset from the permittivity: what the model senses is the same at all points;"
            " measure where it changes, or fit without an offset"
        )
