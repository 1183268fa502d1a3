"""How much is tested: all, or a part where NUMBA_DISABLE_JIT=1 makes kernels plain Python, a thousand times slower.

This is the one switch: `cases` for loops and Hypothesis, `few_of_many` for parametrised tests of rooms with kernels,
and the marker `compiled` for what is about compiling or needs bodies of thousands of triangles.
"""

from collections.abc import Sequence

from numba.core import config

COMPILED = not config.DISABLE_JIT
"""Whether kernels are compiled; NUMBA_DISABLE_JIT=1 runs them as they stand there, for a debugger."""
_SHARE = 50
_MOST = 6
KERNEL_ROOMS = ("numerics", "geometry", "kinematics", "collision", "sensing")


def cases(count: int) -> int:
    """Return a number of cases: `count`, or a share of it that a plain interpreter can do."""
    return count if COMPILED else max(1, count // _SHARE)


def few_of_many(names: Sequence[str]) -> list[bool]:
    """Return which tests are kept, given the function that each one is a case of: of many cases, some evenly spread."""
    total = {name: names.count(name) for name in set(names)}
    seen = dict.fromkeys(total, 0)
    kept = []
    for name in names:
        at, most = seen[name], min(total[name], _MOST)
        seen[name] += 1
        kept.append(at * most // total[name] != (at - 1) * most // total[name])
    return kept
