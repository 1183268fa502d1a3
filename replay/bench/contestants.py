"""What answers the hard questions of `stability`: each by name, given plain values, returning plain values.

A contestant runs in a process of its own, so that a crash or a hang is an outcome and not the end of the run; all are
functions (or partial ones) that can be sent there.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Any, Literal

import numpy as np

from replay.bench.engines import OURS_CHECKED, PEERS, Body, Engine

Answer = Callable[[dict[str, Any]], list[float]]


def contestants(subject: str) -> dict[str, tuple[str, Answer]]:
    """Return package needed ("" for none) and function by name, for "pairs", "cones", "plates" or "boxes"."""
    return {"pairs": _PAIRS, "cones": _CONES, "plates": _PLATES, "boxes": _BOXES}[subject]


def _pair(engine: Engine, question: dict[str, Any]) -> list[float]:
    """Return [contact 0 or 1, distance]."""
    a, b = Body(*question["a"]), Body(*question["b"])
    queries = engine.queries(a, b, question["T_world_a"][None], question["T_world_b"][None])
    return [float(queries.hits()[0]), float(queries.distances()[0])]


def _exact_cone(question: dict[str, Any]) -> list[float]:
    from replay.sensing.distance import closest_in_cone

    hit = closest_in_cone(question["triangles"], question["apex"], question["axis"], question["aperture"])
    return [hit.distance if hit.detected else math.inf]


def _model_cone(method: str, engine: str, question: dict[str, Any]) -> list[float]:
    from replay.bench.distance import read_once

    return [read_once(method, question, engine=engine)]


def _plate(method: str, question: dict[str, Any]) -> list[float]:
    from replay.sensing.capacitive import plate_integral

    triangles = np.array([question["triangle"]])
    return [float(plate_integral(triangles, question["half_size"], side=question["side"], method=method)[0])]


def _plate_tree(question: dict[str, Any]) -> list[float]:
    from replay.geometry.tree import triangle_tree
    from replay.sensing.capacitive.tree.clusters import make_clusters
    from replay.sensing.capacitive.tree.tree_sum import COUNTS, sum_tree

    triangles = np.array([question["triangle"]])
    tree = triangle_tree(triangles)
    half, both = np.array([question["half_size"]]), question["side"] == "both"
    here = np.identity(4)[None, None]
    clusters, counts = make_clusters(triangles, tree), np.zeros(COUNTS, dtype=np.int64)
    return [float(sum_tree(clusters, here, np.zeros(len(here)), half, both, False, 1e-6, counts)[0][0, 0])]


def _obb(method: Literal["triangles", "vertices"], question: dict[str, Any]) -> list[float]:
    from replay.geometry.bounds import fit_obb

    box = fit_obb(question["points"], method=method)
    return [*box.center, *box.half_widths, *box.axes.ravel()]


def _eigenvectors(question: dict[str, Any]) -> list[float]:
    """The textbook box: axes of the vertices' covariance as a general eigen-solver gives them."""
    points = question["points"]
    axes = np.real(np.linalg.eig(np.cov(points.T))[1]).T
    along = points @ axes.T
    low, high = along.min(axis=0), along.max(axis=0)
    return [*(0.5 * (low + high) @ axes), *(0.5 * (high - low)), *axes.ravel()]


def _trimesh(question: dict[str, Any]) -> list[float]:
    import trimesh

    fit: Any = trimesh.bounds.oriented_bounds
    to_origin, extents = fit(question["points"])
    back = np.linalg.inv(to_origin)
    return [*back[:3, 3], *(0.5 * extents), *back[:3, :3].T.ravel()]


_PAIRS: dict[str, tuple[str, Answer]] = {
    "replay": ("", partial(_pair, OURS_CHECKED)),
    **{engine.name: (engine.package, partial(_pair, engine)) for engine in PEERS},
}
_CONES: dict[str, tuple[str, Answer]] = {
    "replay": ("", _exact_cone),
    "thesis": ("", partial(_model_cone, "thesis", "own")),
    "own, 1000 rays": ("", partial(_model_cone, "rays", "own")),
    "embree, 1000 rays": ("embreex", partial(_model_cone, "rays", "embree")),
}
_PLATES: dict[str, tuple[str, Answer]] = {
    "replay": ("", partial(_plate, "exact")),
    "replay, tree rtol 1e-6": ("", _plate_tree),
    "thesis, midpoint n=4": ("", partial(_plate, "midpoint")),
}
_BOXES: dict[str, tuple[str, Answer]] = {
    "replay": ("", partial(_obb, "triangles")),
    "replay, obb_vertices": ("", partial(_obb, "vertices")),
    "covariance of vertices": ("", _eigenvectors),
    "trimesh": ("trimesh", _trimesh),
}
