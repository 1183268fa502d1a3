"""What is refused of guards, with its place and what works; and what is noted."""

from __future__ import annotations

import pytest

from replay.errors import ScenarioError
from replay.scenario.load import load_sources
from replay.scenario.notes import notes

TEXT = """version: 1
name: rules
rate: 60 Hz
duration: 1 s
links:
  wall:
    pose: {{xyz: [1, 0, 0]}}
    shapes: {{slab: {{type: cuboid, size: [2 cm, 1, 1]}}, ghost: {{type: cube, size: 1, collide: false}}}}
  cart:
    joint: {{type: prismatic, axis: [1, 0, 0], lower: 0, upper: 2, velocity: 0.3, acceleration: 1}}
    shapes: {{box: {{type: cube, size: 10 cm}}}}
  flag:
    parent: cart
    joint: {{type: revolute, mimic: {{joint: cart}}}}
    shapes: {{cloth: {{type: cube, size: 10 cm}}}}
  wheel: {{joint: {{type: continuous}}}}
  person: {{joint: {{type: free}}, shapes: {{body: {{type: cube, size: 0.3}}}}}}
collision: {{disable: [{{pair: [person, wall], reason: far}}]}}
sensors:
  distance:
    tip: {{link: cart, aperture: 20 deg, range: 1}}
    blind: {{link: cart, aperture: 20 deg, range: 1, ignore: ["*"]}}
  capacitive:
    pad: {{link: cart, plates: {{a: {{size: [5 cm, 5 cm]}}}}, coupling: 1 pF}}
guards: {{g: {guard}}}
{more}"""
TIP = "when: {distance: tip, below: 20 cm}"


def load(guard: str, more: str = ""):
    return load_sources("rules.yaml", {"rules.yaml": TEXT.format(guard=guard, more=more).encode()})


@pytest.mark.parametrize(
    ("guard", "wanted"),
    [
        ("{stop: [cart]}", "guards.g.when is missing"),
        (f"{{{TIP}}}", "guards.g needs either stop or slow"),
        (f"{{{TIP}, stop: [cart], slow: {{to: 0.5, joints: [cart]}}}}", "needs either stop or slow"),
        (f"{{{TIP}, stop: []}}", "must have at least 1 entry"),
        (f"{{{TIP}, slow: {{to: 1, joints: [cart]}}}}", "guards.g.slow.to = 1 must be < 1"),
        (f"{{{TIP}, stop: [card]}}", "guards.g.stop[0] = 'card' is no joint that moves; did you mean 'cart'?"),
        (f"{{{TIP}, stop: [cart, cart]}}", "guards.g.stop[1] = 'cart' is there twice"),
        (f"{{{TIP}, stop: [flag]}}", "is a joint that follows 'cart' and its clock; name the joint that leads"),
        (f"{{{TIP}, stop: [person]}}", "is a free joint, whose key frames go on whatever guards do"),
        (f"{{{TIP}, stop: [wheel]}}", "needs a finite deceleration: joint 'wheel' has no limit of it"),
        (f"{{{TIP}, stop: [cart], deceleration: {{wheel: 1}}}}", "is none of the joints that the guard names"),
        (f"{{{TIP}, stop: [cart], deceleration: {{cart: 0}}}}", "must be above 0"),
        (
            f"{{{TIP}, stop: [cart], deceleration: {{cart: 1 rad/s^2}}}}",
            "is an angular acceleration where an acceleration",
        ),
        (f"{{{TIP}, stop: [cart], direction: {{cart: up}}}}", "must be 'positive' or 'negative'"),
        (f"{{{TIP}, stop: [cart], direction: {{person: positive}}}}", "is a free joint"),
        ("{when: {distance: top, below: 1}, stop: [cart]}", "is no distance sensor; did you mean 'tip'?"),
        ("{when: {distance: pad, below: 1}, stop: [cart]}", "is no distance sensor"),
        ("{when: {distance: tip}, stop: [cart]}", "guards.g.when.below is missing"),
        ("{when: {distance: tip, below: 1 V}, stop: [cart]}", "is a voltage where a length belongs"),
        ("{when: {distance: blind, below: 1}, stop: [cart]}", "ignores every link that has shapes"),
        ("{when: {touch: tip}, stop: [cart]}", "needs one of the keys distance, capacitive, pair, contact, any, all"),
        ("{when: {any: []}, stop: [cart]}", "must have at least 1 entry"),
        (
            "{when: {any: [{distance: tip, below: 1}, {capacitive: pat, output: {below: 1}}]}, stop: [cart]}",
            "when.any[1].capac",
        ),
        ("{when: {pair: [cart, roof], clearance: {below: 1}}, stop: [cart]}", "matches no link and no shape"),
        ("{when: {pair: [person, wall/slab], contact: true}, stop: [cart]}", "collision.disable[0] leaves it out"),
        ("{when: {pair: [cart, wall/ghost], contact: true}, stop: [cart]}", "wall/ghost has collide: false"),
        ("{when: {pair: [cart, flag], contact: true}, stop: [cart]}", "are joined by a joint"),
        ("{when: {pair: [cart, wall]}, stop: [cart]}", "needs either clearance or contact"),
        (
            "{when: {separation: {method: iso13855, K: 1, C: 0}}, stop: [cart]}",
            "needs either distance, a sensor, or pair",
        ),
        (
            f"{{{TIP}, stop: [cart], release: {{hysteresis: 1 V}}}}",
            "is a voltage where a length belongs, as in the condition",
        ),
        (
            "{when: {contact: true}, stop: [cart], release: {hysteresis: 1 cm}}",
            "has no effect: the condition has no threshold",
        ),
        (f"{{{TIP}, stop: [cart], release: soon}}", "must be 'never'"),
        (f"{{{TIP}, stop: [cart], reaction: -1}}", "must be >= 0 s"),
    ],
)
def test_what_cannot_be_is_refused_with_its_place(guard: str, wanted: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        load(guard)
    assert wanted in str(caught.value)
    assert "rules.yaml:2" in str(caught.value)


@pytest.mark.parametrize(
    ("expected", "wanted"),
    [
        ("{guard: h, stops: always}", "is no guard; guards are g"),
        ("{guard: g}", "expects nothing; add one of stops, stopping_distance, clearance_at_stop"),
        ("{guard: g, stopping_distance: {max: 3 deg}}", "is an angle, and not all joints of the guard go by such"),
        ("{guard: g, clearance_at_stop: {min: 1 m}}", "is above collision.margin"),
        ("{guard: g, stops: sometimes}", "must be 'always' or 'never'"),
    ],
)
def test_expectations_of_guards_are_checked(expected: str, wanted: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        load(f"{{{TIP}, stop: [cart]}}", f"expect: [{expected}]\n")
    assert wanted in str(caught.value)


def test_nothing_is_tested_without_pairs() -> None:
    text = TEXT.format(guard="{when: {contact: true}, stop: [cart]}", more="")
    text = text.replace("collision: {disable: [{pair: [person, wall], reason: far}]}", "collision: {pairs: none}")
    with pytest.raises(ScenarioError, match="nothing is tested, since"):
        load_sources("rules.yaml", {"rules.yaml": text.encode()})


def test_defaults_are_those_of_the_contract() -> None:
    guard = load(f"{{{TIP}, stop: [cart]}}").guards["g"]
    assert (guard.for_, guard.reaction, guard.release, guard.direction, guard.deceleration) == (0, 0.0, "never", {}, {})


def test_a_guard_that_holds_all_that_could_end_its_condition_is_noted() -> None:
    alone = "when: {pair: [cart, wall/slab], clearance: {below: 5 cm}}"
    for guard, noted in (
        (f"{{{alone}, stop: [cart], release: {{after: 1 s}}}}", True),
        (f"{{{alone}, stop: [cart]}}", False),
        (f"{{{alone}, slow: {{to: 0.5, joints: [cart]}}, release: {{after: 1 s}}}}", False),
        (f"{{{TIP}, stop: [cart], release: {{after: 1 s}}}}", False),  # the person may go away
    ):
        told = [note.message for note in notes(load(guard)) if "guards.g.release" in note.message]
        assert bool(told) is noted, guard


def test_guards_may_stand_in_an_included_part_beside_those_of_the_scenario() -> None:
    part = b"guards: {shared: {when: {distance: tip, below: 10 cm}, stop: [cart]}}\n"
    text = TEXT.format(guard=f"{{{TIP}, stop: [cart]}}", more="include: [rules_of_all.yaml]\n")
    made = load_sources("rules.yaml", {"rules.yaml": text.encode(), "rules_of_all.yaml": part})
    assert sorted(made.guards) == ["g", "shared"]
