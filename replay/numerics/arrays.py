"""Types of arrays, by what they hold; the shape of each is told where it is taken or returned."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]
Wide = NDArray[np.longdouble]
Integers = NDArray[np.int64]
ShortIntegers = NDArray[np.int32]
Bytes = NDArray[np.uint8]
Flags = NDArray[np.bool_]
Column = NDArray[Any]
"""Values of one quantity in each frame, of whatever type."""
