"""A scenario for the commands: an arm that swings in front of a wall."""

SCENARIO = """
version: 1
name: swing
rate: 60 Hz
duration: 1 s
tags: [quick]
links:
  wall: {shapes: {slab: {type: cuboid, size: [0.1, 2, 2], pose: {xyz: [1.2, 0, 0]}}}}
  arm:
    joint: {name: swing, type: revolute, axis: [0, 1, 0], lower: -100 deg, upper: 100 deg}
    shapes: {rod: {type: cuboid, size: [0.1, 0.1, 1], pose: {xyz: [0, 0, 0.5]}}}
motion:
  points: {swing: [{time: 0, position: 0}, {time: 1, position: 60 deg}]}
sensors:
  distance: {tip: {link: arm, pose: {xyz: [0, 0, 1], rpy: [0, 90 deg, 0]}, aperture: 20 deg, range: 3}}
expect:
  - {pair: [arm, wall], contact: EXPECTED}
"""
