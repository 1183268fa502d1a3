"""A regression as a JUnit report: failed when it differs, an error when there is no result, skipped when filtered."""

from __future__ import annotations

import platform
from collections.abc import Iterator
from xml.etree import ElementTree

import replay
from replay.batch.case_folder import said
from replay.batch.judged import Judged, Regression, RegressVerdict
from replay.comparison.report_junit import clean
from replay.errors import printable

SUITE = "replay.regress"
FAILURES = (RegressVerdict.DIFFERENT, RegressVerdict.BROKEN, RegressVerdict.MISSING)


def junit(found: Regression) -> bytes:
    """Return the report as UTF-8 XML that is valid by the schema of Apache Ant's reports."""
    failures = found.count(*FAILURES)
    skipped = sum(item.verdict.left_out for item in found.judged)
    fine = sum(item.verdict.fine for item in found.judged)
    root = ElementTree.Element("testsuites")
    suite = ElementTree.SubElement(
        root,
        "testsuite",
        {
            "id": "0",
            "package": "replay",
            "name": SUITE,
            "timestamp": found.run.started.strftime("%Y-%m-%dT%H:%M:%S"),
            "hostname": clean(platform.node()) or "localhost",
            "tests": str(len(found.judged)),
            "failures": str(failures),
            "errors": str(len(found.judged) - fine - failures),
            "skipped": str(skipped),
            "time": f"{found.run.seconds:.3f}",
        },
    )
    properties = ElementTree.SubElement(suite, "properties")
    for name, value in (
        ("replay", replay.__version__),
        ("baseline", str(found.baseline)),
        ("rules", found.rules or "none"),
        ("unused baselines", ", ".join(found.unused)),
        ("interrupted", "yes" if found.run.interrupted else "no"),
    ):
        ElementTree.SubElement(properties, "property", {"name": name, "value": clean(value)})
    for item in found.judged:
        _case(suite, found, item)
    ElementTree.SubElement(suite, "system-out").text = clean("\n".join(_between_frames(found)))
    ElementTree.SubElement(suite, "system-err")
    ElementTree.indent(root)
    xml: bytes = ElementTree.tostring(root, encoding="utf-8", xml_declaration=True)
    return xml + b"\n"


def _between_frames(found: Regression) -> Iterator[str]:
    for item in found.judged:
        if item.result is not None:
            yield from (f"{printable(item.name)}: {line}" for line in item.result.between_frames)


def _case(suite: ElementTree.Element, found: Regression, item: Judged) -> None:
    seconds = 0.0 if item.result is None else item.result.seconds
    attributes = {"name": printable(item.name), "classname": SUITE, "time": f"{seconds:.3f}"}
    case = ElementTree.SubElement(suite, "testcase", attributes)
    if item.verdict.left_out:
        ElementTree.SubElement(case, "skipped", {"message": clean(item.message)})
    elif not item.verdict.fine:
        tag = "failure" if item.verdict in FAILURES else "error"
        problem = ElementTree.SubElement(case, tag, {"message": clean(item.message), "type": item.verdict.value})
        problem.text = clean(_details(found, item))


def _details(found: Regression, item: Judged) -> str:
    if item.finding is not None and item.finding.report and item.verdict is RegressVerdict.DIFFERENT:
        return item.finding.report
    if item.finding is not None and item.finding.effects:
        return "\n".join([item.message, *map(str, item.finding.effects), f"cause: {item.finding.causes.name}"])
    return "\n".join([item.message, *said(found.run.directory / item.name)[-50:]])
