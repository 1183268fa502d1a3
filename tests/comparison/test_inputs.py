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
