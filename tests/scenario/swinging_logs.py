"""A scenario that a log of messages moves: an arm that swings, and a person that walks."""

import numpy as np

import replay
from replay.scenario.notes import notes
from tests.logs.made_logs import Said

SCENARIO = """
version: 1
name: again
rate: 50 Hz
duration: 1 s
links:
  base: {}
  arm: {parent: base, joint: {name: swing, type: KIND, axis: [0, 1, 0]LIMITS}}
  person: {parent: base, joint: {type: free}}
motion: {recorded: {file: log.mcap MORE}}
"""


STEP = 20_000_000


def swinging(n=60, begin=1_700_000_000 * 10**9, **more):
    times = begin + STEP * np.arange(n)
    return [Said(int(t), int(t), {"swing": float(np.sin(k * 0.05))}, **more) for k, t in enumerate(times)]


def load(folder, log, more="", kind="revolute", limits=""):
    (folder / "log.mcap").write_bytes(log)
    text = SCENARIO.replace(" MORE", f", {more}" if more else "").replace("KIND", kind)
    (folder / "again.yaml").write_text(text.replace("LIMITS", f", {limits}" if limits else ""))
    return replay.load(folder / "again.yaml")


def told(scenario):
    return [str(note).partition(": ")[2] for note in notes(scenario)]


def assert_same_track(a, b):
    a, b = (scenario.provenance.tracks["swing"] for scenario in (a, b))
    np.testing.assert_array_equal(a.seconds, b.seconds)
    np.testing.assert_array_equal(a.positions, b.positions)


def walking(n=60, frame="human", parent="map", begin=1_700_000_000 * 10**9):
    poses = []
    for k in range(n):
        half = 0.01 * k
        sign = -1.0 if k % 2 else 1.0  # a quaternion and its negative are one rotation
        quaternion = (0.0, 0.0, sign * np.sin(half), sign * np.cos(half))
        poses.append((begin + STEP * k, frame, parent, (1.0 + 0.02 * k, 2.0, 0.5, *quaternion)))
    return poses
