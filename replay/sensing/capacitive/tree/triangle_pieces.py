"""Pieces of triangles in the plate's frame: their memory, and how one is cut by z = 0, by a border, or in four.

A piece is a row of a pool, laid out as a row of `Clusters.triangles`: its corners and its area, and which triangle it
is of. The last piece is replaced by what becomes of it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from replay.numerics.arrays import Floats, Integers
from replay.numerics.jit import inlined_kernel, leaf_kernel, record_like
from replay.numerics.triples import Triple
from replay.sensing.capacitive.exact import SCRATCH
from replay.sensing.capacitive.tree.registers import CORNERS, LANES, OWNER, PIECE_COLUMNS, SIZE

MOST_PIECES = 48
"""Pieces that may be made of a triangle before the closed form is called for, which then is cheaper."""

_POOL = LANES * (MOST_PIECES + 4)


class Pieces(NamedTuple):
    """Memory for up to LANES hard triangles, the owners, and their pieces; made once for all poses."""

    pool: Floats  # (_POOL, PIECE_COLUMNS) pieces to judge
    done: Floats  # (3, 2 LANES, PIECE_COLUMNS) pieces that are to be summed by 3, 7 and 16 points
    in_done: Integers  # (3,)
    rows: Integers  # (LANES,)
    totals: Floats  # (LANES,) sum of an owner's pieces [m]
    errors: Floats  # (LANES,) and their error bound [m]
    densities: Floats  # (LANES,) error that is allowed, over the area [1/m]
    made: Integers  # (LANES,) pieces made so far; above MOST_PIECES: given up
    triangles: Integers  # (LANES,) which triangles the owners are
    slow: Integers  # (LANES,) triangles that need the closed form
    triangle: Floats  # (3, 3) a triangle for the closed form
    scratch: Floats  # SCRATCH, of the closed form


def new_pieces() -> Pieces:
    """Return memory for hard triangles and pieces."""
    return Pieces(
        np.empty((_POOL, PIECE_COLUMNS)),
        np.empty((3, 2 * LANES, PIECE_COLUMNS)),
        np.empty(3, np.int64),
        np.empty(LANES, np.int64),
        np.empty(LANES),
        np.empty(LANES),
        np.empty(LANES),
        np.empty(LANES, np.int64),
        np.empty(LANES, np.int64),
        np.empty(LANES, np.int64),
        np.empty((3, 3)),
        np.empty(SCRATCH),
    )


PIECES_TYPE = record_like(new_pieces())


@inlined_kernel
def _corner(pool: Floats, row: int, corner: int) -> Triple:
    at = CORNERS + 3 * corner
    return pool[row, at], pool[row, at + 1], pool[row, at + 2]


@inlined_kernel
def write_piece(pool: Floats, row: int, a: Triple, b: Triple, c: Triple, area: float, owner: float) -> None:
    """Write a piece to a row."""
    for axis in range(3):
        pool[row, CORNERS + axis], pool[row, CORNERS + 3 + axis], pool[row, CORNERS + 6 + axis] = (
            a[axis],
            b[axis],
            c[axis],
        )
    pool[row, SIZE], pool[row, OWNER] = area, owner


@leaf_kernel
def cut(pool: Floats, size: int, axis: int, half: float) -> int:
    """Replace the last of `size` pieces by its parts on either side of a border at -half or half, across an axis.

    Across z only the parts above z = 0 are kept. Returns the new number of pieces.
    """
    last = size - 1
    p, q, s = pool[last, CORNERS + axis], pool[last, CORNERS + 3 + axis], pool[last, CORNERS + 6 + axis]
    border = 0.0 if axis == 2 else half
    if not min(p, q, s) < border < max(p, q, s):
        border = -border
    beyond_0, beyond_1, beyond_2 = p > border, q > border, s > border
    alone = 0 if beyond_1 == beyond_2 else (1 if beyond_0 == beyond_2 else 2)
    area, owner = pool[last, SIZE], pool[last, OWNER]
    a, b, c = _corner(pool, last, alone), _corner(pool, last, (alone + 1) % 3), _corner(pool, last, (alone + 2) % 3)
    on_a = p if alone == 0 else (q if alone == 1 else s)
    on_b = q if alone == 0 else (s if alone == 1 else p)
    on_c = s if alone == 0 else (p if alone == 1 else q)
    alone_beyond = on_a > border
    # sums of positive terms, so that distances which are positive keep their digits
    t, t_rest = (on_a - border) / (on_a - on_b), (border - on_b) / (on_a - on_b)
    w, w_rest = (on_a - border) / (on_a - on_c), (border - on_c) / (on_a - on_c)
    d = (t_rest * a[0] + t * b[0], t_rest * a[1] + t * b[1], t_rest * a[2] + t * b[2])
    e = (w_rest * a[0] + w * c[0], w_rest * a[1] + w * c[1], w_rest * a[2] + w * c[2])
    d = (border if axis == 0 else d[0], border if axis == 1 else d[1], border if axis == 2 else d[2])
    e = (border if axis == 0 else e[0], border if axis == 1 else e[1], border if axis == 2 else e[2])
    size = last
    if axis != 2 or alone_beyond:
        write_piece(pool, size, a, d, e, area * t * w, owner)
        size += 1
    if axis != 2 or not alone_beyond:
        write_piece(pool, size, b, c, e, area * w_rest, owner)
        write_piece(pool, size + 1, b, e, d, area * w * t_rest, owner)
        size += 2
    return size


@leaf_kernel
def quarter(pool: Floats, size: int) -> int:
    """Replace the last of `size` pieces by four, cut from the middles of its edges; return the new number of pieces."""
    last = size - 1
    area, owner = 0.25 * pool[last, SIZE], pool[last, OWNER]
    a, b, c = _corner(pool, last, 0), _corner(pool, last, 1), _corner(pool, last, 2)
    d = (0.5 * (b[0] + c[0]), 0.5 * (b[1] + c[1]), 0.5 * (b[2] + c[2]))
    e = (0.5 * (c[0] + a[0]), 0.5 * (c[1] + a[1]), 0.5 * (c[2] + a[2]))
    f = (0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1]), 0.5 * (a[2] + b[2]))
    write_piece(pool, last, a, f, e, area, owner)
    write_piece(pool, last + 1, f, b, d, area, owner)
    write_piece(pool, last + 2, e, d, c, area, owner)
    write_piece(pool, last + 3, d, e, f, area, owner)
    return size + 3
