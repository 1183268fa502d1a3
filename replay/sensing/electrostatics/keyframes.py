"""Readings of many frames from few that are solved: splines between keys, with an estimate of what that costs.

A diagonal entry of the increase grows by orders of magnitude while a body comes near, and so does

    E_k = sum over points j of the bodies, with area A_j,  of A_j phi_k(x_j)^2 / max(d_j, 3 mm),

d_j the distance to the unit; their quotient changes little, and mostly as a power of E_k. So what is interpolated is
ln(dC_kk / E_k), with ln E_k, which is known in every frame, as its guide (`spline.guided`). Entries beside the diagonal
and shares of shapes are interpolated over the root of the product of their diagonals, guided by the mean of their ln E.

A motion falls into pieces, at stops, jumps and kinks of the script, and where what touches or is resolved changes. Each
begins with five keys. The frame in the middle between two keys is solved and compared with the prediction of all keys
so far: while it is missed by more than the tolerance, both halves are asked in the next round. What the last question
between two keys missed is the error in time there. How far a frame is along a piece is its share of the frames, and how
much ln E has changed, so that keys are dense where a body comes near. Pieces know nothing of each other, nor of other
blocks.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from replay.numerics.arrays import Flags, Floats, Integers
from replay.sensing.electrostatics.bem import BemReading
from replay.sensing.electrostatics.spline import guided

Solve = Callable[[int], BemReading | None]

_FIRST_KEYS = 5
_NEARBY = 4
"""Frames on either side of a kink of which one is calm: as many kinks in a row are told apart from a bend."""

_EVEN = 2.0
"""Change of ln E that counts as much as all frames of a piece."""

_FLOOR = 5e-3
"""Share of the largest entry below which others need not be followed."""

_SMALLEST = 1e-12
"""Share of the largest entry that stands for 0 in a logarithm."""


@dataclass(frozen=True, eq=False)
class Followed:
    """Readings of n frames, some of them solved.

    Attributes:
        increase, error: (n, k, k) [m]; the error in space and time.
        shares: (n, shapes, k, k) [m].
        solved: (n,) whether the frame was solved.
    """

    increase: Floats
    error: Floats
    shares: Floats
    solved: Flags


def pieces(points: Floats, state: Integers) -> list[tuple[int, int]]:
    """Return where motions begin and end: frames (first, last), each frame in one or, at a kink, in two.

    Args:
        points: (n, m, 3) [m], points of the bodies in the unit's frame.
        state: (n,) what is constant within a piece.
    """
    n = len(points)
    step = np.abs(np.diff(points, axis=0)).reshape(n - 1, -1).max(axis=1) if n > 1 else np.zeros(0)
    cut = state[1:] != state[:-1]
    kinks = _kinks(points, step)
    ends = []
    for i in range(n - 1):
        around = max(step[i - 1] if i else 0.0, step[i + 1] if i + 2 < n else 0.0)
        jumps = n > 2 and step[i] > 5.0 * around and step[i] > 0.0
        # a kink between two frames bends the motion at both
        if cut[i] or jumps or (kinks[i] and kinks[i + 1]):
            ends.append((i, i + 1))
        elif i > 0 and ((kinks[i] and not kinks[i - 1]) or (step[i] == 0.0) != (step[i - 1] == 0.0)):
            ends.append((i, i))
    first, result = 0, []
    for last, following in ends:
        result.append((first, last))
        first = following
    return [*result, (first, n - 1)]


def _kinks(points: Floats, step: Floats) -> Flags:
    """Return at which frames (n,) a motion bends more than at some frame nearby on either side."""
    n = len(points)
    result = np.zeros(n, np.bool_)
    if n > 2:
        bend = np.zeros(n + 2 * _NEARBY)
        bend[_NEARBY + 1 : n + _NEARBY - 1] = np.abs(np.diff(points, n=2, axis=0)).reshape(n - 2, -1).max(axis=1)
        window = np.lib.stride_tricks.sliding_window_view(bend, _NEARBY).min(axis=1)
        around, own = np.maximum(window[:n], window[_NEARBY + 1 :]), bend[_NEARBY : n + _NEARBY]
        result[1:-1] = (own > 3.0 * around)[1:-1] & (own[1:-1] > 0.02 * np.maximum(step[:-1], step[1:]))
    return result


def between_keys(solve: Solve, proxy: Floats, parts: list[tuple[int, int]], tolerance: float) -> Followed | None:
    """Return the readings of all frames; None where a frame has none, so that each must be solved.

    Args:
        solve: solves a frame.
        proxy: (n, k) E of each frame and electrode, > 0.
        parts: see `pieces`.
        tolerance: largest share of a diagonal entry that a prediction may miss.
    """
    known: dict[int, BemReading] = {}

    def reading(frame: int) -> BemReading | None:
        if frame not in known:
            found = solve(frame)
            if found is not None:
                known[frame] = found
        return known.get(frame)

    found = [_Piece(reading, proxy, first, last).followed(tolerance) for first, last in parts]
    shape = next((piece for piece in found if piece is not None), None)
    if shape is None or any(piece is None for piece in found):
        return None
    n = len(proxy)
    increase = np.empty((n, *shape.increase.shape[1:]))
    error, shares = increase.copy(), np.empty((n, *shape.shares.shape[1:]))
    solved = np.zeros(n, np.bool_)
    for (first, last), piece in zip(parts, found, strict=True):
        assert piece is not None
        at = slice(first, last + 1)
        increase[at], error[at], shares[at] = piece.increase, piece.error, piece.shares
        solved[at] |= piece.solved
    return Followed(increase, error, shares, solved)


class _Piece:
    """Frames first .. last of one motion."""

    def __init__(self, reading: Solve, proxy: Floats, first: int, last: int) -> None:
        self._reading = reading
        self._proxy = proxy[first : last + 1]
        self._guide = _each(math.log, self._proxy)
        self._first = first
        self._count = last - first + 1
        change = np.abs(np.diff(self._guide, axis=0)).max(axis=1)
        self._along = np.concatenate([[0.0], np.cumsum(change + _EVEN / max(self._count - 1, 1))])
        self._keys: dict[int, BemReading] = {}

    def followed(self, tolerance: float) -> Followed | None:
        """Return the readings of the piece."""
        places = np.linspace(0.0, self._along[-1], _FIRST_KEYS)
        start = np.unique(np.abs(self._along[:, None] - places).argmin(axis=0)).tolist()
        if not self._solve(start):
            return None
        waiting = [(a, b) for a, b in pairwise(start) if b - a > 1]
        missed = np.zeros(self._count)
        while waiting:
            asked = [self._middle(a, b) for a, b in waiting]
            predicted = self._predicted(np.array(asked, dtype=np.float64))[0]
            if not self._solve(asked):
                return None
            following = []
            for (a, b), middle, guess in zip(waiting, asked, predicted, strict=True):
                miss = self._miss(guess, self._keys[middle].increase)
                missed[a + 1 : b] = miss
                missed[middle] = 0.0
                if miss > tolerance:
                    following += [part for part in ((a, middle), (middle, b)) if part[1] - part[0] > 1]
            waiting = following
        increase, error, shares = self._predicted(np.arange(self._count, dtype=np.float64))
        scale = np.sqrt(np.einsum("nkk->nk", increase))
        error = error + missed[:, None, None] * scale[:, :, None] * scale[:, None, :]
        solved = np.zeros(self._count, np.bool_)
        for key, value in self._keys.items():
            increase[key], error[key], shares[key], solved[key] = value.increase, value.error, value.shares, True
        return Followed(increase, error, shares, solved)

    def _middle(self, first: int, last: int) -> int:
        """Return the frame between two others that is as far along from both as can be."""
        along = self._along[first + 1 : last]
        return first + 1 + int(np.abs(2.0 * along - self._along[first] - self._along[last]).argmin())

    def _solve(self, frames: list[int]) -> bool:
        for frame in frames:
            found = self._reading(self._first + frame)
            if found is None:
                return False
            self._keys[frame] = found
        return True

    def _miss(self, guess: Floats, value: Floats) -> float:
        """Return by how much a prediction is missed, as a share of what may be missed of the worst entry."""
        diagonal = np.abs(value.diagonal())
        allowed = np.sqrt(diagonal + _FLOOR * diagonal.max())
        return float(np.max(np.abs(guess - value) / np.maximum(allowed[:, None] * allowed, 1e-300)))

    def _predicted(self, at: Floats) -> tuple[Floats, Floats, Floats]:
        """Return increases, errors and shares at frames of the piece."""
        keys = sorted(self._keys)
        readings = [self._keys[key] for key in keys]
        value = np.stack([each.increase for each in readings])
        m, k = value.shape[:2]
        diagonal = np.einsum("nkk->nk", value)
        diagonal = np.maximum(diagonal, np.maximum(_SMALLEST * diagonal.max(axis=1, keepdims=True), 1e-300))
        root = np.sqrt(diagonal)
        product = root[:, :, None] * root[:, None, :]
        ratio = _each(math.log, diagonal / self._proxy[keys])
        share = np.stack([each.shares for each in readings]) / product[:, None]
        wrong = np.stack([each.error for each in readings]) / product
        beside = (value / product).reshape(m, -1)
        columns = np.concatenate([ratio, beside, share.reshape(m, -1)], axis=1)
        places, frames = np.array(keys, dtype=np.float64), at.astype(int)
        pairs = (0.5 * (self._guide[:, :, None] + self._guide[:, None, :])).reshape(self._count, -1)
        guide = np.concatenate([self._guide, np.tile(pairs, 1 + share.shape[1])], axis=1)
        curve = guided(places, columns, at, guide[keys], guide[frames])
        root = np.sqrt(_each(math.exp, curve[:, :k]) * self._proxy[frames])
        product = root[:, :, None] * root[:, None, :]
        increase = curve[:, k : k + k * k].reshape(-1, k, k)
        increase[:, np.arange(k), np.arange(k)] = 1.0
        shares = curve[:, k + k * k :].reshape(len(at), -1, k, k)
        flat = wrong.reshape(m, -1)
        error = np.stack([np.interp(at, places, column) for column in flat.T], axis=1).reshape(-1, k, k)
        return increase * product, error * product, shares * product[:, None]


def _each(function: Callable[[float], float], values: Floats) -> Floats:
    """Return a function of each value by the C library, which rounds alike whatever the processor's vectors."""
    return np.array([function(value) for value in values.ravel().tolist()]).reshape(values.shape)
