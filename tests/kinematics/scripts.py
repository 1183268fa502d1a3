"""Random linkages with random scripts of every kind."""

from dataclasses import replace

import numpy as np

from replay.kinematics.clock import Clock
from replay.kinematics.linkage import Joint, JointType, Link, Linkage
from replay.kinematics.motion import FreeTrack, Keyframe, Move, Script, Track, Waypoint, plan
from tests.collision.motions import pose, rotation

SCALAR = (JointType.REVOLUTE, JointType.CONTINUOUS, JointType.PRISMATIC)


def unit(rng, n=3):
    """A random direction."""
    v = rng.normal(size=n)
    return v / np.sqrt((v**2).sum())


def random_waypoints(rng, span, size, kind=None):
    """Waypoints over `span` [s] with positions of about `size`: lines, cubics, quintics, or a mixture (None)."""
    times = np.sort(rng.uniform(-0.1 * span, 1.1 * span, rng.integers(1, 6)))
    kind = rng.integers(0, 4) if kind is None else kind
    points = []
    for time in times.tolist():
        order = kind if kind < 3 else rng.integers(0, 3)
        rates = (size * rng.normal(size=2) / span).tolist()
        points.append(Waypoint(time, float(size * rng.normal()), *rates[:order]))
    return tuple(points)


def random_motion(rng, *, links=6, span=1.0, size=1.0):
    """Return (linkage, motion): trees of links with all kinds of joints, moved by all kinds of scripts."""
    kinds = (*SCALAR, JointType.FREE, JointType.FIXED)
    made, points, moves, recorded, free, recorded_free = [], {}, [], {}, {}, {}
    for k in range(links):
        kind = kinds[rng.integers(len(kinds))]
        parent = None if k == 0 or rng.random() < 0.2 else f"l{rng.integers(k)}"
        place = pose(rotation(rng), size * rng.normal(size=3) * (rng.random() < 0.8))
        axis = tuple(unit(rng).tolist()) if rng.random() < 0.5 else (0.0, 0.0, 1.0)
        limits = {"velocity": 20.0 * size / span, "acceleration": 200.0 * size / span**2}
        joint = Joint(f"j{k}", kind, axis, initial=float(rng.normal()) if kind in SCALAR else 0.0, **limits)
        made.append(Link(f"l{k}", parent, place, joint))
        reach = size if kind is JointType.PRISMATIC else 2.0
        script = rng.integers(0, 4)
        if kind in SCALAR:
            wide = {"velocity": np.inf, "acceleration": np.inf}
            if script == 0:
                points[f"j{k}"] = random_waypoints(rng, span, reach)
            elif script == 1:
                moves.append(Move({f"j{k}": float(reach * rng.normal())}, start=float(span * rng.uniform(0, 0.4))))
                wide = {"velocity": 4.0 * reach / span, "acceleration": 30.0 * reach / span**2}
            elif script == 2:
                times = np.cumsum(rng.uniform(0.01, 0.2, 12)) * span - 0.1 * span
                recorded[f"j{k}"] = Track(times, np.cumsum(0.2 * reach * rng.normal(size=12)))
            made[-1] = Link(f"l{k}", parent, place, Joint(f"j{k}", kind, axis, initial=joint.initial, **wide))
        elif kind is JointType.FREE and script < 3:
            times = np.cumsum(rng.uniform(0.05, 0.5, 5)) * span - 0.1 * span
            xyz = size * rng.normal(size=(5, 3))
            quat = np.array([unit(rng, 4) for _ in range(5)])
            if script == 0:
                recorded_free[f"j{k}"] = FreeTrack(times, xyz, quat)
            else:
                keys = zip(times.tolist(), xyz.tolist(), quat.tolist(), strict=True)
                free[f"j{k}"] = tuple(Keyframe(t, tuple(x), tuple(q)) for t, x, q in keys)
    linkage = Linkage(made)
    script = Script(points, tuple(moves), free, recorded, recorded_free)
    return linkage, plan(linkage, script)


def random_clocks(rng, motion, span=1.0):
    """Return the motion with clocks that brake, hold and go on again; some joints have none that does."""
    clocks = []
    for _ in motion.profiles:
        clock, rate = Clock.steady(), 1.0
        for begin in np.sort(rng.uniform(-0.1 * span, 1.1 * span, rng.integers(0, 6))).tolist():
            ends = begin + span * rng.uniform(0.0, 0.3)
            rate = clock.at(begin)[1]
            target = float(rng.choice([0.0, 1.0, rng.uniform()]))
            clock = clock.then(begin, rate, (target - rate) / (ends - begin)).then(ends, target, 0.0)
        clocks.append(clock)
    return replace(motion, clocks=tuple(clocks))
