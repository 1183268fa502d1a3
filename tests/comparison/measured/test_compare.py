"""A recording beside a log whose truth is known in closed form."""

import math

import numpy as np
import pytest

from replay.comparison.difference import DiffVerdict
from replay.comparison.measured.source import MeasuredSource, compare_recording, compare_scenario, load_map
from replay.comparison.rules_file import read_rules
from replay.errors import ScenarioError, UndeterminedClockError
from replay.recording.record import record
from replay.scenario.load import load
from tests.comparison.measured import machine


def beside(swing, log, text, *, rules="tolerances.yaml"):
    mapping = log.parent / "map.yaml"
    mapping.write_text(machine.map_of(text))
    source = MeasuredSource.of_files(log, *load_map(mapping))
    recording = swing / "run" / "swing.mcap"
    scenario = load(swing / "swing.yaml")
    return compare_scenario(recording, scenario, source, rules=read_rules(swing / rules) if rules else None)


def of(found, name):
    return next(signal for signal in found.signals if signal.signal.full_name == name)


def test_the_offset_is_found_within_its_interval(swing):
    found = compare_recording(swing / "run" / "swing.mcap", rules=read_rules(swing / "tolerances.yaml"))
    low, high = found.clocks[0].told.offset_interval
    assert low <= machine.OFFSET <= high
    assert high - low < 2e-3
    assert found.verdict is DiffVerdict.SAME


def test_residuals_are_those_of_the_closed_form(swing):
    found = compare_recording(swing / "run" / "swing.mcap")
    matched = of(found, "/distance/tip/distance").matched
    truth = machine.distance(matched.pair.time[matched.frames])
    assert np.abs(matched.simulated - truth).max() < 1e-9
    assert of(found, "/distance/tip/distance").statistics.rms == pytest.approx(1e-3, rel=0.2)


def test_without_rules_all_must_be_equal(swing):
    assert compare_recording(swing / "run" / "swing.mcap").verdict is DiffVerdict.DIFFERENT


def test_a_log_that_counts_from_1970_begins_at_its_first_sample(swing, tmp_path):
    found = beside(swing, machine.mcap_log(tmp_path / "run.mcap"), machine.OF_MCAP)
    assert found.clocks[0].used.offset == pytest.approx(float(machine.times(80.0, seed=6)[0]), abs=2e-3)
    assert found.verdict is DiffVerdict.SAME
    assert of(found, "/distance/tip/distance").matched.both > 50


def test_detections_are_told_apart_and_shift_as_events(swing):
    found = compare_recording(swing / "run" / "swing.mcap", rules=read_rules(swing / "tolerances.yaml"))
    tip = of(found, "/distance/tip/distance")
    truth = np.isfinite(machine.distance(tip.matched.pair.time))
    assert abs(tip.matched.both - int(truth.sum())) <= 3
    assert all(event.allowed for item in tip.differences for event in item.events)


def test_frames_in_a_gap_have_no_measured_value(swing, tmp_path):
    log = machine.csv_log(tmp_path / "run.csv", gap=(0.3, 0.6))
    found = beside(swing, log, machine.OF_CSV)
    tip = of(found, "/distance/tip/distance")
    assert 29 <= tip.matched.n_unmatched_frames <= 35  # the gap, and up to a sample on either side
    assert not tip.matched.enclosed[35:55].any()


def test_a_scale_is_told_and_applied_only_on_request(swing, tmp_path):
    log = machine.csv_log(tmp_path / "run.csv", scale=1.05)
    text = machine.OF_CSV.replace("nothing: -1}", "nothing: -1, fit: FIT}")
    plain = of(beside(swing, log, text.replace("FIT", "false")), "/distance/tip/distance")
    fitted = of(beside(swing, log, text.replace("FIT", "true")), "/distance/tip/distance")
    low, high = plain.statistics.fit.scale_interval
    assert low <= 1.05 <= high
    assert plain.decides and plain.fit is None
    assert not fitted.decides and fitted.fit[0] == pytest.approx(1.05, abs=5e-3)


def test_a_unit_that_was_forgotten_is_hinted_at(swing, tmp_path):
    found = beside(swing, machine.csv_log(tmp_path / "run.csv"), machine.OF_CSV.replace("unit: mm, ", ""))
    assert any("1000" in hint for hint in of(found, "/distance/tip/distance").hints)


def test_a_given_offset_is_checked(swing, tmp_path):
    log = machine.csv_log(tmp_path / "run.csv")
    right = beside(swing, log, f"{machine.OF_CSV}  offset: {machine.OFFSET} s\n").clocks[0]
    wrong = beside(swing, log, f"{machine.OF_CSV}  offset: -1.2 s\n").clocks[0]
    assert right.given and wrong.given and not right.note
    assert "another offset: -1.25" in wrong.note or "another offset: -1.24" in wrong.note


def test_a_constant_signal_tells_no_offset_and_is_compared_with_a_given_one(swing, tmp_path):
    log = tmp_path / "run.csv"
    log.write_text("time,x\n" + "".join(f"{k / 50},0\n" for k in range(-20, 140)))
    text = "\n  signals: {/tf/translation.x/wall: {column: x}}\n"
    with pytest.raises(UndeterminedClockError, match="offset cannot be estimated"):
        beside(swing, log, text)
    found = beside(swing, log, f"{text}  offset: 0\n", rules="")
    assert found.verdict is DiffVerdict.SAME
    assert "not checked" in found.clocks[0].note


def test_signals_on_clocks_of_their_own(swing, tmp_path):
    log = machine.csv_log(tmp_path / "run.csv")
    text = machine.OF_CSV.replace('"angle [deg]"}', '"angle [deg]", clock: arm}')
    found = beside(swing, log, f"{text}  clocks: {{arm: {{offset: -1.25}}}}\n")
    assert [clock.name for clock in found.clocks] == ["", "arm"]
    assert of(found, "/joint_states/position/swing").clock == "arm"


def test_a_signal_that_lies_beside_the_scenario_is_missing(swing, tmp_path):
    log = machine.csv_log(tmp_path / "run.csv")
    found = beside(swing, log, f"{machine.OF_CSV}  offset: 3000 s\n")
    assert found.verdict is DiffVerdict.DIFFERENT
    assert len(found.difference.missing) == 3


def test_a_rule_that_expired_is_told(swing, tmp_path):
    import datetime

    rules = tmp_path / "rules.yaml"
    rules.write_text(
        'rules_version: 1\nrules: [{signal: "/measured/*", ignore: true, expires: 2020-01-01, reason: known then}]\n'
    )
    tolerances = read_rules(rules, today=datetime.date(2026, 1, 1))
    found = compare_recording(swing / "run" / "swing.mcap", rules=tolerances)
    assert [rule.reason for rule in found.difference.expired] == ["known then"]


def test_the_recording_alone_repeats_the_comparison(swing, tmp_path):
    here = compare_recording(swing / "run" / "swing.mcap").as_json()
    copy = tmp_path / "alone.mcap"
    copy.write_bytes((swing / "run" / "swing.mcap").read_bytes())
    assert compare_recording(copy).as_json() == here
    assert not any(isinstance(value, float) and math.isnan(value) for value in here["signals"][0].values())


def test_a_signal_that_the_recording_lacks_is_refused(swing, tmp_path):
    log = machine.csv_log(tmp_path / "run.csv")
    text = machine.OF_CSV.replace("/events/detection/tip", "/collision/clearance/a|b")
    with pytest.raises(ScenarioError, match=r"map\.yaml:6:3: signals\..* is no signal of the recording"):
        beside(swing, log, text)


def test_an_encoder_that_begins_anew_every_turn_is_on_the_turn_of_the_simulation(tmp_path):
    """The joint rests at 0 first, where noise makes it jump between 0 and 360 deg; later a turn is lost in a gap."""
    limited = "revolute, axis: [0, 1, 0], lower: -100 deg, upper: 100 deg"
    lines = machine.csv_log(tmp_path / "plain.csv").read_text().splitlines()
    rows = [line.split(";") for line in lines[1:]]
    turned = [[t, d, str(float(a) % 360.0 if k < 100 else float(a) + 720.0), n] for k, (t, d, a, n) in enumerate(rows)]
    assert sum(float(row[2]) > 359.0 for row in turned) > 5
    (tmp_path / "run.csv").write_text("\n".join([lines[0], *map(";".join, turned[:98] + turned[102:])]))
    measured = """
measured:
  file: run.csv
  time: {column: t_ms, unit: ms}
  signals: {/joint_states/position/swing: {column: "angle [deg]"}}
"""
    (tmp_path / "swing.yaml").write_text(machine.SCENARIO.replace(limited, "continuous, axis: [0, 1, 0]") + measured)
    found = compare_recording(record(load(tmp_path / "swing.yaml"), tmp_path / "run", rrd=False).mcap)
    low, high = found.clocks[0].told.offset_interval
    assert low <= machine.OFFSET <= high
    numbers = found.signals[0].statistics
    assert numbers.rms == pytest.approx(math.radians(0.05), rel=0.3)
    assert abs(numbers.largest) < math.radians(0.5)


def test_a_number_that_stands_for_nothing_is_hinted_at(swing, tmp_path):
    log = tmp_path / "run.csv"
    log.write_text(machine.csv_log(tmp_path / "plain.csv").read_text().replace(";-1;", ";0;"))
    text = machine.OF_CSV.replace(", nothing: -1", "")
    plain = of(beside(swing, log, text), "/distance/tip/distance")
    mapped = of(beside(swing, log, text.replace("unit: mm", "unit: mm, nothing: 0")), "/distance/tip/distance")
    assert "are exactly 0, far from all others" in plain.hints[0] and "state it as `nothing`" in plain.hints[0]
    assert (
        not mapped.hints and mapped.matched.only_measured + mapped.matched.only_simulated < plain.matched.only_measured
    )


@pytest.mark.parametrize("kind", ["csv", "mcap"])
def test_a_log_beside_a_scenario_is_read_once(swing, tmp_path, kind, monkeypatch):
    from replay.batch.compare import compare_all
    from replay.scenario import measured_log

    reads = []
    plain = measured_log.read
    monkeypatch.setattr(measured_log, "read", lambda *given: reads.append(given) or plain(*given))
    given = {"log": swing / f"run.{kind}", "mapping": swing / f"{kind}_map.yaml"}
    (case,) = compare_all(record(load(swing / "plain.yaml"), tmp_path, rrd=False).mcap, **given)
    assert case.found is not None
    assert len(reads) == 1
