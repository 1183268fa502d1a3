"""Contacts are found at the times that closed forms, or roots at 50 digits, give, in scenes of 1e-3 to 1e3 m."""

from collections import Counter

import numpy as np
import pytest

from tests.collision import known_scenes, known_times
from tests.collision.exact_motion import pose


@pytest.mark.parametrize("family", known_scenes.FAMILIES, ids=lambda family: family.__name__)
def test_contacts_begin_and_end_when_they_do(family):
    seen = sum((known_times.check(seed, family) for seed in range(3)), Counter())
    assert seen["moments"] > 0
    assert seen["clear"] + seen["contact"] + seen["undecided"] > 0.95 * 3 * (known_times.FRAMES - 1)


def test_the_poses_of_the_reference_are_the_package_s():
    for seed in range(5):
        rng = np.random.default_rng(seed)
        for family in (known_scenes.followers, known_scenes.one_tree, known_scenes.recorded):
            scene = family(rng, 1.0, 2.0)
            linkage, motion, bodies = known_times.built(scene)
            seconds = rng.uniform(0.0, 2.0, 20)
            states = motion.states(seconds)
            world = linkage.forward(states.positions, states.free_poses).world
            for body, (steps, _, _) in zip(bodies, scene.bodies, strict=True):
                turn, origin = pose(steps, seconds)
                np.testing.assert_allclose(world[:, body.link, :3, :3], turn, atol=1e-12)
                np.testing.assert_allclose(world[:, body.link, :3, 3], origin, atol=1e-12 * 20.0)


@pytest.mark.soak
def test_contacts_begin_and_end_when_they_do_in_ten_thousand_scenes():
    seen = Counter()
    for families, seeds in ((known_scenes.CLOSED, 1300), (known_scenes.OTHERS, 440)):
        for seed in range(1000, 1000 + seeds):
            for family in families:
                seen += known_times.check(seed, family)
    assert seen["scenes"] >= 10_000
    assert seen["moments"] > 15_000
