"""Pairs of convex bodies on which collision engines go wrong, family by family, with the right answer beside each.

Truth is computed from the rounded vertices and poses (see `truth.signed_distance`), never from the intended gap.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from replay.bench.engines import Body
from replay.bench.inputs import box, rotations
from replay.bench.truth import placed, signed_distance
from replay.numerics import transforms
from replay.numerics.arrays import Floats

UNDETERMINED = 1e-12
"""Nearer to touching than this, as part of the scene's size, either boolean is right."""


@dataclass(frozen=True, eq=False)
class HardPair:
    """One question and its answer.

    Attributes:
        family: what is hard about it.
        a, b: the bodies.
        T_world_a, T_world_b: (4, 4) their poses.
        distance: [m]; 0 where they meet.
        meets: whether they meet; None where rounding decides.
        size: of both bodies and the way between them [m]; errors are relative to it.
    """

    family: str
    a: Body
    b: Body
    T_world_a: Floats
    T_world_b: Floats
    distance: float
    meets: bool | None
    size: float


def hard_pairs(count: int, *, seed: int = 3) -> list[HardPair]:
    """Return `count` pairs of every family."""
    pairs = []
    for number, (family, make) in enumerate(FAMILIES.items()):
        rng = np.random.default_rng([seed, number])
        for k in range(count):
            pairs.append(_answered(family, *make(rng, k)))
    return pairs


Question = tuple[Body, Body, Floats, Floats]


def _answered(family: str, a: Body, b: Body, T_world_a: Floats, T_world_b: Floats) -> HardPair:
    # about a's origin, so that extended precision is spent on the bodies and not on their place in the world
    origin = np.zeros((4, 4), dtype=np.longdouble)
    origin[:3, 3] = T_world_a[:3, 3]
    first, second = (
        placed(body.vertices, T.astype(np.longdouble) - origin) for body, T in ((a, T_world_a), (b, T_world_b))
    )
    signed = signed_distance(first, second)
    way = float(np.abs(T_world_b[:3, 3] - T_world_a[:3, 3]).max())
    size = float(np.abs(a.vertices).max() + np.abs(b.vertices).max()) + way
    meets = None if abs(signed) <= UNDETERMINED * size else signed < 0.0
    return HardPair(family, a, b, T_world_a, T_world_b, max(signed, 0.0), meets, size)


def _cuboid(size: tuple[float, float, float]) -> Body:
    return Body(box(size), size)


def _sizes(rng: np.random.Generator) -> tuple[float, float, float]:
    x, y, z = np.exp(rng.uniform(-1.5, 0.5, 3)).tolist()
    return x, y, z


def _moved(rng: np.random.Generator, T_a_b: Floats, reach: float = 1.0) -> tuple[Floats, Floats]:
    T_world_a = rotations(rng, 1)[0]
    T_world_a[:3, 3] = reach * rng.normal(size=3)
    return T_world_a, transforms.compose(T_world_a, T_a_b)


def _gap(k: int) -> float:
    """Return +-1e-1, +-1e-2, .. +-1e-16, over and over."""
    return (1.0 if k % 2 == 0 else -1.0) * 10.0 ** -(1 + (k // 2) % 16)


def _face_to_face(rng: np.random.Generator, k: int) -> Question:
    size_a, size_b = _sizes(rng), _sizes(rng)
    T = transforms.from_axis_angle(np.array([0.0, 0.0, 1.0]), rng.uniform(0, 6, 1))[0]
    T[:3, 3] = [*(0.3 * rng.uniform(-1, 1, 2)), 0.5 * (size_a[2] + size_b[2]) + _gap(k)]
    return _cuboid(size_a), _cuboid(size_b), *_moved(rng, T)


def _edge_to_edge(rng: np.random.Generator, k: int) -> Question:
    size_a, size_b = _sizes(rng), _sizes(rng)
    # a's edge along x and b's along y, both turned by 45 deg so that edges face each other along z
    root = np.sqrt(0.5)
    T_z_a = transforms.from_axis_angle(np.array([1.0, 0.0, 0.0]), np.array([np.pi / 4]))[0]
    T_z_b = transforms.from_axis_angle(np.array([0.0, 1.0, 0.0]), np.array([np.pi / 4]))[0]
    size_a = (size_a[0], size_a[1], size_a[1])
    size_b = (size_b[0], size_b[1], size_b[0])
    T_z_b[:3, 3] = [0.0, 0.0, root * (size_a[1] + size_b[0]) + _gap(k)]
    return _cuboid(size_a), _cuboid(size_b), *_moved(rng, transforms.compose(transforms.invert(T_z_a), T_z_b))


def _corner_to_face(rng: np.random.Generator, k: int) -> Question:
    size_a, size_b = _sizes(rng), _sizes(rng)
    T = rotations(rng, 1)[0]
    lowest = float((box(size_b) @ T[:3, :3].T)[:, 2].min())
    T[:3, 3] = [*(0.2 * rng.uniform(-1, 1, 2)), 0.5 * size_a[2] - lowest + _gap(k)]
    return _cuboid(size_a), _cuboid(size_b), *_moved(rng, T)


def _touching(rng: np.random.Generator, k: int) -> Question:
    """Bodies that touch exactly, without any rounding: face on face, edge on edge or corner on corner."""
    size_a, size_b = ((float(x), float(y), float(z)) for x, y, z in rng.integers(1, 64, (2, 3)) / 32.0)
    T = transforms.identity()
    T[:3, 3] = [0.5 * (x + y) if axis <= k % 3 else 0.0 for axis, (x, y) in enumerate(zip(size_a, size_b, strict=True))]
    return _cuboid(size_a), _cuboid(size_b), transforms.identity(), T


def _nearly_parallel(rng: np.random.Generator, k: int) -> Question:
    size_a, size_b = _sizes(rng), _sizes(rng)
    angle = 10.0 ** rng.uniform(-10, -3, 1)
    T = transforms.from_axis_angle(np.array([1.0, 0.0, 0.0]), angle)[0]
    T[:3, 3] = [*(0.3 * rng.uniform(-1, 1, 2)), 0.5 * (size_a[2] + size_b[2]) + _gap(k) * 1e-3]
    return _cuboid(size_a), _cuboid(size_b), *_moved(rng, T)


def _sliver(rng: np.random.Generator, k: int) -> Question:
    """Tetrahedra as thin as 1e-10 of their length, apart or through each other."""
    bodies = []
    for _ in range(2):
        points = rng.normal(size=(4, 3))
        weights = rng.dirichlet((1.0, 1.0, 1.0))
        inner = np.sum(weights[:, None] * points[:3], axis=0)
        points[3] = inner + 10.0 ** rng.uniform(-10, -2) * (points[3] - inner)
        bodies.append(Body(points))
    T = rotations(rng, 1)[0]
    T[:3, 3] = rng.normal(size=3) * (0.3 if k % 2 else 2.0)
    return bodies[0], bodies[1], *_moved(rng, T)


def _needle(rng: np.random.Generator, k: int) -> Question:
    """Boxes 1e3 to 1e7 times as long as thin."""
    sizes = [(1.0, 10.0 ** rng.uniform(-7, -3), 10.0 ** rng.uniform(-7, -3)) for _ in range(2)]
    T = rotations(rng, 1)[0]
    T[:3, 3] = (0.3 * rng.uniform(-1, 1, 3) * [1, 0, 0]) if k % 2 else 0.4 * rng.normal(size=3)
    return _cuboid(sizes[0]), _cuboid(sizes[1]), *_moved(rng, T)


def _sizes_apart(rng: np.random.Generator, k: int) -> Question:
    """A small body at a large one, 1e2 to 1e6 times its size."""
    ratio = 10.0 ** rng.uniform(2, 6)
    size = _sizes(rng)
    size_b = (size[0] / ratio, size[1] / ratio, size[2] / ratio)
    size_a = _sizes(rng)
    T = rotations(rng, 1)[0]
    lowest = float((box(size_b) @ T[:3, :3].T)[:, 2].min())
    T[:3, 3] = [*(0.2 * rng.uniform(-1, 1, 2)), 0.5 * size_a[2] - lowest + (1 if k % 2 else -0.3) / ratio]
    return _cuboid(size_a), _cuboid(size_b), *_moved(rng, T)


def _scaled(rng: np.random.Generator, k: int) -> Question:
    """Whole scenes from 1e-9 to 1e6 m across."""
    scale = 10.0 ** (-9 + k % 16)
    size_a, size_b = ((scale * x, scale * y, scale * z) for x, y, z in (_sizes(rng), _sizes(rng)))
    T = rotations(rng, 1)[0]
    lowest = float((box(size_b) @ T[:3, :3].T)[:, 2].min())
    T[:3, 3] = [0.0, 0.0, 0.5 * size_a[2] - lowest + scale * (0.01 if rng.uniform() < 0.5 else -0.01)]
    return _cuboid(size_a), _cuboid(size_b), *_moved(rng, T, scale)


def _offset(rng: np.random.Generator, k: int) -> Question:
    """Scenes up to 1e8 m away from the world's origin, with gaps and depths a hundred times what that rounds away."""
    reach = 10.0 ** (k % 9)
    size_a, size_b = _sizes(rng), _sizes(rng)
    T = rotations(rng, 1)[0]
    lowest = float((box(size_b) @ T[:3, :3].T)[:, 2].min())
    sign = 1.0 if rng.uniform() < 0.5 else -1.0
    T[:3, 3] = [*(0.1 * rng.uniform(-1, 1, 2)), 0.5 * size_a[2] - lowest + sign * (1e-14 * reach + 1e-6)]
    return _cuboid(size_a), _cuboid(size_b), *_moved(rng, T, reach)


def _concentric(rng: np.random.Generator, k: int) -> Question:
    """Bodies with one centre: no first direction suggests itself."""
    T = rotations(rng, 1)[0] if k % 2 else transforms.identity()
    size = _sizes(rng)
    return _cuboid(size), _cuboid(_sizes(rng) if k % 3 else size), *_moved(rng, T)


FAMILIES: dict[str, Callable[[np.random.Generator, int], Question]] = {
    "face to face 1e-1..1e-16": _face_to_face,
    "edge to edge 1e-1..1e-16": _edge_to_edge,
    "corner to face 1e-1..1e-16": _corner_to_face,
    "touching exactly": _touching,
    "nearly parallel faces": _nearly_parallel,
    "slivers": _sliver,
    "needles": _needle,
    "sizes 1e2..1e6 apart": _sizes_apart,
    "scale 1e-9..1e6": _scaled,
    "offset to 1e8 m": _offset,
    "concentric": _concentric,
}


def by_family(pairs: list[HardPair]) -> Iterator[tuple[str, list[HardPair]]]:
    """Yield the pairs of each family, in order."""
    for family in FAMILIES:
        chosen = [pair for pair in pairs if pair.family == family]
        if chosen:
            yield family, chosen
