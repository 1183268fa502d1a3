"""A C-arm of twelve convex bodies on a linkage that moves: the scene of the collision benchmarks."""

from __future__ import annotations

import itertools
import math

import numpy as np

from replay.bench.engines import Body
from replay.bench.inputs import box, ellipsoid
from replay.collision.pairs import CollisionBody, Pair
from replay.geometry.primitives import cuboid
from replay.geometry.solid import Solid
from replay.kinematics.linkage import Joint, JointType, Link, Linkage, LinkPoses
from replay.numerics import transforms

FIXED, TURNS, SLIDES = JointType.FIXED, JointType.REVOLUTE, JointType.PRISMATIC

# name, parent, place in the parent [m], joint, axis, swing [rad or m], body (box edges, or half axes of 162 vertices)
_PARTS = (
    ("stand", None, (0.0, 0.0, 0.15), FIXED, (0, 0, 1), 0.0, "box", (0.5, 0.4, 0.3)),
    ("column", "stand", (0.0, 0.0, 0.92), SLIDES, (0, 0, 1), 0.15, "box", (0.3, 0.3, 1.2)),
    ("boom", "column", (0.38, 0.0, 0.3), TURNS, (1, 0, 0), 0.9, "box", (0.4, 0.2, 0.2)),
    ("arc_back", "boom", (0.32, 0.0, 0.0), TURNS, (1, 0, 0), 0.3, "box", (0.16, 0.16, 1.1)),
    ("arc_upper", "arc_back", (0.36, 0.0, 0.65), FIXED, (0, 0, 1), 0.0, "box", (0.9, 0.14, 0.14)),
    ("arc_lower", "arc_back", (0.36, 0.0, -0.65), FIXED, (0, 0, 1), 0.0, "box", (0.9, 0.14, 0.14)),
    ("detector", "arc_upper", (0.35, 0.0, -0.22), SLIDES, (0, 0, 1), 0.06, "box", (0.4, 0.4, 0.12)),
    ("tube", "arc_lower", (0.35, 0.0, 0.3), TURNS, (0, 0, 1), 0.5, "hull", (0.16, 0.16, 0.2)),
    ("table_base", None, (1.1, 1.9, 0.4), FIXED, (0, 0, 1), 0.0, "box", (0.5, 0.5, 0.8)),
    ("table_top", "table_base", (0.0, -1.1, 0.56), SLIDES, (0, 1, 0), 0.3, "box", (0.5, 2.2, 0.06)),
    ("torso", "table_top", (0.0, -0.3, 0.18), SLIDES, (0, 0, 1), 0.01, "hull", (0.22, 0.45, 0.13)),
    ("head", "torso", (0.0, -0.59, 0.02), TURNS, (0, 0, 1), 0.4, "hull", (0.09, 0.12, 0.11)),
)


def bodies() -> list[Body]:
    """Return the twelve bodies, each in its link's frame, in the order of `linkage().link_names`."""
    several = {}
    for name, *_, kind, size in _PARTS:
        x, y, z = size
        several[name] = Body(box((x, y, z)), (x, y, z)) if kind == "box" else Body(ellipsoid(162, (x, y, z)))
    return [several[name] for name in sorted(several)]


def linkage() -> Linkage:
    """Return the twelve links: a machine, and a table with a patient."""
    links = []
    for name, parent, place, kind, axis, _, *_ in _PARTS:
        x, y, z = (float(value) for value in axis)
        T_parent_joint = transforms.from_translation(np.array(place))
        links.append(Link(name, parent, T_parent_joint, Joint(name, kind, (x, y, z))))
    return Linkage(links)


def poses(frames: int) -> LinkPoses:
    """Return link poses of a sweep in which every joint swings at its own pace, at 60 frames a second."""
    machine = linkage()
    swing = {name: width for name, _, _, _, _, width, *_ in _PARTS}
    time = np.arange(frames) / 60.0
    columns = [
        swing[name] * np.sin(2.0 * math.pi * time * (0.05 + 0.013 * k) + k)
        for k, name in enumerate(machine.joint_names)
    ]
    return machine.forward(np.stack(columns, axis=1), np.zeros((frames, 0, 4, 4)))


def collision_bodies() -> list[CollisionBody]:
    """Return the bodies as the pipeline takes them."""
    names = linkage().link_names
    return [
        CollisionBody(f"{name}/body", k, solid(body))
        for k, (name, body) in enumerate(zip(names, bodies(), strict=True))
    ]


def solid(body: Body) -> Solid:
    """Return a convex body as a solid."""
    from replay.geometry.hull import convex_hull

    if body.size is not None:
        return cuboid(body.size)
    hull = convex_hull(body.vertices)
    assert hull is not None
    return Solid(np.ascontiguousarray(body.vertices[hull.faces]), pieces=(body.vertices,))


def all_pairs() -> tuple[Pair, ...]:
    """Return the 66 pairs of the twelve bodies, joined ones too, none of them evaluated once for all frames."""
    names = [body.name for body in collision_bodies()]
    return tuple(Pair(f"{names[a]}|{names[b]}", a, b, False) for a, b in itertools.combinations(range(len(names)), 2))
