"""`measured` of a scenario: what is refused where it is written, and what of the log is kept."""

import pytest

from replay.errors import ScenarioError
from replay.scenario import measured_log
from replay.scenario.load import load, load_sources
from replay.scenario.source import Attached
from tests.comparison.measured import machine


def written(folder, text, name="swing.yaml", scenario=machine.SCENARIO):
    path = folder / name
    path.write_text(f"{scenario}measured:\n{text}")
    return path


def series_of(scenario):
    known = scenario.provenance
    library = Attached(known.main, known.sources)
    return measured_log.read(scenario, scenario.measured, library, known.measured, known.problem)


REFUSED = {
    "  file: gone.csv\n  signals: {/distance/tip/distance: {column: d}}": "measured.file = 'gone.csv' does not exist",
    "  file: ../run.csv\n  signals: {/distance/tip/distance: {column: d}}": "leads out of the scenario's folder",
    "  file: swing.yaml\n  signals: {/distance/tip/distance: {column: d}}": "is neither a .mcap nor a .csv file",
    "  file: run.csv\n  signals: {}": "must have at least 1 entry",
    "  file: run.csv\n  signals: {/distance/tip/distance: {}}": "names nothing in the log; give topic and field",
    "  file: run.csv\n  signals: {/distance/tip/distance: {topic: /a}}": "needs a field too",
    "  file: run.csv\n  signals: {TIP: {topic: /a, field: d}}": "no effect with this log; name column",
    "  file: run.csv\n  signals: {/distance/top/distance: {column: d}}": "did you mean '/distance/tip/distance'",
    "  file: run.csv\n  signals: {distance: {column: d}}": "is no signal's full name",
    "  file: run.csv\n  signals: {/tf/rotation/arm: {column: d}}": "is a rotation, which is no number",
    "  file: run.csv\n  signals: {/distance/tip/distance: {column: d1_mm, unit: mV}}": "is no unit of this signal",
    "  file: run.csv\n  signals: {/distance/tip/distance: {column: d1_mm, unit: ell}}": "is no unit; ",
    "  file: run.csv\n  signals: {/distance/tip/status: {column: d1_mm, unit: mm}}": "which has none; leave it out",
    "  file: run.csv\n  signals: {/distance/tip/distance: {column: d, clock: c}}": "is not one of `clocks`",
    "  file: run.csv\n  clocks: {c: {}}\n  signals: {/distance/tip/distance: {column: d}}": "is the clock of no signal",
    "  file: run.csv\n  max_gap: 0\n  signals: {/distance/tip/distance: {column: d}}": "must be > 0",
    "  file: run.csv\n  offset: soon\n  signals: {/distance/tip/distance: {column: d}}": "is none of estimate",
    "  file: run.csv\n  signals: {/distance/tip/distance: {column: d1_mm}}": "has no column 'time'",
    "  file: run.csv\n  time: {column: t_ms}\n  signals: {/distance/tip/distance: {column: d2}}": "has no column 'd2'",
    "  file: run.mcap\n  time: {unit: s}\n  signals: {TIP: {topic: /a, field: d}}": "effect with a .mcap",
    "  file: run.csv\n  time: {stamp: log}\n  signals: {/distance/tip/distance: {column: d}}": "no effect with a .csv",
    "  file: run.mcap\n  signals: {TIP: {topic: /a, field: d}}": "has no topic '/a'",
    "  file: run.mcap\n  signals: {/distance/tip/distance: {topic: /a, field: 'd['}}": "is no path to a value",
    "  file: cut.mcap\n  signals: {TIP: {topic: /a, field: d}}": "cut.mcap",
}


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("logs")
    machine.csv_log(folder / "run.csv")
    data = machine.mcap_log(folder / "run.mcap").read_bytes()
    (folder / "cut.mcap").write_bytes(data[: len(data) // 2])
    return folder


@pytest.mark.parametrize("text", REFUSED)
def test_what_is_wrong_is_one_line_with_its_place(logs, text):
    with pytest.raises(ScenarioError) as told:
        load(written(logs, text.replace("TIP", "/distance/tip/distance")))
    assert REFUSED[text] in str(told.value)
    assert str(told.value).count("\n") == 0
    assert str(told.value).startswith(f"{logs}/swing.yaml:")


def test_units_and_words_for_nothing_are_converted(logs):
    found = series_of(load(written(logs, f"  file: run.csv{machine.OF_CSV}")))
    tip, near = found.series["/distance/tip/distance"].value, found.series["/events/detection/tip"].value
    assert ((tip != tip) == (near == 0.0)).all()
    assert 0.5 < min(tip[tip == tip]) < 1.5


@pytest.mark.parametrize("offset", ["estimate", "-1.25 s"])
@pytest.mark.parametrize("kind", ["csv", "mcap"])
def test_what_is_attached_says_the_same(logs, kind, offset):
    text = machine.OF_CSV if kind == "csv" else machine.OF_MCAP
    first = load(written(logs, f"  file: run.{kind}{text}  offset: {offset}\n"))
    again = load_sources(first.main_source, first.sources)
    assert again.sources == first.sources
    assert again.provenance.originals == first.provenance.originals
    for name, series in series_of(first).series.items():
        assert series.time.tolist() == series_of(again).series[name].time.tolist()


def test_a_given_offset_keeps_the_scenarios_time_of_the_log(logs):
    far = load(written(logs, f"  file: run.csv{machine.OF_CSV}  offset: -1.25 s\n"))
    log = (logs / "run.csv").read_text()
    longer = logs / "longer.csv"
    longer.write_text(log + "".join(f"{t};-1;20;false\n" for t in range(20_000, 90_000, 20)))
    long = load(written(logs, f"  file: longer.csv{machine.OF_CSV}  offset: -1.25 s\n"))
    assert len(long.sources["longer.csv"]) < len(longer.read_bytes()) / 10
    mine, theirs = (series_of(one).series["/distance/tip/distance"].time for one in (far, long))
    assert mine.tolist() == theirs.tolist()


def test_three_seconds_beside_the_scenario_are_kept_so_that_an_offset_can_be_checked(logs):
    log = (logs / "run.csv").read_text() + "".join(f"{t};-1;20;false\n" for t in range(4_000, 90_000, 20))
    (logs / "dense.csv").write_text(log)
    kept = load(written(logs, f"  file: dense.csv{machine.OF_CSV}  offset: -1.25 s\n"))
    last = float(kept.sources["dense.csv"].decode().splitlines()[-1].split(";")[0])
    end = 1000.0 * (2.0 + 1.25 + 3.0 + 0.06)  # [ms] of the log: the scenario's end, the offset, beside it, a gap
    assert end <= last < end + 40.0  # one more is after it


MOVED = (
    machine.SCENARIO.split("motion:")[0]
    + "motion:\n  recorded: {RECORDED}\nsensors:"
    + machine.SCENARIO.split("sensors:")[1]
)


@pytest.mark.parametrize("kind", ["csv", "mcap"])
def test_one_log_may_move_the_scenario_and_measure_it(logs, kind):
    if kind == "csv":
        recorded = "file: run.csv, time: {column: t_ms, unit: ms}, joints: {swing: {name: 'angle [deg]'}}, start: 0.2"
        text = machine.OF_CSV
    else:
        recorded = "file: joints.mcap, start: 0.2"
        text = machine.OF_MCAP
        _with_joint_states(logs)
    name = "run.csv" if kind == "csv" else "joints.mcap"
    path = written(logs, f"  file: {name}{text}", scenario=MOVED.replace("RECORDED", recorded))
    first = load(path)
    again = load_sources(first.main_source, first.sources)
    assert again.sources == first.sources
    assert again.provenance.tracks["swing"].positions.tolist() == first.provenance.tracks["swing"].positions.tolist()
    for signal, series in series_of(first).series.items():
        assert series.value.tolist() == pytest.approx(series_of(again).series[signal].value.tolist(), nan_ok=True)


def _with_joint_states(folder):
    """Write a log with joint states that move the arm, and the machine's readings."""
    import json

    from mcap.writer import Writer

    with (folder / "joints.mcap").open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        schema = writer.register_schema("any", "jsonschema", b"{}")
        states = writer.register_channel("/joint_states", "json", schema)
        guard = writer.register_channel("/bodyguard", "json", schema)
        for k, time in enumerate(machine.times(80.0).tolist()):
            stamp = round((time + 0.5) * 1e9)
            angle = float(machine.position(time))
            state = {"name": ["swing"], "position": [angle]}
            writer.add_message(states, stamp, json.dumps(state).encode(), stamp)
            reading = {"data": [0, float(k)], "state": {"name": ["swing"], "position": [angle]}}
            writer.add_message(guard, stamp, json.dumps(reading).encode(), stamp)
        writer.finish()
