"""How many cases a test takes: all of them, or a few where kernels are plain Python and a thousand times slower."""

from numba.core import config

COMPILED = not config.DISABLE_JIT
"""Whether kernels are compiled; NUMBA_DISABLE_JIT=1 runs them as they stand there, for a debugger."""
_SHARE = 50


def cases(count: int) -> int:
    """Return a number of cases: `count`, or a share of it that a plain interpreter can do."""
    return count if COMPILED else max(1, count // _SHARE)
