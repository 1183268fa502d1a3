"""Arguments of public functions as float64: what is no number of the right shape is refused in one clear line."""

from __future__ import annotations

import numbers
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike

from replay.errors import InvalidValue
from replay.numerics.arrays import Floats


def as_floats(name: str, value: ArrayLike, shape: tuple[int | None, ...]) -> Floats:
    """Return an argument as a contiguous float64 array; whether its values are finite is the caller's rule.

    Args:
        name: of the argument, for messages.
        value: an array or nested sequence of integers or floats; an empty one is (0, ...) where the shape allows it.
        shape: the shape it must have; None stands for any length.

    Raises:
        InvalidValue: it holds something else than real numbers (text, complex numbers, truth values, objects, rows of
            different lengths), or it has another shape.
    """
    if _fits(value, shape):
        return cast(Floats, value)
    wanted = (
        "(" + ", ".join("n" if length is None else str(length) for length in shape) + ("," * (len(shape) == 1)) + ")"
    )
    try:
        array = np.asarray(value)
    except (TypeError, ValueError):
        array = np.empty(0, dtype=object)
    if array.dtype.kind not in "iuf" and not (array.size == 0 and array.dtype.kind == "O" and array.ndim == len(shape)):
        raise InvalidValue(name, _shown(value), f"must be real numbers of shape {wanted}")
    if array.size == 0 and array.ndim == 1 and shape[0] is None:
        array = array.reshape(0, *(length or 0 for length in shape[1:]))
    if array.ndim != len(shape) or any(want not in (None, got) for want, got in zip(shape, array.shape, strict=True)):
        raise InvalidValue(name, f"array of shape {array.shape}", f"must have shape {wanted}")
    return np.ascontiguousarray(array, dtype=np.float64)


def _fits(value: ArrayLike, shape: tuple[int | None, ...]) -> bool:
    """Return whether a value is such an array already, as in a loop over many calls."""
    if type(value) is not np.ndarray or value.dtype != np.float64 or value.ndim != len(shape):
        return False
    return value.flags.c_contiguous and all(map(_as_wanted, shape, value.shape))


def _as_wanted(want: int | None, got: int) -> bool:
    return want is None or want == got


def as_float(name: str, value: Any) -> float:
    """Return an argument that must be one real number, NaN and infinities included; InvalidValue for anything else."""
    if isinstance(value, np.ndarray) and value.ndim == 0:
        value = value[()]
    if isinstance(value, bool | np.bool_) or not isinstance(value, numbers.Real):
        raise InvalidValue(name, _shown(value), "must be a real number")
    try:
        return float(value)
    except OverflowError:
        raise InvalidValue(name, _shown(value), "is too large for a double") from None


def _shown(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 80 else f"{text[:77]}..."
