"""Reports of a comparison with a machine: each says what the comparison says, and can be read again."""

import dataclasses
import json
from xml.etree import ElementTree

import numpy as np
import pytest
from rerun.chunk import RrdReader

from replay.comparison.measured.measures import measures_of
from replay.comparison.measured.outputs import MeasuredOutputs
from replay.comparison.measured.report_text import lines, of_signal
from replay.comparison.measured.source import compare_recording
from replay.comparison.rules_file import read_rules


@pytest.fixture(scope="module")
def found(swing):
    return compare_recording(swing / "run" / "swing.mcap", rules=read_rules(swing / "tolerances.yaml"))


@pytest.fixture(scope="module")
def off(swing):
    return compare_recording(swing / "run" / "swing.mcap")


@pytest.fixture(scope="module")
def written(swing, off, tmp_path_factory):
    folder = tmp_path_factory.mktemp("reports")
    outputs = MeasuredOutputs(**{kind: folder / f"all.{kind}" for kind in ("html", "junit", "rrd")})
    outputs.visit(swing / "run" / "swing.mcap", off, False)
    outputs.write([off])
    return folder


def test_json_holds_everything(found):
    told = json.loads(json.dumps(found.as_json(), allow_nan=False))
    tip = told["signals"][0]
    assert tip["signal"] == "/distance/tip/distance" and tip["unit"] == "m" and not tip["decides"]
    assert tip["frames"] + tip["unmatched_frames"] <= told["frames"]
    assert tip["best_line"]["scale_interval"][0] < 1.0 < tip["best_line"]["scale_interval"][1]
    assert set(tip["detections"]) == {"both", "only_measured", "only_simulated"}


def test_text_is_the_same_every_time(swing, found):
    again = compare_recording(swing / "run" / "swing.mcap", rules=read_rules(swing / "tolerances.yaml"))
    assert list(lines(found, verbose=True)) == list(lines(again, verbose=True))


def test_who_detects_is_told_where_one_alone_does(found):
    told = [line for signal in found.signals for line in of_signal(signal)]
    assert not any(line.startswith("detected in") for line in told), "where both do there is nothing to tell"
    tip = found.signals[0]
    there, both = tip.matched.measured_there.copy(), tip.matched.both
    there[np.flatnonzero(tip.matched.enclosed & tip.matched.simulated_there)[:3]] = False
    missed = dataclasses.replace(tip, matched=dataclasses.replace(tip.matched, measured_there=there))
    (line,) = (line for line in of_signal(missed) if line.startswith("detected in"))
    assert line == f"detected in {both - 3} frames by both, 0 only as measured, 3 only as simulated"


def test_the_page_draws_each_signal_and_needs_nothing_else(written, off):
    page = (written / "all.html").read_text()
    assert page.count("<svg viewBox") == sum(2 - signal.matched.pair.steps for signal in off.signals)
    assert "residual, measured - simulated, over simulated /distance/tip/distance" in page
    assert "http" not in page.replace("http-equiv", "")


def test_junit_has_a_test_case_for_each_signal(written, off):
    suite = ElementTree.parse(written / "all.junit").getroot()[0]
    failed = {case.get("name") for case in suite if case.find("failure") is not None}
    assert [case.get("name") for case in suite] == [signal.signal.full_name for signal in off.signals]
    assert failed == {signal.signal.full_name for signal in off.signals if signal.decides}
    assert suite.get("failures") == str(len(failed))


def test_the_rerun_recording_holds_both_curves_and_the_residual(written):
    entities = {str(chunk.entity_path) for chunk in RrdReader(str(written / "all.rrd")).stream()}
    for side in ("/measured/values/", "/simulated/values/", "/residual/"):
        assert sum(entity.startswith(side) for entity in entities) == 3
    assert any(entity.startswith("/simulated/scene/arm") for entity in entities)


def test_numbers_of_a_night_have_names_without_slashes(found):
    named = {measure.name: measure for measure in measures_of(found)}
    assert named["measured.offset"].unit == "s"
    assert named["measured.distance.tip.distance.rms"].value == found.signals[0].statistics.rms
    assert not any("/" in name for name in named)
