"""A difference as text, JSON, JUnit, HTML and a rerun overlay."""

import dataclasses
import json
from html.parser import HTMLParser
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pyarrow as pa
import pytest
from rerun.chunk import RrdReader

from replay.comparison.difference import DiffVerdict
from replay.comparison.outputs import Outputs
from replay.comparison.overlay import write_overlay
from replay.comparison.plots import Curves, plots
from replay.comparison.report_html import html
from replay.comparison.report_junit import junit
from replay.comparison.report_text import text
from replay.comparison.rules import Rule, Rules, Tolerance
from replay.comparison.runs import Case, RecordingPair, RunDifference, diff_pair, diff_runs
from replay.comparison.wording import summary
from replay.errors import InvalidValue, RecordingError, WriteError
from tests.comparison import made_up
from tests.comparison.changed import BASELINE, CANDIDATE, compared

PAIR = "arm/beam|stand/base"
DIGEST, OTHER = (made.provenance.files["meshes/beam.stl"] for made in (BASELINE, CANDIDATE))
HOSTILE = "<script>alert(1)</script>\x07\x1b[2J\x9b\u202e\udcff&'\""
SHOWN = "<script>alert(1)</script>\\x07\\x1b[2J\\x9b\\u202e\\udcff&'\""


def test_text_is_short_and_says_where_and_how_much():
    found, _ = compared()
    lines = text(found).splitlines()
    assert lines == [
        "different: made_up: 1 change of the scene, 6 of 55 signals changed, 1 difference of provenance",
        "  worst: contact 33.3 ms later: arm/beam | stand/base; 3 more readings",
        "  provenance (does not decide)",
        f"    libraries.numpy: {np.__version__} -> 9.9",
        "  scene",
        f"    /files/meshes/beam.stl: sha256 {DIGEST[:12]}... -> sha256 {OTHER[:12]}...",
        f"  changed: /collision/evaluated/{PAIR}",
        "    1 event shifted; 2 of 100 frames differ",
        "    evaluation of the clearance begins 2 frames later (+33.33 ms): "
        "frame 20 (0.333333333 s) -> frame 22 (0.366666666 s)",
        f"  changed: /collision/level/{PAIR}",
        "    1 event shifted; 2 of 100 frames differ",
        "    contact begins 2 frames later (+33.33 ms): frame 40 (0.666666666 s) -> frame 42 (0.7 s)",
        "  changed: /distance/left/distance",
        "    1 of 100 frames differ; first frame 20 (0.333333333 s)",
        "    1 frame with NaN in place of a number, or the reverse",
        "  changed: /distance/right/distance",
        "    20 of 100 frames differ; first frame 20 (0.333333333 s)",
        *lines[17:19],
        "  changed: /joint_states/position/lift",
        "    1 of 100 frames differ; first frame 3 (0.05 s)",
        "    worst abs 2.78e-17 m (rel 1.58e-16) at frame 3 (0.05 s): 0.1755560760690452 -> 0.17555607606904522 m",
        "  changed: /tf/rotation/arm",
        "    4 of 100 frames differ; first frame 5 (0.083333333 s)",
        lines[-1],
    ]
    assert lines[17].startswith("    worst abs 0.001 m at frame ")
    assert lines[18].startswith("    worst rel 0.00174 at frame 39 (0.65 s): 0.57496115588506")


def test_verbose_text_lists_what_the_rules_accept_and_why():
    rules = Rules((Rule(("/joint_states/*",), Tolerance(abs=1e-12), "a known last digit", "https://x/1", None, "r:1"),))
    found, _ = compared(rules=rules)
    assert "within the rules: " not in text(found)
    long = text(found, verbose=True)
    assert "  within the rules: /joint_states/position/lift\n" in long
    assert "rule abs 1e-12 (r:1): a known last digit (https://x/1)" in long


def test_text_tells_the_provenance_of_a_night_once():
    found, _ = compared()
    other = RecordingPair(
        BASELINE, made_up.with_provenance(CANDIDATE, libraries={**BASELINE.provenance.libraries, "numpy": "8.8"})
    )
    last = Case("last", Path("a.mcap"), Path("b.mcap"), diff_pair(other, rules=None))
    lines = text(RunDifference("a", "b", (*found.cases, *found.cases, last))).splitlines()
    told = [k for k, line in enumerate(lines) if line.startswith("  provenance (does not decide)")]
    assert [lines[k].partition(")")[2] for k in told] == ["", ": as above", ""]
    assert [sum(line == f"    libraries.numpy: {np.__version__} -> {v}" for line in lines) for v in ("9.9", "8.8")] == [
        1,
        1,
    ]


def test_what_rules_accept_is_called_ignored_in_the_line_of_a_scenario():
    shorter = dataclasses.replace(made_up.only_frames(BASELINE, np.arange(99)), collision=None)
    accepted = Rules((Rule(("/collision/*", "/frames"), Tolerance(ignore=True), "known"),))
    assert summary(diff_pair(RecordingPair(BASELINE, shorter), rules=accepted)) == (
        "1 frame in one run only (ignored), 8 signals missing (ignored)"
    )
    assert (
        summary(diff_pair(RecordingPair(BASELINE, shorter), rules=None)) == "1 frame in one run only, 8 signals missing"
    )


def test_what_differs_is_not_lost_among_what_is_the_same():
    numpy = made_up.with_provenance(BASELINE, libraries={**BASELINE.provenance.libraries, "numpy": "9.9"})
    same = [
        Case(name, Path("a.mcap"), Path("b.mcap"), diff_pair(RecordingPair(BASELINE, numpy), rules=None))
        for name in ("a", "b")
    ]
    (different,) = compared(name="c")[0].cases
    found = RunDifference("a", "b", (*same, different))
    assert [line for line in text(found).splitlines() if "provenance" in line] == [
        "same: a: 1 difference of provenance",
        "  provenance (does not decide)",
        "same: b: 1 difference of provenance",
        "different: c: 1 change of the scene, 6 of 55 signals changed, 1 difference of provenance",
        "  provenance (does not decide): as above",
    ]
    page = html(found, {})
    assert page.index("<code>c</code>") < page.index("<code>a</code>") < page.index("<code>b</code>")


def test_json_holds_all_of_it_and_is_json():
    found, _ = compared()
    values = json.loads(json.dumps(found.as_json(), allow_nan=False))
    (case,) = values["cases"]
    signals = {signal["signal"]["full_name"]: signal for signal in case["signals"]}
    assert (values["verdict"], case["verdict"], case["compared"]) == ("different", "different", 55)
    assert signals[f"/collision/level/{PAIR}"]["events"][0]["shift_frames"] == 2
    assert signals["/distance/left/distance"]["nan"] == 1
    assert signals["/distance/right/distance"]["worst_abs"]["error"] == pytest.approx(1e-3)
    assert case["provenance"] == [{"name": "libraries.numpy", "baseline": np.__version__, "candidate": "9.9"}]


def test_names_cannot_escape_from_a_report():
    found, pair = compared(HOSTILE)
    assert SHOWN in text(found)
    root = ElementTree.fromstring(junit(found))
    assert root.find("testsuite/testcase").get("name") == SHOWN
    page = html(found, {HOSTILE: plots(found.cases[0].difference, pair)})
    assert "<script" not in page.lower()
    assert page.replace("\n", "").isprintable()
    assert "&lt;script&gt;alert(1)" in page


def test_junit_counts_failures_and_skips(folders):
    rules = Rules((Rule(("/scenarios/new",), Tolerance(ignore=True), "new"),))
    found = diff_runs(folders / "a", folders / "b", rules=rules)
    suite = ElementTree.fromstring(junit(found)).find("testsuite")
    assert {key: suite.get(key) for key in ("tests", "failures", "errors", "skipped")} == {
        "tests": "4",
        "failures": "2",
        "errors": "0",
        "skipped": "1",
    }
    outcome = {case.get("name"): [child.tag for child in case] for case in suite.iter("testcase")}
    assert outcome == {"same": [], "other": ["failure"], "gone": ["failure"], "new": ["skipped"]}
    assert "contact begins 2 frames later" in suite.find("testcase[@name='other']/failure").text


class Page(HTMLParser):
    """Collects tags and attributes, and that every element is closed in order."""

    VOID = frozenset({"meta", "br"})

    def __init__(self, page):
        super().__init__()
        self.tags, self.open = [], []
        self.feed(page)
        assert self.open == []

    def handle_starttag(self, tag, attributes):
        self.tags.append((tag, dict(attributes)))
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attributes):
        self.tags.append((tag, dict(attributes)))

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


def test_the_page_needs_nothing_else_and_draws_every_signal():
    found, pair = compared()
    drawn = plots(found.cases[0].difference, pair)
    page = Page(html(found, {"made_up": drawn}))
    assert not [tag for tag, _ in page.tags if tag in ("script", "link", "img", "iframe", "object")]
    assert not [value for _, pairs in page.tags for key, value in pairs.items() if key in ("src", "href")]
    labels = [pairs["aria-label"] for tag, pairs in page.tags if tag == "svg" and "aria-label" in pairs]
    assert len(labels) == len(drawn) == 6
    paths = [pairs["d"] for tag, pairs in page.tags if tag == "path"]
    assert all(path.startswith("M") and "nan" not in path and "inf" not in path for path in paths)


def test_drawings_keep_peaks_and_gaps_of_long_signals():
    long = made_up.recording(60_000)

    def spike(recording):
        recording.joint_positions[41_234, 0] = 1e3
        recording.joint_positions[10_000:30_000, 1] = np.nan
        recording.capacitive.capacitance[7, 0] = np.inf
        recording.joint_velocities[9, 0] = 1.7e308

    pair = RecordingPair(long, made_up.altered(long, spike))
    drawn = {plot.signal: plot for plot in plots(diff_pair(pair, rules=None), pair)}
    assert len(drawn) == 4
    position = drawn["/joint_states/position/lift"]
    assert position.high == 1e3
    assert len(position.candidate) < 40_000
    assert drawn["/joint_states/position/turn"].candidate.count("M") == 2
    curve = Curves(pair).curve(diff_pair(pair, rules=None).signals[0])
    assert len(curve.seconds) == 60_000


def test_run_folders_correspond_by_scenario(folders):
    seen = []
    found = diff_runs(folders / "a", folders / "b", visit=lambda case, pair: seen.append(case.name))
    assert (found.missing, found.extra, seen) == (("gone",), ("new",), ["other", "same"])
    assert [case.name for case in found.different] == ["other"]
    assert found.verdict is DiffVerdict.DIFFERENT
    assert text(found).endswith("different: 1 of 2 scenarios differ, 1 missing, 1 extra\n")
    with pytest.raises(InvalidValue, match="must be a folder"):
        diff_runs(folders / "a", folders / "b" / "same" / "same.mcap")
    (folders / "none").mkdir()
    with pytest.raises(RecordingError, match="holds no recording"):
        diff_runs(folders / "a", folders / "none")


def test_the_overlay_shows_both_runs_and_the_moments(folders, tmp_path):
    pairs = {}
    found = diff_runs(folders / "a", folders / "b", visit=lambda case, pair: pairs.setdefault(case.name, pair))
    path = tmp_path / "overlay.rrd"
    write_overlay(path, found.different[0], pairs["other"])
    columns = {}
    for chunk in RrdReader(str(path)).stream():
        batch = chunk.to_record_batch()
        for name, column in zip(batch.schema.names, batch.columns, strict=True):
            if ":" in name and pa.types.is_list(column.type):
                columns[str(chunk.entity_path), name.rpartition(":")[2]] = column.to_pylist()
    entities = {entity for entity, _ in columns}
    assert {"/baseline/scene/arm/beam", "/candidate/scene/arm/beam", "/summary"} <= entities
    assert columns["/baseline/scene/arm/beam", "vertex_normals"]  # without them the viewer draws no shades
    names = [v for (entity, kind), v in columns.items() if kind == "names" and entity.endswith(r"right\/distance")]
    assert sorted(names) == [[["baseline: right"]], [["candidate: right"]], [["right"]]]
    assert columns["/baseline/scene/arm/beam", "albedo_factor"] != columns["/candidate/scene/arm/beam", "albedo_factor"]
    errors = next(v for (entity, kind), v in columns.items() if "right" in entity and entity.startswith("/difference"))
    assert len(errors) == 100
    texts = [row[0] for row in columns["/difference/moments", "text"]]
    assert texts[0].startswith("first difference: /joint_states/position/lift")
    assert any("contact begins 2 frames later" in line for line in texts)


def test_a_report_that_cannot_be_written_is_an_error(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(WriteError):
        Outputs(junit=tmp_path / "file" / "d.xml").write(compared()[0])
