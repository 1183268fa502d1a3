"""What scenes make of the guards that are written."""

import pytest

from replay.scenario.scene import build
from tests.scenario.test_guard_checks import load

RELEASE = "release: {after: 0.1 s, hysteresis: 2 cm}"


@pytest.mark.parametrize(
    ("when", "below", "released", "reach"),
    [
        ("{pair: [cart, wall], clearance: {below: 5 cm}}", 0.05, 0.07, 0.07),
        ("{distance: tip, below: 20 cm}", 0.2, 0.22, 0.0),
    ],
)
def test_a_guard_lets_go_a_hysteresis_above_its_threshold(when, below, released, reach):
    guards = build(load(f"{{when: {when}, stop: [cart], {RELEASE}}}")).guards
    (guard,) = guards.guards
    assert (guard.when.below, guard.when.released) == pytest.approx((below, released), rel=1e-15)
    assert guards.reach == pytest.approx(reach, rel=1e-15)


def test_of_contacts_no_clearance_is_needed():
    guards = build(load("{when: {pair: [cart, wall], contact: true}, stop: [cart]}")).guards
    assert (guards.guards[0].when.below, guards.guards[0].when.released, guards.reach) == (0.0, 0.0, 0.0)
