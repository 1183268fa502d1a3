"""The most memory of a task, where the system tells it only since the process began."""

import resource
from pathlib import Path
from types import SimpleNamespace

import pytest

from replay.batch import memory

MIB = 1 << 20


@pytest.mark.parametrize(("more", "sure"), [(0, False), (4 * MIB, False), (4 * MIB + 1024, True), (100 * MIB, True)])
def test_what_is_no_more_than_noise_may_be_of_an_earlier_task(monkeypatch, more, sure):
    monkeypatch.setattr(memory, "_REFERENCES", Path("/proc/none/clear_refs"))
    monkeypatch.setattr("sys.platform", "linux")
    resident = [300 * MIB]
    monkeypatch.setattr(resource, "getrusage", lambda who: SimpleNamespace(ru_maxrss=resident[0] // 1024))
    meter = memory.PeakMeter()
    resident[0] += more
    assert meter.read() == memory.Peak(300 * MIB + more, sure)


def test_a_mac_tells_bytes(monkeypatch):
    monkeypatch.setattr(memory, "_REFERENCES", Path("/proc/none/clear_refs"))
    monkeypatch.setattr("sys.platform", "darwin")
    monkeypatch.setattr(resource, "getrusage", lambda who: SimpleNamespace(ru_maxrss=300 * MIB))
    assert memory.PeakMeter().read() == memory.Peak(300 * MIB, sure=False)
