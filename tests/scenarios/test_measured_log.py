"""The shipped synthetic log of the machine: it can be made again, and what was put into it is found."""

import csv

import pytest

from replay.comparison.difference import DiffVerdict
from replay.comparison.measured.source import compare_recording
from replay.comparison.rules_file import read_rules
from replay.recording.record import record
from replay.scenario.load import load
from tests.scenarios import machine_log

pytestmark = pytest.mark.compiled  # phantoms of thousands of triangles


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    recording = record(load(machine_log.SCENARIO), tmp_path_factory.mktemp("run"), rrd=False).mcap
    return compare_recording(recording, rules=read_rules(machine_log.SCENARIO.parent / "rules.yaml"))


def test_the_log_can_be_made_again(tmp_path):
    made = machine_log.log_of(machine_log.machine(tmp_path)).splitlines()
    shipped = machine_log.LOG.read_text(encoding="utf-8").splitlines()
    assert made[:2] == shipped[:2]
    for mine, theirs in zip(csv.reader(made[2:]), csv.reader(shipped[2:]), strict=True):
        assert [float(cell) for cell in mine] == pytest.approx([float(cell) for cell in theirs], abs=1.001)


def test_the_offset_that_was_put_in_is_found(found):
    low, high = found.clocks[0].told.offset_interval
    assert low <= machine_log.OFFSET <= high
    assert high - low < 1e-3


def test_the_missed_detection_is_counted_and_all_else_is_within_the_rules(found):
    assert found.verdict is DiffVerdict.SAME
    left, right, _ = found.signals
    missed = round((machine_log.MISSED[1] - machine_log.MISSED[0]) * 60)
    assert missed - 1 <= left.matched.only_simulated <= missed + 2
    assert right.matched.only_simulated <= 1
