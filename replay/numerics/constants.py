"""Numbers that more than one room needs by name."""

import math
from typing import Final

EPSILON: Final = 2.0**-52
"""Relative distance of 1 and the next double; numbers are rounded by half of it."""

FULL_TURN: Final = 2.0 * math.pi
"""[rad]"""

SECOND: Final = 10**9
"""[ns]"""
