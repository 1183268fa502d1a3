"""Two columns of numbers against a tolerance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from replay.comparison.rules import Tolerance
from replay.numerics.arrays import Column, Flags, Floats


@dataclass(frozen=True, eq=False)
class Errors:
    """What F frames of a signal say against its tolerance.

    Attributes:
        differs: (F,) not equal, with or without the tolerance's leave.
        outside: (F,) not within the tolerance.
        error: (F,) |a - b|, or the angle between rotations; NaN where it is not a finite number.
        relative: (F,) error over the larger magnitude; NaN where it has no meaning.
        nan: (F,) outside because of NaN.
        infinite: (F,) outside because of an infinity.
    """

    differs: Flags
    outside: Flags
    error: Floats
    relative: Floats
    nan: Flags
    infinite: Flags


def compare_numbers(a: Column, b: Column, tolerance: Tolerance) -> Errors:
    """Compare two columns (F,) of numbers; see `Tolerance` for what is equal."""
    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
        error = np.abs(a - b)
        scale = np.maximum(np.abs(a), np.abs(b))
        relative = error / scale
        near = (error <= np.maximum(tolerance.abs, tolerance.rel * scale)) | (not tolerance.of_frames)
    equal = a == b
    finite = np.isfinite(a) & np.isfinite(b)
    inside = equal | (near & finite)
    if tolerance.zero == "signed":
        opposite = (a == 0) & (b == 0) & (np.signbit(a) != np.signbit(b))
        equal &= ~opposite
        inside &= ~opposite
    nan_a, nan_b = np.isnan(a), np.isnan(b)
    if tolerance.nan == "equal":
        both = nan_a & nan_b
        equal |= both
        inside |= both
    outside = ~inside
    return Errors(
        differs=~equal,
        outside=outside,
        error=np.where(finite, error, np.nan),
        relative=np.where(finite & (scale > 0), relative, np.nan),
        nan=outside & (nan_a | nan_b),
        infinite=outside & ~finite & ~nan_a & ~nan_b,
    )


def root_mean_square(error: Floats) -> float:
    """Return the root mean square of the errors that are numbers; 0 for none. Squares neither overflow nor vanish."""
    known = error[np.isfinite(error)]
    largest = float(known.max(initial=0.0))
    return largest * float(np.sqrt(np.mean((known / largest) ** 2))) if largest > 0.0 else 0.0


def compare_rotations(a: Column, b: Column, tolerance: Tolerance) -> Errors:
    """Compare two columns (F, 4) of unit quaternions xyzw by the angle between them [rad].

    q and -q are the same rotation and equal. Any other difference of the components is one, even where it is too small
    or along a direction that gives an angle of 0.

    The angle is 2·atan2(|v|, |w|) of conj(a)·b, which keeps its digits near 0, where an arc cosine loses half of them.
    """
    with np.errstate(invalid="ignore", over="ignore"):
        equal = (a == b).all(axis=1) | (a == -b).all(axis=1)
        vector = a[:, 3:] * b[:, :3] - b[:, 3:] * a[:, :3] - np.cross(a[:, :3], b[:, :3])
        angle = 2.0 * np.arctan2(np.sqrt((vector * vector).sum(axis=1)), np.abs((a * b).sum(axis=1)))
        inside = (
            equal | ((angle <= tolerance.abs) & (tolerance.abs > 0)) | ((not tolerance.of_frames) & np.isfinite(angle))
        )
    nan_a, nan_b = np.isnan(a).any(axis=1), np.isnan(b).any(axis=1)
    if tolerance.nan == "equal":
        both = nan_a & nan_b
        equal |= both
        inside |= both
    else:
        equal &= ~(nan_a | nan_b)
    outside = ~inside
    none = np.full(len(angle), np.nan)
    finite = np.isfinite(angle)
    return Errors(
        differs=~equal,
        outside=outside,
        error=np.where(finite, angle, np.nan),
        relative=none,
        nan=outside & (nan_a | nan_b),
        infinite=outside & ~finite & ~nan_a & ~nan_b,
    )
