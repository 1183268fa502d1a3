"""Sensors that a shape touches in every frame are noted, with the shape; those that meet something are not."""

from replay.batch.case import CaseOrder, run_case
from replay.scenario.load import load_sources

TEXT = """
version: 1
name: mounted
rate: 10 Hz
duration: 30 s
links:
  arm: {joint: {type: prismatic, lower: 0, upper: 1}, shapes: {box: {type: cube, size: 0.2, pose: {xyz: [0, 0, -0.1]}}}}
  eye: {parent: arm}
  wall: {pose: {xyz: [0, 0, 0.5]}, shapes: {slab: {type: cuboid, size: [1, 1, 0.1]}}}
motion: {points: {arm: [{time: 0, position: 0}, {time: 10, position: 0.6}]}}
sensors:
  distance:
    on: {link: eye, aperture: 90 deg}
    off: {link: eye, aperture: 90 deg, ignore: [arm]}
    away: {link: eye, pose: {xyz: [0, 0, 0.1]}, aperture: 90 deg}
"""


def test_a_sensor_on_a_part_that_it_does_not_ignore_is_noted(tmp_path):
    scenario = load_sources("mounted.yaml", {"mounted.yaml": TEXT.encode()})
    result = run_case(CaseOrder(scenario, tmp_path, rrd=False), lambda done, total: None)
    assert result.notes == (
        "distance sensor 'on' touches arm/box in every frame; let it ignore that link, or move it out",
    )
