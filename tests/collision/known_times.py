"""What the pipeline says of random scenes, against the times of their contacts.

These come from closed forms where there are any, else from the roots of `exact_motion.gap` at 50 digits.
"""

import itertools
import math
from collections import Counter

import mpmath
import numpy as np

from replay.collision.columns import Between, Level
from replay.collision.crossing_search import PARTS
from replay.collision.intervals import RESOLUTION
from replay.collision.pairs import CollisionBody, plan_pairs
from replay.collision.pipeline import CollisionPipeline
from replay.kinematics.linkage import Joint, JointType, Link, Linkage, Mimic
from replay.kinematics.motion import FreeTrack, Script, Track, Waypoint, plan
from tests.collision.exact_motion import DIGITS, gap, root
from tests.collision.known_scenes import FAMILIES

FRAMES = 9
ROUNDING = 2e-14
"""Of all lengths: poses and distances at one moment."""

SHORT = 2 * RESOLUTION // PARTS
"""[ns] A contact that lasts longer is found; of a shorter one it may remain unknown whether it is one."""


def built(scene):
    """Return (linkage, motion, bodies) of a scene."""
    links, names, script = [], {}, Script({}, (), {}, {}, {})
    bodies = []
    for side, (steps, _, solid) in enumerate(scene.bodies):
        parent = None
        for step in steps:
            if id(step) not in names:
                name = names[id(step)] = f"{'ab'[side]}{len(links)}"
                links.append(Link(name, parent, step.place, _joint(name, step, names, script)))
            parent = names[id(step)]
        bodies.append((parent, solid))
    linkage = Linkage(links)
    found = [CollisionBody(f"{link}/s", linkage.link_index(link), solid) for link, solid in bodies]
    return linkage, plan(linkage, script), found


def _joint(name, step, names, script):
    kind = JointType(step.kind)
    if step.leader is not None:
        return Joint(name, kind, step.axis, mimic=Mimic(names[id(step.leader)], *step.ratio))
    path = step.path
    if kind is JointType.FREE:
        script.recorded_free[name] = FreeTrack(path.times, path.xyz, path.quat)
    elif path is not None and path.velocities is None and len(path.times) > 6:
        script.recorded[name] = Track(path.times, path.positions)
    elif path is not None:
        speeds = [None] * len(path.times) if path.velocities is None else path.velocities.tolist()
        rows = zip(path.times.tolist(), path.positions.tolist(), speeds, strict=True)
        script.points[name] = tuple(Waypoint(*row) for row in rows)
    return Joint(name, kind, step.axis)


def contacts(scene, seconds, also, samples=48):
    """Return (contacts as `Scene.contacts`, times at which the gap nearly turns into one or nearly ends [s]).

    The gap is looked at between the frames' `seconds` and at `also`: a contact may be shorter than samples are apart.
    """
    a, b = ((steps, convex) for steps, convex, _ in scene.bodies)
    knots = [step.path.times for steps in (a[0], b[0]) for step in steps if step.path is not None]
    knots = np.unique(np.concatenate([seconds, also, *knots]).clip(seconds[0], seconds[-1]))
    times = np.unique(np.concatenate([np.linspace(x, y, samples) for x, y in itertools.pairwise(knots)]))
    apart = gap(a, b, times)[0]
    tiny, grazes = 1e-9 * scene.size, []
    for _ in range(6):  # look closer where the gap has an extremum that may cross 0
        inner = np.flatnonzero((apart[1:-1] - apart[:-2]) * (apart[2:] - apart[1:-1]) < 0.0) + 1
        steps = np.maximum(abs(apart[inner] - apart[inner - 1]), abs(apart[inner + 1] - apart[inner]))
        close = inner[(abs(apart[inner]) < 2.0 * steps) & (times[inner + 1] - times[inner - 1] > 1e-12 * scene.span)]
        if not len(close):
            break
        more = np.concatenate([np.linspace(times[k - 1], times[k + 1], 17) for k in close])
        more = np.setdiff1d(more, times)
        times, apart = np.concatenate([times, more]), np.concatenate([apart, gap(a, b, more)[0]])
        order = np.argsort(times)
        times, apart = times[order], apart[order]
    inner = np.flatnonzero((apart[1:-1] - apart[:-2]) * (apart[2:] - apart[1:-1]) < 0.0) + 1
    grazes = times[inner[abs(apart[inner]) < tiny]]
    found, begin = [], None if apart[0] > 0.0 else (-mpmath.inf, math.inf)
    for k in np.flatnonzero((apart[1:] > 0.0) != (apart[:-1] > 0.0)).tolist():
        moment = root(a, b, times[k], times[k + 1])
        if begin is None:
            begin = moment
        else:
            found.append((begin[0], moment[0], min(abs(begin[1]), abs(moment[1]))))
            begin = None
    if begin is not None:
        found.append((begin[0], mpmath.inf, abs(begin[1])))
    return found, grazes


def _jumps(scene):
    """The times at which a joint moves faster than moments can be told apart."""
    paths = {id(step.path): step.path for steps, _, _ in scene.bodies for step in steps if step.path is not None}
    return [t for path in paths.values() for t, h in zip(path.times, np.diff(path.times), strict=False) if h < 1e-9]


def check(seed, family):
    """Hold what is said of a random scene against the known times; return a count of what was seen."""
    rng = np.random.default_rng([seed, FAMILIES.index(family)])
    size, rate = 10.0 ** rng.uniform(-3, 3), 10.0 ** rng.uniform(0, 3)
    span = (FRAMES - 1) / rate
    scene = family(rng, size, span)
    time = np.round(np.arange(FRAMES) * 1e9 / rate).astype(np.int64)
    linkage, motion, bodies = built(scene)
    options = {
        "bounds": str(rng.choice(["obb", "sphere", "aabb"])),
        "clearance": str(rng.choice(["near", "never", "always"])),
        "margin": float(size * 10.0 ** rng.uniform(-2, 0)),
        "savings": bool(rng.random() < 0.8),
    }
    engine = CollisionPipeline(bodies, plan_pairs(bodies, linkage), linkage, motion=motion, **options)
    states = motion.states(time / 1e9)
    columns = engine.run(linkage.forward(states.positions, states.free_poses), time=time)
    told = np.concatenate([columns.crossings.earliest, columns.crossings.latest]) / 1e9
    known, grazes = (scene.contacts, ()) if scene.contacts else contacts(scene, time / 1e9, told)
    reach = 10.0 * size + sum(np.abs(step.place[:3, 3]).max() for steps, _, _ in scene.bodies for step in steps)
    place = (seed, family.__name__)
    crossings, seen = columns.crossings, Counter(scenes=1)
    with mpmath.workdps(DIGITS):
        moments = [
            (b * 10**9, e * 10**9, 1e9 * ROUNDING * reach / max(slope, 1e-300) + 1e-15 * time[-1])
            for b, e, slope in known
        ]
        for f in range(1, FRAMES):
            low, high = int(time[f - 1]), int(time[f])
            state = columns.between[f, 0]
            mine = [m for m in moments if m[0] <= high and m[1] >= low]
            ends = [t for b, e, slack in moments for t in (b, e) for at in (low, high) if abs(t - at) <= slack]
            if ends or any(low <= 1e9 * t <= high for t in grazes):
                seen["left out"] += 1
                continue
            if state == Between.UNDECIDED:
                fast = any(low <= 1e9 * t <= high for t in _jumps(scene))
                assert fast or any(e - b < SHORT for b, e, _ in mine), (*place, f)
                seen["undecided"] += 1
                continue
            seen[Between(state).name.lower()] += 1
            assert (state == Between.CONTACT) == bool(mine), (*place, f)
            now = (crossings.frame == f) & (crossings.level == Level.CONTACT)
            begins, stops = np.flatnonzero(now & crossings.begins), np.flatnonzero(now & ~crossings.begins)
            before, after = (any(b <= at <= e for b, e, _ in mine) for at in (low, high))
            assert len(begins) == int(bool(mine) and not before), (*place, f)
            assert len(stops) == int(bool(mine) and not after), (*place, f)
            for rows, moment in ((begins, mine[0][0] if mine else 0), (stops, mine[-1][1] if mine else 0)):
                slack = max((m[2] for m in mine), default=0.0)
                for row in rows:
                    earliest, latest = int(crossings.earliest[row]), int(crossings.latest[row])
                    assert earliest - slack <= moment <= latest + slack, (*place, f, moment, earliest, latest, slack)
                    seen["moments"] += 1
                    seen["long brackets"] += latest - earliest > 1_000
    return seen
