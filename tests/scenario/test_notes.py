"""Notes: what the end of a scenario cuts off, and logs that end before it."""

import pytest

from replay.batch.case import CaseOrder, run_case
from replay.errors import ScenarioError
from replay.scenario.load import load_sources
from replay.scenario.notes import notes

TEXT = """
version: 1
name: late
rate: 10 Hz
duration: DURATION
links:
  box: {pose: {xyz: [1.5, 0, 0]}, shapes: {b: {type: cube, size: 1}}}
  slide:
    joint: {type: prismatic, axis: [1, 0, 0], lower: 0, upper: 2, velocity: 1, acceleration: 2}
    shapes: {c: {type: cube, size: 1}}
  turn: {parent: slide, joint: {type: continuous}}
  logged: {parent: slide, joint: {type: continuous}}
  guest: {joint: {type: free}}
motion:
  moves: [{to: {slide: 1}}, {to: {slide: 2}}]
  points: {turn: [{time: 0, position: 0}, {time: 4, position: 1}, {time: 5, position: 1}]}
  free: {guest: [{time: 0, xyz: [0, 0, 9]}, {time: 4.5, xyz: [0, 0, 8]}]}
  recorded: {file: log.csv, max_gap: 9 s}
expect: [{pair: [slide, box], contact: {between: [0.5 s, 5 s]}}]
"""


def scene(duration, log_end=5.0):
    log = f"time,logged\n7,0\n{7 + log_end},1\n".encode()
    return load_sources("late.yaml", {"late.yaml": TEXT.replace("DURATION", duration).encode(), "log.csv": log})


def test_nothing_is_noted_of_what_fits():
    assert notes(scene("5 s")) == []
    assert notes(scene("5.05 s")) == []  # whose last frame is at 5 s


def test_each_thing_that_does_not_fit_is_noted_once_with_its_place(tmp_path):
    scenario = scene("2 s", log_end=1.0)
    assert [str(note) for note in notes(scenario)] == [
        "late.yaml:16:50: motion.points.turn[1].time = 4 is after the scenario's end at 2 s, and 1 more",
        "late.yaml:17:52: motion.free.guest[1].time = 4.5 is after the scenario's end at 2 s",
        "late.yaml:15:29: motion.moves[1] ends at 3 s, after the scenario's end at 2 s",
        "late.yaml:18:20: motion.recorded.file = 'log.csv' ends before the scenario's last frame at 2 s:"
        " logged at 1 s; the last positions hold",
        "late.yaml:19:58: expect[0].contact.between[1] = '5 s' is after the scenario's end at 2 s",
    ]
    result = run_case(CaseOrder(scenario, tmp_path, rrd=False), lambda done, total: None)
    assert result.notes == tuple(note.message for note in notes(scenario))


def test_a_window_that_begins_after_the_end_can_only_be_a_mistake():
    with pytest.raises(ScenarioError, match=r"19:51: expect\[0\].contact.between\[0\] = '0.5 s' is after"):
        scene("0.4 s")
