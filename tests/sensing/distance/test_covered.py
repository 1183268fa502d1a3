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
    assert result.notes[0] == (
        "distance sensor 'on' touches arm/box in every frame; let it ignore that link, or move it out"
    )


def test_what_is_touched_at_first_alone_is_not_noted(tmp_path):
    left = TEXT.replace("eye: {parent: arm}", "eye: {}").replace("30 s", "10 s")  # all in one block
    scenario = load_sources("mounted.yaml", {"mounted.yaml": left.encode()})
    result = run_case(CaseOrder(scenario, tmp_path, rrd=False), lambda done, total: None)
    assert not any("touches" in note for note in result.notes)


def test_a_sensor_inside_a_body_reads_its_surface_and_says_so(tmp_path):
    text = TEXT.replace(
        "away: {link: eye, pose: {xyz: [0, 0, 0.1]}", "away: {link: eye, ignore: [arm], pose: {xyz: [0, 0, 0.1]}"
    )
    text = text.replace("slab: {type: cuboid, size: [1, 1, 0.1]}", "slab: {type: cuboid, size: [1, 1, 0.4]}")
    scenario = load_sources("mounted.yaml", {"mounted.yaml": text.encode()})
    result = run_case(CaseOrder(scenario, tmp_path, rrd=False), lambda done, total: None)
    # the slab is from 0.3 to 0.7; the apexes go up at 6 cm/s for 10 s, `away` from 0.1 to the slab's very face
    assert result.notes[1:] == (
        "distance sensor 'away' is inside wall/slab in 66 of 301 frames; it reads the surface around it, from within",
        "distance sensor 'off' is inside wall/slab in 250 of 301 frames; it reads the surface around it, from within",
        "the distance sensor on sees arm/box of its own machine in the first frame; "
        "write ignore: [arm] below it, if it should not",
    )
