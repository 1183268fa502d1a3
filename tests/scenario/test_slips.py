"""What is valid and rarely meant is noted: angles in degrees without a unit, contact at the start, own machines."""

import pytest

from replay.batch.case import CaseOrder, run_case
from replay.scenario.load import load_sources
from replay.scenario.notes import notes

TEXT = """
version: 1
name: slips
rate: 10 Hz
duration: 1 s
links:
  base: {shapes: {foot: {type: cuboid, size: [0.4, 0.4, 0.2]}}}
  arm:
    parent: base
    pose: {xyz: [0, 0, 0.5]}
    joint: {type: revolute, axis: [0, 1, 0], lower: LOWER, upper: 90 deg, velocity: 1, acceleration: 1}
    shapes: {rod: {type: cylinder, radius: 5 cm, height: 0.6, pose: {xyz: [0, 0, 0.3]}}}
  box: {pose: {xyz: [BOX, 0, 0]}, shapes: {side: {type: cube, size: 0.2}}}
motion: {moves: [{to: {arm: TO}}]}
sensors: {distance: {eye: {link: arm, pose: {xyz: [0, 0, 0.2], rpy: [180 deg, 0, 0]}, aperture: 20 deg, range: 2}}}
"""


def scenario(lower="-90 deg", to="0.2", box="2"):
    text = TEXT.replace("LOWER", lower).replace("TO", to).replace("BOX", box)
    return load_sources("s.yaml", {"s.yaml": text.encode()})


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        ({}, []),
        ({"lower": "-90"}, ["links.arm.joint.lower = -90 is in rad and more than a turn; write '-90 deg' if"]),
        ({"lower": "-400 deg"}, []),
        ({"lower": "-.inf"}, []),
        ({"lower": "-6.2"}, []),
        ({"lower": "-700", "to": "-45"}, ["links.arm.joint.lower = -700", "motion.moves[0].to.arm = -45"]),
    ],
)
def test_angles_beyond_a_turn_without_a_unit(values, expected):
    found = [note.message for note in notes(scenario(**values)) if "rad and more" in note.message]
    assert len(found) == len(expected)
    assert all(said.startswith(begin) for said, begin in zip(found, expected, strict=True)), found


def said(scene, tmp_path):
    return run_case(CaseOrder(scene, tmp_path / "s", rrd=False), lambda *_: None).notes


def test_contact_in_the_first_frame_and_a_sensor_that_sees_its_own_machine(tmp_path):
    own = "the distance sensor eye sees base/foot of its own machine in the first frame; write ignore: [base] below it"
    assert [note.startswith(own) for note in said(scenario(), tmp_path)] == [True]
    touching = said(scenario(box="0.25"), tmp_path)
    assert touching[0].startswith("1 pair is in contact in the first frame (base/foot | box/side); `replay validate")
    text = TEXT.replace("range: 2", "range: 2, ignore: [base]").replace("LOWER", "-1").replace("TO", "0.1")
    quiet = load_sources("s.yaml", {"s.yaml": text.replace("BOX", "2").encode()})
    assert said(quiet, tmp_path) == ()
