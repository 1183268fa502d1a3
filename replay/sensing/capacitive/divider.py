"""The voltage divider behind a plate: a known coupling capacitance in series with the one that is sensed."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from replay.errors import InvalidValue
from replay.numerics.arguments import as_float, as_floats


def output_voltage(capacitance: ArrayLike, *, coupling: float, supply: float = 2.5) -> NDArray[np.float64]:
    """Return V_out = C_couple / (C_couple + C) V_in.

    Args:
        capacitance: sensed capacitance C [F], any shape, >= 0; inf (a saturated plate) gives 0 V.
        coupling: C_couple [F], > 0.
        supply: V_in [V], finite.

    Returns:
        Output voltage [V], of the shape of `capacitance`.

    Raises:
        InvalidValue: an argument is outside the stated range, or NaN.

    Source: Huijgens 2015.
    """
    try:
        shape = np.shape(capacitance)
    except (TypeError, ValueError):
        shape = ()
    sensed = as_floats("capacitance", capacitance, shape).reshape(shape)
    coupling, supply = as_float("coupling", coupling), as_float("supply", supply)
    if np.isnan(sensed).any() or (sensed < 0.0).any():
        raise InvalidValue("capacitance", capacitance, "must be >= 0 F (inf when saturated)")
    if not (np.isfinite(coupling) and coupling > 0.0):
        raise InvalidValue("coupling", coupling, "must be finite and > 0 F")
    if not np.isfinite(supply):
        raise InvalidValue("supply", supply, "must be finite")
    return np.asarray(supply / (1.0 + sensed / coupling))
