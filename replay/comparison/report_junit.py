"""The difference as a JUnit report: a test case for each scenario, failed when it differs, an error when unreadable."""

from __future__ import annotations

from xml.etree import ElementTree

from replay.comparison import wording
from replay.comparison.difference import DiffVerdict
from replay.comparison.report_text import text
from replay.comparison.runs import Case, RunDifference
from replay.errors import printable

SUITE = "replay diff"


def junit(found: RunDifference) -> bytes:
    """Return the report as UTF-8 XML; no times or host, because a diff has none."""
    alone = [(name, "missing in the candidate") for name in found.missing]
    alone += [(name, "only in the candidate") for name in found.extra]
    failures = len(found.different) + sum(name not in found.ignored for name, _ in alone)
    counts = {
        "name": SUITE,
        "tests": str(len(found.cases) + len(found.unreadable) + len(alone)),
        "failures": str(failures),
        "errors": str(len(found.unreadable)),
        "skipped": str(len(found.ignored)),
    }
    root = ElementTree.Element("testsuites", {key: counts[key] for key in ("name", "tests", "failures", "errors")})
    suite = ElementTree.SubElement(root, "testsuite", counts)
    for case in found.cases:
        element = test_case(suite, case.name)
        if case.difference.verdict is DiffVerdict.DIFFERENT:
            message = wording.summary(case.difference)
            add(element, "failure", _details(found, case), message=message, type="different")
    for one in found.unreadable:
        add(test_case(suite, one.name), "error", one.error, message=one.error, type="unreadable")
    for name, where in alone:
        element = test_case(suite, name)
        if name in found.ignored:
            add(element, "skipped", "", message=f"{where}; a rule accepts it")
        else:
            add(element, "failure", f"scenario {name}: {where}", message=where, type="missing")
    return written(root)


def written(root: ElementTree.Element) -> bytes:
    """Return a report as UTF-8 XML."""
    ElementTree.indent(root)
    xml: bytes = ElementTree.tostring(root, encoding="utf-8", xml_declaration=True)
    return xml + b"\n"


def _details(found: RunDifference, case: Case) -> str:
    return text(RunDifference(found.baseline, found.candidate, (case,)))


def test_case(suite: ElementTree.Element, name: str, classname: str = SUITE) -> ElementTree.Element:
    """Add a test case to a suite."""
    attributes = {"name": printable(name), "classname": printable(classname), "time": "0"}
    return ElementTree.SubElement(suite, "testcase", attributes)


def add(element: ElementTree.Element, tag: str, content: str, **attributes: str) -> None:
    """Add what became of a test case to it."""
    child = ElementTree.SubElement(element, tag, {key: clean(value) for key, value in attributes.items()})
    child.text = clean(content)


def clean(value: str) -> str:
    """Return text for XML, which cannot hold most control characters, not even escaped; lines stay lines."""
    return printable(value, keep="\n\t")
