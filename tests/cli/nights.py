"""Nights for tests: their scenarios, the command, and what it has reported."""

import base64
import json
import re
import zlib
from functools import lru_cache
from pathlib import Path
from xml.etree import ElementTree

import xmlschema

from replay.cli.exit_codes import ExitCode
from replay.cli.main import run
from tests.batch import scenes

XSD = Path(__file__).parents[1] / "data" / "junit.xsd"


def verdicts_of(folder):
    return {name: entry["verdict"] for name, entry in json.loads((folder / "run.json").read_text())["verdicts"].items()}


@lru_cache(maxsize=1)
def _schema():
    return xmlschema.XMLSchema(XSD)


def junit_of(folder):
    """Return the verdicts of a valid junit.xml: pass, failure, error or skipped by name."""
    _schema().validate(str(folder / "junit.xml"))
    (suite,) = ElementTree.parse(folder / "junit.xml").getroot()
    cases = {case.get("name"): (case[0].tag if len(case) else "pass") for case in suite.iter("testcase")}
    for tag, attribute in (("failure", "failures"), ("error", "errors"), ("skipped", "skipped")):
        assert int(suite.get(attribute)) == list(cases.values()).count(tag)
    assert int(suite.get("tests")) == len(cases)
    return cases


def rows_of(folder):
    """Return the rows of a night's page in their order: name, and what the page's script shows of it."""
    packed = re.search('<div id="data" hidden>([^<]*)</div>', (folder / "index.html").read_text())[1]
    data = json.loads(zlib.decompress(base64.b64decode(packed)))
    return {
        name: {"address": address, "verdict": data["verdicts"][verdict][1], "message": message, "since": since}
        for name, address, verdict, _, _, message, since, *_ in data["rows"]
    }


def night(folder, output, *more, workers=1):
    """Run the command; a worker more takes longer to begin than a few of these scenarios take."""
    base = ["--baseline", str(folder / "base"), "-o", str(output), "--workers", str(workers), "--memory", "600MiB"]
    return run(["regress", str(folder / "in"), *base, *map(str, more)])


def prepare(folder, plain, bad, differing):
    """Write scenarios and accept them as they are; then change those that are to differ."""
    names = [f"{kind}_{k}" for kind, count in [("plain", plain), ("differ", differing)] for k in range(count)]
    for name in names:
        scenes.write(folder / "in", name)
    assert night(folder, folder / "first", "--rrd", "none") is ExitCode.FAILED  # there are no baselines yet
    assert set(verdicts_of(folder / "first").values()) == {"missing baseline"}
    assert run(["accept", str(folder / "first"), "--baseline", str(folder / "base"), "--yes", "--reason", "ok"]) == 0
    for k in range(differing):
        scenes.write(folder / "in", f"differ_{k}", distance=1.25)
    for kind in ("crash", "hang", "eat"):
        for k in range(bad):
            scenes.write(folder / "in", f"{kind}_{k}")


def check_verdicts(out, plain, bad, differing):
    """Check that run.json and junit.xml give each scenario the verdict of its name."""
    counted = {"plain": "same", "differ": "different", "crash": "crashed", "hang": "timeout", "eat": "memory"}
    found = verdicts_of(out)
    assert found == {name: counted[name.split("_")[0]] for name in found}
    assert len(found) == plain + 3 * bad + differing
    tags = {"same": "pass", "different": "failure"}
    assert junit_of(out) == {name: tags.get(verdict, "error") for name, verdict in found.items()}
