"""A comparison with the machine as a JUnit report: a test case for each signal, failed when it is off."""

from __future__ import annotations

from collections.abc import Sequence
from xml.etree import ElementTree

from replay.comparison.measured.report_text import of_signal
from replay.comparison.measured.result import MeasuredComparison
from replay.comparison.report_junit import add, test_case, written
from replay.errors import printable

SUITE = "replay compare"


def junit(found: Sequence[MeasuredComparison]) -> bytes:
    """Return the report as UTF-8 XML; no times or host, because a comparison has none."""
    root = ElementTree.Element("testsuites")
    for one in found:
        suite = ElementTree.SubElement(root, "testsuite")
        absent = {signal.full_name for item in one.difference.missing if item.decides for signal in item.signals}
        failures = 0
        for signal in one.signals:
            name = signal.signal.full_name
            case = test_case(suite, name, f"{SUITE}.{one.difference.name}")
            if signal.decides or name in absent:
                failures += 1
                told = list(of_signal(signal, verbose=True)) or ["no sample in the scenario's time"]
                message = "off" if signal.decides else "no sample in the scenario's time"
                add(case, "failure", "\n".join(told), message=message, type="different")
        counts = {"tests": str(len(one.signals)), "failures": str(failures), "errors": "0", "skipped": "0"}
        suite.attrib.update({"name": printable(f"{SUITE}: {one.difference.name}"), **counts})
    return written(root)
