"""Bodies that pass each other at down to 1e-9 of their size: clear or contact, each only where true, and decided."""

import math

import numpy as np
import pytest

from replay.collision.columns import Between
from replay.collision.pairs import plan_pairs
from replay.collision.pipeline import CollisionPipeline
from tests.collision.exact_motion import Step
from tests.collision.known_scenes import Scene, box, line, shift, still
from tests.collision.known_times import built
from tests.collision.motions import pose, random_pose

TILT = math.sqrt(0.5)
ABOUT_X = np.array([[1.0, 0.0, 0.0], [0.0, TILT, -TILT], [0.0, TILT, TILT]])
ABOUT_Y = np.array([[TILT, 0.0, TILT], [0.0, 1.0, 0.0], [-TILT, 0.0, TILT]])


def slide(turned, s, span, gap):
    """A face along a face."""
    moves = (Step(turned, "prismatic", (1.0, 0.0, 0.0), line(-s, 2.0 * s / span, span)),)
    upper, lower = box((0.3 * s, 0.3 * s, 0.2 * s), (0, 0, 0.1 * s)), box((0.4 * s, 0.4 * s, 0.2 * s), (0, 0, -0.1 * s))
    return (moves, *upper), still(lower, turned @ shift(0, 0, -gap))


def edges(turned, s, span, gap):
    """An edge across an edge."""
    rail = Step(turned, "prismatic", (0.0, 1.0, 0.0), line(-s, 2.0 * s / span, span))
    half = 0.2 * s * TILT
    upper, lower = pose(ABOUT_X, (0.0, 0.0, half)), turned @ pose(ABOUT_Y, (0.0, 0.0, -half - gap))
    return ((rail, Step(upper)), *box((0.2 * s,) * 3)), still(box((0.2 * s,) * 3), lower)


def turn(turned, s, span, gap):
    """A rod's corner at the top of its circle below a ceiling."""
    rod = (Step(turned, "revolute", (0.0, -1.0, 0.0), line(0.3, 2.4 / span, span)),)
    height = math.hypot(s, 0.01 * s) + gap
    ceiling = still(box((4.0 * s, 4.0 * s, s), (0, 0, 0.5 * s)), turned @ shift(0, 0, height))
    return (rod, *box((s, 0.02 * s, 0.02 * s), (0.5 * s, 0, 0))), ceiling


@pytest.mark.parametrize("gap", [1e-3, 1e-6, 1e-9, -1e-9, -1e-6])
@pytest.mark.parametrize("passing", [slide, edges, turn], ids=lambda made: made.__name__)
def test_what_grazes_is_decided(passing, gap):
    for seed in range(8):
        rng = np.random.default_rng(seed)
        size, rate = 10.0 ** rng.uniform(-3, 3), 10.0 ** rng.uniform(0, 3)
        bodies = passing(random_pose(rng, 0.3 * size), size, 8.0 / rate, gap * size)
        linkage, motion, found = built(Scene(bodies, size, 8.0 / rate))
        time = np.round(np.arange(9) * 1e9 / rate).astype(np.int64)
        bounds = ("obb", "sphere", "aabb")[seed % 3]
        engine = CollisionPipeline(
            found, plan_pairs(found, linkage), linkage, motion=motion, bounds=bounds, margin=0.05 * size
        )
        states = motion.states(time / 1e9)
        columns = engine.run(linkage.forward(states.positions, states.free_poses), time=time)
        worst = Between.CLEAR if gap > 0.0 else Between.CONTACT
        assert columns.between[1:, 0].max() == worst
