"""Random scenes of two bodies that come near each other: of some the times of contacts are known in closed form."""

import itertools
import math
from dataclasses import dataclass

import mpmath
import numpy as np

from replay.geometry import primitives
from replay.geometry.mesh import solid_from_triangles
from tests.collision.exact_motion import Convex, Keys, Path, Step
from tests.collision.exact_motion import pose as placed
from tests.collision.motions import pose, random_pose, rotation


@dataclass
class Scene:
    """Two bodies, each the steps from the world to its link, its corners and its solid.

    Attributes:
        bodies: ((steps, Convex, Solid), (..)).
        size: [m] of bodies and ways.
        span: [s] that the motion takes.
        contacts: [(begin [s], end [s], slope of the gap there [m/s]), ..] of all contacts within the frames; None: to
            be found by `exact_motion`.
    """

    bodies: tuple
    size: float
    span: float
    contacts: list | None = None


def box(edges, place=(0.0, 0.0, 0.0)):
    """A box, or a sheet where the last edge is 0."""
    edges, place = np.asarray(edges, dtype=float), np.asarray(place, dtype=float)
    solid = primitives.cuboid(tuple(edges)) if edges[2] > 0.0 else primitives.plane(tuple(edges[:2]))
    solid = solid.transformed(pose(np.identity(3), place))
    signs = np.array(list(itertools.product((-0.5, 0.5), repeat=3)))
    return Convex(signs * edges + place, np.identity(3), ((0, 1), (1, 2), (2, 0))), solid


def tetrahedron(rng, size):
    corners = size * rng.normal(size=(4, 3))
    if np.linalg.det(corners[1:] - corners[0]) < 0.0:
        corners = corners[[0, 2, 1, 3]]
    solid = solid_from_triangles(corners[np.array(((0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2)))])
    edges = np.array([corners[j] - corners[i] for i, j in itertools.combinations(range(4), 2)])
    edges /= np.sqrt((edges**2).sum(axis=1))[:, None]  # 01 02 03 12 13 23
    return Convex(corners, edges, ((0, 1), (0, 2), (1, 2), (3, 4))), solid


def line(begin, speed, span):
    """A joint that moves evenly from `begin` on; its positions a second before and after the span's tenfold."""
    times = np.array([-span, 11.0 * span])
    return Path(times, begin + speed * times)


def shift(x, y=0.0, z=0.0):
    return pose(np.identity(3), np.array([x, y, z]))


def still(convex_solid, place=None):
    return (Step(np.identity(4) if place is None else place),), *convex_solid


# closed forms


def box_through_plate(rng, size, span):
    edge, plate, speed = (
        size * rng.uniform(0.05, 0.2),
        size * rng.uniform(0.001, 0.05),
        size * rng.uniform(0.9, 2) / span,
    )
    place, begin = size * rng.uniform(0.3, 0.8), -size * rng.uniform(0.0, 0.2)
    path = line(begin, speed, span)
    flies = (Step(np.identity(4), "prismatic", (1.0, 0.0, 0.0), path),)
    reach = (mpmath.mpf(0.5) * mpmath.mpf(edge)) + mpmath.mpf(0.5) * mpmath.mpf(plate)
    # the line through its own two positions
    rate = (mpmath.mpf(path.positions[1]) - path.positions[0]) / (mpmath.mpf(path.times[1]) - path.times[0])
    times = [(mpmath.mpf(place) + sign * reach - path.positions[0]) / rate + path.times[0] for sign in (-1, 1)]
    bodies = (flies, *box((edge,) * 3)), still(box((plate, 4.0 * edge, 4.0 * edge)), shift(place))
    return Scene(bodies, size, span, [(*times, speed)])


def two_that_meet(rng, size, span):
    """Cubes on rails towards each other, askew in the world."""
    edges, speeds = size * rng.uniform(0.02, 0.3, 2), size * rng.uniform(0.3, 1.5, 2) / span
    away, turned = size * rng.uniform(0.6, 1.2), pose(rotation(rng), size * rng.normal(size=3))
    paths = [line(0.0, speeds[0], span), line(0.0, -speeds[1], span)]
    axis = (1.0, 0.0, 0.0)
    places = turned, turned @ shift(away)
    bodies = tuple(
        ((Step(place, "prismatic", axis, path),), *box((edge,) * 3))
        for place, path, edge in zip(places, paths, edges, strict=True)
    )
    rate = mpmath.mpf(speeds[0]) + mpmath.mpf(speeds[1])
    reach = (mpmath.mpf(edges[0]) + mpmath.mpf(edges[1])) / 2
    return Scene(bodies, size, span, [((away - reach) / rate, (away + reach) / rate, float(rate))])


def rod_into_plane(rng, size, span):
    """The lower edge of a rod's end, at (l, e), stands at height h when l sin q + e cos q = h."""
    length, edge = size * rng.uniform(0.5, 1.0), size * 10.0 ** rng.uniform(-4, -2)
    start, speed = rng.uniform(-0.3, 0.2), rng.uniform(0.8, 1.2) / span
    height = length * math.sin(rng.uniform(0.25, 0.7))
    path = line(start, speed, span)
    rod = (Step(np.identity(4), "revolute", (0.0, -1.0, 0.0), path),)
    ceiling = box((4.0 * size, 4.0 * size, 0.0), (0.0, 0.0, 0.0))
    l, e, h = mpmath.mpf(length), mpmath.mpf(edge), mpmath.mpf(height)
    angle = mpmath.asin(h / mpmath.hypot(l, e)) - mpmath.atan2(e, l)
    begin = (angle - start) / speed
    lever = math.sqrt(length**2 - height**2) * speed
    bodies = (
        (rod, *box((length, 2.0 * edge, 2.0 * edge), (0.5 * length, 0.0, 0.0))),
        still(ceiling, shift(0, 0, height)),
    )
    return Scene(bodies, size, span, [(begin, mpmath.inf, lever)])


def rod_past_post(rng, size, span):
    """A rod of half thickness e passes a corner at (r, phi) with its front at q = phi - asin(e / r), with its back at
    q = phi + asin(e / r)."""
    edge, start, speed = size * 10.0 ** rng.uniform(-3, -1.5), rng.uniform(-0.3, 0.2), rng.uniform(1.0, 2.0) / span
    thick, r, phi = size * 10.0 ** rng.uniform(-3, -1), size * rng.uniform(0.3, 0.9), rng.uniform(0.3, 1.0)
    x, y = r * math.cos(phi), r * math.sin(phi)
    rod = (Step(np.identity(4), "revolute", (0.0, 0.0, 1.0), line(start, speed, span)),)
    half, e = mpmath.mpf(0.5 * thick), mpmath.mpf(edge)
    turns = []
    for u, v in itertools.product((-half, half), repeat=2):
        radius, angle = mpmath.hypot(x + u, y + v), mpmath.atan2(y + v, x + u)
        turns += [(angle - mpmath.asin(e / radius), -1), (angle + mpmath.asin(e / radius), 1)]
    begin, end = min(q for q, sign in turns if sign < 0), max(q for q, sign in turns if sign > 0)
    times = [(q - start) / speed for q in (begin, end)]
    bodies = (
        (rod, *box((2.0 * size, 2.0 * edge, 2.0 * edge), (size, 0.0, 0.0))),
        still(box((thick, thick, 0.5 * size)), shift(x, y)),
    )
    return Scene(bodies, size, span, [(*times, 0.2 * size * speed)])


def sphere_past_edge(rng, size, span):
    """A sphere of many faces passes over a ridge that cuts off a cap of it: for as long as the cut is."""
    radius, speed = size * rng.uniform(0.1, 0.3), size * rng.uniform(0.9, 2.0) / span
    solid = primitives.sphere(radius, radius * 10.0 ** rng.uniform(-2.5, -1))
    x, deep = solid.vertices[:, 0], 0.2 * radius * 10.0 ** rng.uniform(-6, 0)
    height, away = float(solid.vertices[:, 2].min()) + deep, size * rng.uniform(0.4, 0.8)
    z = solid.vertices[:, 2] - height
    below, above = (np.flatnonzero(side) for side in (z < 0.0, z >= 0.0))
    share = -z[below][:, None] / (z[above][None, :] - z[below][:, None])
    cuts = x[below][:, None] + share * (x[above][None, :] - x[below][:, None])
    times, slopes = [], []
    for index in (cuts.argmax(), cuts.argmin()):
        i, j = np.unravel_index(index, cuts.shape)
        (xi, zi), (xj, zj) = (map(mpmath.mpf, solid.vertices[k, [0, 2]].tolist()) for k in (below[i], above[j]))
        times.append((away - xi - (height - zi) * (xj - xi) / (zj - zi)) / speed)
        slopes.append(speed * float(abs(zj - zi) / mpmath.hypot(xj - xi, zj - zi)))
    turn = 0.75 * math.pi
    down = np.array([[math.cos(turn), 0.0, math.sin(turn)], [0.0, 1.0, 0.0], [-math.sin(turn), 0.0, math.cos(turn)]])
    ridge = box((2.0 * size,) * 3, (size, 0.0, size))  # the corner at the origin, opening downwards
    ball = (Step(np.identity(4), "prismatic", (1.0, 0.0, 0.0), line(0.0, speed, span)),)
    bodies = (ball, Convex(solid.vertices, np.identity(3), ()), solid), still(ridge, pose(down, (away, 0.0, height)))
    return Scene(bodies, size, span, [(*times, min(slopes))])


# roots of the gap


def screw(rng, size, span):
    """A box on a nut that turns and rises evenly, as a screw, beside a box."""
    turned, turns = random_pose(rng, size), rng.uniform(2.0, 12.0) / span
    rises = _step(turned, "prismatic", line(-0.5 * size, size * rng.uniform(0.5, 1.5) / span, span))
    spins = _step(np.identity(4), "revolute", line(rng.uniform(0.0, 6.0), turns, span))
    return _near(rng, size, span, [rises, spins, Step(shift(0.3 * size))], [])


def tumble(rng, size, span):
    """Two free bodies, each with key frames of its own."""
    return _near(rng, size, span, [_free(rng, size, span)], [_free(rng, size, span)])


def two_moving(rng, size, span):
    sides = [[_random(rng, size, span, kind) for kind in ("prismatic", "revolute")] for _ in range(2)]
    return _near(rng, size, span, *sides)


def chain_of_six(rng, size, span):
    return _near(rng, size, span, [_random(rng, 0.4 * size, span, "revolute") for _ in range(6)], [])


def one_tree(rng, size, span):
    """Two branches of a trunk that moves as well, which neither sees of the other."""
    trunk = [_random(rng, size, span, "revolute"), _free(rng, size, span)]
    branches = [
        [_random(rng, 0.5 * size, span, kind) for kind in kinds] for kinds in (("revolute",) * 3, ("prismatic",))
    ]
    return _near(rng, size, span, *branches, trunk)


def followers(rng, size, span):
    """Joints that follow the first one's, to the millimetre and the kilometre, there and back."""
    first = _random(rng, size, span, "revolute")
    chain = [first]
    for _ in range(3):
        kind = ("revolute", "prismatic")[rng.integers(2)]
        ratio = rng.normal() * (size if kind == "prismatic" else 2.0), rng.normal()
        chain.append(Step(random_pose(rng, 0.4 * size), kind, _axis(rng), None, first, ratio))
    return _near(rng, size, span, chain, [])


def recorded(rng, size, span):
    """Recorded joints that jump within a nanosecond."""
    return _near(rng, size, span, [_track(rng, size, span, kind) for kind in ("prismatic", "revolute")], [])


def sheets(rng, size, span):
    """Two surfaces of no thickness."""
    sides = [[_random(rng, size, span, kind) for kind in ("prismatic", "revolute")] for _ in range(2)]
    return _near(rng, size, span, *sides, made=[box((*(size * rng.uniform(0.1, 0.6, 2)), 0.0)) for _ in range(2)])


CLOSED = (box_through_plate, two_that_meet, rod_into_plane, rod_past_post, sphere_past_edge)
OTHERS = (screw, tumble, two_moving, chain_of_six, one_tree, followers, recorded, sheets)
FAMILIES = CLOSED + OTHERS


def _axis(rng):
    v = rng.normal(size=3)
    return tuple((v / math.sqrt((v**2).sum())).tolist())


def _step(place, kind, path, axis=(0.0, 0.0, 1.0)):
    return Step(place, kind, axis, path)


def _random(rng, size, span, kind):
    """A joint in any place that moves by lines or cubics through a few points."""
    times = np.concatenate([[-0.1 * span], np.sort(rng.uniform(0.0, span, rng.integers(0, 3))), [1.2 * span]])
    reach = size if kind == "prismatic" else 2.0
    positions, velocities = reach * rng.normal(size=len(times)), 2.0 * reach / span * rng.normal(size=len(times))
    path = Path(times, positions, velocities if rng.random() < 0.5 else None)
    return Step(random_pose(rng, 0.4 * size), kind, _axis(rng), path)


def _track(rng, size, span, kind):
    times, reach = np.sort(rng.uniform(0.0, span, 6)), size if kind == "prismatic" else 2.0
    positions = np.cumsum(0.4 * reach * rng.normal(size=7))
    times = np.concatenate([[-0.1 * span], np.stack([times, times + 5e-10], axis=1).ravel(), [1.2 * span]])
    return Step(random_pose(rng, 0.4 * size), kind, _axis(rng), Path(times, np.repeat(positions, 2)))


def _free(rng, size, span):
    count = int(rng.integers(2, 5))
    times = np.linspace(-0.1 * span, 1.1 * span, count) + 0.05 * span * rng.uniform(-1, 1, count)
    quat = rng.normal(size=(count, 4))
    quat /= np.sqrt((quat**2).sum(axis=1))[:, None]
    return Step(np.identity(4), "free", path=Keys(times, 0.7 * size * rng.normal(size=(count, 3)), quat))


def _near(rng, size, span, one, other, trunk=(), made=None):
    """Two bodies on chains, the first moved so that they are near each other at some moment."""
    if made is None:
        made = []
        for _ in range(2):
            edges = size * 10.0 ** rng.uniform(-1.5, -0.3, 3) * (rng.uniform(size=3) < 0.9) + 1e-3 * size
            made.append(box(edges) if rng.random() < 0.6 else tetrahedron(rng, 0.2 * size))
    chains = [[*trunk, *(chain or [Step(random_pose(rng, size))])] for chain in (one, other)]
    moment = np.array([rng.uniform(0.05, 0.95) * span])
    (turn_a, at_a), (turn_b, at_b) = (_last(chain, moment) for chain in chains)
    points = [turn @ rng.permutation(convex.corners)[0] for turn, (convex, _) in ((turn_a, made[0]), (turn_b, made[1]))]
    # one corner onto the other, by the place of the first chain's own first step
    k, base = len(trunk), _last(trunk, moment)[0] if trunk else np.identity(3)
    place = chains[0][k].place.copy()
    place[:3, 3] += base.T @ (at_b + points[1] * rng.uniform(0.5, 1) - at_a - points[0] * rng.uniform(0.5, 1))
    moved = Step(place, *(getattr(chains[0][k], name) for name in ("kind", "axis", "path", "leader", "ratio")))
    chains[0] = [moved if step is chains[0][k] else _following(step, chains[0][k], moved) for step in chains[0]]
    return Scene(tuple((tuple(chain), *body) for chain, body in zip(chains, made, strict=True)), size, span)


def _following(step, old, new):
    return step if step.leader is not old else Step(step.place, step.kind, step.axis, None, new, step.ratio)


def _last(steps, moment):
    turn, origin = placed(steps, moment)
    return turn[0], origin[0]
