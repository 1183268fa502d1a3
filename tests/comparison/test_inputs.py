"""What differs between two scenarios as they are meant."""

import pytest

from replay.comparison.inputs import input_changes
from replay.scenario.load import load_sources

SCENE = {
    "frames": "rate: 10 Hz, duration: 1 s",
    "ball": "type: sphere, radius: 20 cm, pose: {xyz: [0, 0, 1 m]}",
    "joint": "name: turn, type: revolute, axis: [0, 0, 1], upper: 90 deg, lower: -90 deg",
    "signal": "bias: 0",
    "expect": "{pair: [arm, post], contact: never}",
}


def scenario(**changed):
    parts = {**SCENE, **changed}
    text = (
        f"{{version: 1, name: s, {parts['frames']}, links: {{"
        f"arm: {{joint: {{{parts['joint']}}}, shapes: {{ball: {{{parts['ball']}}}}}}}, "
        f"post: {{shapes: {{a: {{type: cube, size: 1, pose: {{xyz: [9, 0, 0]}}}}}}}}}}, "
        f"sensors: {{distance: {{tip: {{link: arm, aperture: 20 deg, range: 3, signal: {{{parts['signal']}}}}}}}}}, "
        f"expect: [{parts['expect']}]}}"
    )
    return load_sources("s.yaml", {"s.yaml": text.encode()})


@pytest.mark.parametrize(
    ("part", "value", "expected"),
    [
        ("ball", "type: sphere, radius: 200 mm, pose: {xyz: [0, 0, 100 cm]}", []),
        ("ball", "type: sphere, radius: 21 cm, pose: {xyz: [0, 0, 1 m]}", ["arm/ball radius 20 -> 21 cm"]),
        ("ball", "type: sphere, radius: 20 cm, pose: {xyz: [0, 0, 90 cm]}", ["arm/ball pose.xyz[2] 1 -> 0.9 m"]),
        ("ball", "type: cube, size: 20 cm, pose: {xyz: [0, 0, 1 m]}", ["arm/ball type sphere -> cube"]),
        ("frames", "rate: 10 Hz, duration: 2 s", ["duration 1 -> 2 s"]),
        ("joint", f"{SCENE['joint']}, initial: 5 deg", ["links.arm.joint.initial - -> 5 deg"]),
        ("signal", "bias: 0, low_pass: 2 Hz", ["sensors.distance.tip.signal.low_pass - -> 2 Hz"]),
        ("expect", "{pair: [arm, post], contact: always}", ["expect[0].contact never -> always"]),
        ("expect", f"{SCENE['expect']}, {{pair: ['*', post], bounds: never}}", ["expect[1] added"]),
        ("expect", "", ["expect[0] removed"]),
    ],
)
def test_each_value_that_changes_is_a_line_in_the_unit_that_suits_it(part, value, expected):
    assert list(input_changes(scenario(), scenario(**{part: value}))) == expected


@pytest.mark.parametrize(
    ("signal", "expected"),
    [
        ("bias: 0", ["low_pass 2 Hz -> -", "delay 100 -> 0 ms"]),
        ("low_pass: 3 Hz, delay: 100 ms", ["low_pass 2 -> 3 Hz"]),
    ],
)
def test_what_goes_is_told_as_well(signal, expected):
    lines = input_changes(scenario(signal="low_pass: 2 Hz, delay: 100 ms"), scenario(signal=signal))
    assert [line.removeprefix("sensors.distance.tip.signal.") for line in lines] == expected


PERSON = """
links:
  person: {earth: 100 pF, joint: {type: free}, shapes: {body: {type: cylinder, radius: 20 cm, height: 1.8}}}
"""
TEXT = """
version: 1
name: whole
tags: [a]
rate: 20 Hz
duration: 1 s
include: [person.yaml]
links:
  base: {shapes: {foot: {type: cube, size: 10 cm, pose: {xyz: [0, 0, -0.4]}}}}
  forearm:
    parent: base
    joint: {name: elbow, type: revolute, axis: [0, 1, 0], velocity: 2, acceleration: 5}
    shapes: {tube: {type: cylinder, radius: 5 cm, height: 1, pose: {xyz: [0, 0, 0.5]}}}
  slide: {joint: {type: prismatic, axis: [1, 0, 0]}, pose: {xyz: [0, -2, 0]}, shapes: {block: {type: cube, size: 1}}}
poses: {home: {elbow: 0}, up: {elbow: 40 deg}}
motion:
  moves: [{to: {elbow: 60 deg}}, {to: home, speed: 0.5}]
  points: {slide: [{time: 0, position: 0}, {time: 0.5, position: 10 cm}, {time: 1, position: 20 cm}]}
  free: {person: [{time: 0, xyz: [1.2, 0.6, 0.4]}]}
sensors:
  distance: {tip: {link: forearm, pose: {xyz: [0, 0, 1], rpy: [0, 90 deg, 0]}, aperture: 20 deg, range: 3,
    signal: {noise: {std: 1 mm, seed: 7}, delay: 50 ms}}}
guards: {patient: {when: {distance: tip, below: 30 cm}, reaction: 50 ms, stop: [elbow], deceleration: {elbow: 4}}}
collision: {disable: [{pair: [base, forearm], reason: rigid}]}
expect:
  - {pair: [forearm, person], clearance: {min: 2 cm}}
  - {distance: tip, min: 5 cm}
"""


def whole(text, person=PERSON):
    return load_sources("s.yaml", {"s.yaml": text.encode(), "person.yaml": person.encode()})


SENSOR, SLIDE, GUARD = "sensors.distance.tip", "motion.points.slide", "guards.patient"


@pytest.mark.parametrize(
    ("edits", "expected"),
    [
        (("tags: [a]", "tags: [b]  # another"), ""),
        (
            (
                "aperture: 20 deg",
                "aperture: 0.3490658503988659",
                "range: 3",
                "range: 300 cm",
                "delay: 50 ms",
                "delay: 0.05",
            ),
            "",
        ),
        (("elbow: 4}", "elbow: 4 rad/s^2}"), ""),
        (("reason: rigid", "reason: they are rigid"), ""),
        (("rpy: [0, 90 deg, 0]", "quat_xyzw: [0, 1, 0, 1]"), ""),
        (("rpy: [0, 90 deg, 0]", "quat_xyzw: [0, 1, 0, 1.2]"), f"{SENSOR}.pose turned by 10.4 deg"),
        (("rpy: [0, 90 deg, 0]", "rpy: [0, 85 deg, 0]"), f"{SENSOR}.pose.rpy[1] 90 -> 85 deg"),
        (("xyz: [0, -2, 0]}", "xyz: [0, -2, 0], rpy: [0, 0, 9 deg]}"), "links.slide.pose.rpy[2] 0 -> 9 deg"),
        (("disable: [", "disable: [{pair: [base, slide], reason: far}, "), "collision.disable[0] added"),
        (("moves: [", "moves: [{to: {elbow: 10 deg}}, "), "motion.moves[0] added"),
        (("{time: 0.5, position: 10 cm}, ", ""), f"{SLIDE}[1] removed"),
        (("position: 10 cm", "position: 12 cm"), f"{SLIDE}[1].position 10 -> 12 cm"),
        (
            ("{time: 0, position: 0}, {time: 0.5, position: 10 cm}", "{time: 0.5, position: 11 cm}"),
            f"{SLIDE}[0].time 0 -> 500 ms; {SLIDE}[0].position 0 -> 11 cm; {SLIDE}[1] removed",
        ),
        (("  - {pair: [forearm, person], clearance: {min: 2 cm}}\n", ""), "expect[0] removed"),
        (
            ("expect:\n", "expect:\n  - {pair: [base, person], contact: never}\n", "min: 5 cm", "min: 60 mm"),
            "expect[0] added; expect[2].min 5 -> 6 cm",
        ),
        (("noise: {std: 1 mm, seed: 7}, ", ""), f"{SENSOR}.signal.noise removed"),
        (("seed: 7", "seed: 8"), f"{SENSOR}.signal.noise.seed 7 -> 8"),
        ((", range: 3,", ","), f"{SENSOR}.range 3 m -> inf"),
        (("stop: [elbow]", "slow: {to: 0.2, joints: [elbow]}"), f"{GUARD}.stop removed; {GUARD}.slow added"),
        (
            ("{distance: tip, below: 30 cm}", "{pair: [forearm, person], clearance: {below: 3 cm}}"),
            f"{GUARD}.when {{distance: tip, below: 30 cm}} -> {{pair: [forearm, person], clearance: {{below: 3 cm}}}}",
        ),
        (
            ("prismatic, axis: [1, 0, 0]", "revolute", "10 cm}, {", "10 deg}, {", "20 cm}]", "20 deg}]"),
            "links.slide.joint.type prismatic -> revolute; "
            f"{SLIDE}[1].position 10 cm -> 10 deg; {SLIDE}[2].position 20 cm -> 20 deg",
        ),
    ],
)
def test_what_was_put_in_or_written_otherwise_is_told_as_what_it_is(edits, expected):
    text = TEXT
    for old, new in zip(edits[::2], edits[1::2], strict=True):
        assert text.count(old) == 1
        text = text.replace(old, new)
    assert "; ".join(input_changes(whole(TEXT), whole(text))) == expected


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("earth: 100 pF", "earth: 150 pF", "links.person.earth 100 -> 150 pF"),
        ("earth: 100 pF", "earth: floating", "links.person.earth 100 pF -> floating"),
        ("earth: 100 pF, ", "", "links.person.earth 100 pF -> grounded"),
        ("body: {", "trunk: {", "person/body renamed trunk"),
        (
            "body: {type: cylinder, radius: 20 cm",
            "trunk: {type: cylinder, radius: 2 cm",
            "person/body removed; person/trunk added",
        ),
    ],
)
def test_what_changed_in_a_part_is_told_with_the_words_of_the_language(old, new, expected):
    assert "; ".join(input_changes(whole(TEXT), whole(TEXT, PERSON.replace(old, new)))) == expected
