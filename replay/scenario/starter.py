"""A first scenario, to be read and changed: what `replay new` writes."""

from __future__ import annotations

from replay.errors import InvalidValue
from replay.language.fields import is_title

_TEXT = """\
# A scenario of replay: an arm that swings over a table and stops above it. Try:
#
#   replay validate {file}        is it valid?
#   replay run {file} -o out      run it
#   replay view {view}
#
# Numbers are SI and radians; a text carries its unit: 5 cm, 30 deg, 2 s. `replay schema` prints the JSON Schema, with
# which editors complete keys and check values.
version: 1
name: {name}
rate: 60 Hz
duration: 3 s

# Links are rigid parts. One without a parent stands in the world; a joint says how it moves there, shapes are its body.
links:
  table:
    shapes:
      top: {{type: cuboid, size: [1.2, 0.8, 4 cm], pose: {{xyz: [0.4, 0, 0.7]}}}}
  arm:
    pose: {{xyz: [0, 0, 1.6]}}
    joint:
      type: revolute          # or continuous, prismatic, free, fixed
      axis: [0, 1, 0]
      lower: -100 deg
      upper: 100 deg
      velocity: 60 deg/s      # moves go as fast as these limits let them
      acceleration: 120 deg/s^2
    shapes:
      rod: {{type: capsule, radius: 4 cm, height: 0.6, pose: {{xyz: [0, 0, -0.4]}}}}
  # body: {{shapes: {{skin: {{type: mesh, file: meshes/body.stl, scale: 0.001}}}}}}   # a file in millimetres

# Moves are done one after another; joints that a move does not name stay where they are.
motion:
  moves:
    - {{to: {{arm: 60 deg}}}}
    - {{to: {{arm: 20 deg}}}}

# A sensor looks along the +z of its pose and never senses its own link. Turned by 180 deg it looks down the arm.
sensors:
  distance:
    tip: {{link: arm, pose: {{xyz: [0, 0, -0.75], rpy: [180 deg, 0, 0]}}, aperture: 30 deg, range: 1.5}}

# What must hold, in frames and between them. Pass or fail, without a baseline.
expect:
  - {{pair: [arm, table], contact: never}}
  - {{distance: tip, detected: sometimes}}
"""


def starter(name: str, file: str) -> str:
    """Return the text of a first scenario.

    Args:
        name: of the scenario.
        file: that it is going to stand in, for the commands in its comments.

    Raises:
        InvalidValue: scenarios cannot have that name.
    """
    if not is_title(name) or not name.replace("_", "").replace("-", "").replace(".", "").isalnum():
        rule = "is no name for a scenario; write letters, digits, '_', '-' and '.', such as arm_over_table"
        raise InvalidValue("NAME", repr(name), rule)
    return _TEXT.format(name=name, file=file, view=f"out/{name}/{name}.rrd")
