"""Notes on motions that frames alone may not see pass through others."""

import numpy as np
import pytest

from replay.geometry import primitives
from replay.scenario.load import load_sources
from replay.scenario.notes import notes
from replay.scenario.scene import build
from replay.scenario.speed_notes import _thickness

TEXT = """
version: 1
name: fast
rate: RATE
duration: 1
links:
  plate: {shapes: {sheet: {type: cuboid, size: [1 cm, 1, 1], pose: {xyz: [0.95, 0, 0]}}}}
  slide:
    joint: {type: prismatic, axis: [1, 0, 0]}
    shapes:
      block: {type: cube, size: 5 cm}
      sign: {type: cuboid, size: [1, 1, 1 mm], collide: false}
  turn:
    joint: {type: revolute, axis: [0, 0, 1], lower: -4, upper: 4}
    pose: {xyz: [0, 5, 0]}
    shapes: {rod: {type: cuboid, size: [2, 2 cm, 2 cm], pose: {xyz: [1, 0, 0]}}}
motion:
  points:
    slide: [{time: 0, position: 0}, {time: 1, position: 2}]
    turn: [{time: 0, position: 0}, {time: 1, position: 3}]
model: {collision: {between: sampled}}
"""


def fast(text, rate):
    return load_sources("f.yaml", {"f.yaml": text.replace("RATE", rate).encode()})


def test_what_moves_farther_in_a_frame_than_it_is_thick_is_noted_with_its_place():
    found = notes(fast(TEXT, "10 Hz"))
    assert [str(note).split(": frames alone")[0] for note in found] == [
        "f.yaml:11:7: links.slide.shapes.block moves up to 0.2 m in a frame and is 0.05 m thick",
        f"f.yaml:16:14: links.turn.shapes.rod moves up to {2 * np.hypot(2, 0.01) * np.sin(0.15):.3g} m in a frame "
        "and is 0.02 m thick",
    ]
    assert [note.split(" moves")[0] for note in build(fast(TEXT, "10 Hz")).notes] == [
        "links.slide.shapes.block",
        "links.turn.shapes.rod",
    ]


@pytest.mark.parametrize(
    ("text", "rate"),
    [
        (TEXT, "1000 Hz"),
        (TEXT.replace("sampled", "proven"), "10 Hz"),
        (TEXT.replace("model:", "collision: {pairs: none}\nmodel:"), "10 Hz"),
        (TEXT.split("motion:", maxsplit=1)[0] + "model: {collision: {between: sampled}}\n", "10 Hz"),
    ],
    ids=["many frames", "proven", "no pairs", "at rest"],
)
def test_no_other_motion_is_noted(text, rate):
    assert notes(fast(text, rate)) == []


def test_the_model_that_replaces_the_scenarios_own_decides():
    proven = fast(TEXT.replace("sampled", "proven"), "10 Hz")
    assert len(build(proven, model="thesis2015").notes) == 2


@pytest.mark.parametrize(
    ("solid", "thickness"),
    [
        (primitives.cube(0.3), 0.3),
        (primitives.cuboid((1, 2, 0.25)), 0.25),
        (primitives.plane((1, 2)), 0.0),
        (primitives.cylinder(0.1, 3.0, 1e-4), 0.2),
    ],
)
def test_thickness_is_the_least_width(solid, thickness):
    assert _thickness(solid) == pytest.approx(thickness, abs=1e-3)
