"""CSV logs as people have them, times to the nanosecond, and what replay itself exports."""

import json

import numpy as np
import pytest

import replay
from replay.errors import ScenarioError
from replay.recording.export import export
from replay.recording.record import record

SCENARIO = """
version: 1
name: table
rate: 20 Hz
duration: 1 s
links:
  base: {}
  arm: {parent: base, joint: {type: revolute, axis: [0, 1, 0]}}
motion: {recorded: {file: log.csv MORE}}
"""
TIME = [0, 400_000_001, 1_000_000_000]
ARM = [0.0, 0.5, 1.25]


def load(folder, text, more=""):
    (folder / "log.csv").write_bytes(text if isinstance(text, bytes) else text.encode())
    (folder / "table.yaml").write_text(SCENARIO.replace(" MORE", f", {more}" if more else ""))
    return replay.load(folder / "table.yaml")


GOOD = {
    "comma": ("time,arm\n0,0\n0.400000001,0.5\n1,1.25\n", ""),
    "semicolon and decimal comma": ("time;arm\n0;0\n0,400000001;0,5\n1;1,25\n", ""),
    "semicolon and decimal point": ("time;arm\n0;0\n0.400000001;0.5\n1;1.25\n", ""),
    "tab and decimal comma": ("time\tarm\n0\t0\n0,400000001\t0,5\n1\t1,25\n", ""),
    "bars": ("time|arm\n0|0\n0.400000001|0.5\n1|1.25\n", ""),
    "stated": ("time;arm\n0;0\n0,400000001;0,5\n1;1,25\n", "separator: ;, decimal: ','"),
    "spreadsheet's own hint": ("sep=;\ntime;arm\n0;0\n0,400000001;0,5\n1;1,25\n", ""),
    "quoted decimal commas": ('time,arm\n"0","0"\n"0,400000001","0,5"\n1,"1,25"\n', ""),
    "byte order mark and CRLF": ("\ufefftime,arm\r\n0,0\r\n0.400000001,0.5\r\n1,1.25\r\n", ""),
    "old line ends": ("time,arm\r0,0\r0.400000001,0.5\r1,1.25\r", ""),
    "empty headings at the end": ("time,arm,,\n0,0,,\n0.400000001,0.5,,\n1,1.25,,\n", ""),
    "shorter lines below those": ("time,arm,,\n0,0\n0.400000001,0.5,\n1,1.25,,,,\n", ""),
    "a table's index without heading": (",time,arm\n0,0,0\n1,0.400000001,0.5\n2,1,1.25\n", ""),
    "a column that is empty": ("time,arm,note\n0,0,\n0.400000001,0.5,\n1,1.25,\n", ""),
    "comments": ("# a robot\n\ntime,arm\n# begin\n0,0\n\n0.400000001,0.5\n% end\n1,1.25\n", ""),
    "headings in a comment": ("# made by numpy\n# time,arm\n0,0\n0.400000001,0.5\n1,1.25\n", ""),
    "headings of rostopic": ("%time,arm\n0,0\n400000001,0.5\n1000000000,1.25\n", "time: {unit: ns}"),
    "empty lines of a spreadsheet": ("time,arm\n0,0\n0.400000001,0.5\n1,1.25\n,\n,\n", ""),
    "a line twice": ("time,arm\n0,0\n0.400000001,0.5\n0.400000001,0.5\n1,1.25\n", ""),
    "unit in the heading": ("time [ms],arm\n0,0\n400.000001,0.5\n1000,1.25\n", ""),
    "units in both headings": ("time [us],arm [mrad]\n0,0\n400000.001,500\n1000000,1250\n", ""),
    "angle's unit in the heading": (
        "time,arm angle [deg]\n0,0\n0.400000001,28.64788975654116\n1,71.6197243913529\n",
        "joints: {arm: {name: 'arm angle [deg]'}}",
    ),
    "epoch": ("time,arm\n1700000000.1,0\n1700000000.500000001,0.5\n1700000001.1,1.25\n", ""),
    "epoch, integers": (
        "t,arm\n1700000000100000000,0\n1700000000500000001,0.5\n1700000001100000000,1.25\n",
        "time: {column: t, unit: ns}",
    ),
    "scientific": ("time,arm\n0e0,0\n4.00000001e-1,5e-1\n.1e+1,125e-2\n", ""),
    "dates": (
        "time,arm\n2024-05-01T12:00:00Z,0\n2024-05-01T12:00:00.400000001Z,0.5\n2024-05-01T12:00:01Z,1.25\n",
        "",
    ),
    "dates in another zone": (
        "time;arm\n2024-05-01 23:59:59,8+02:00;0\n2024-05-02 00:00:00,200000001+0200;0,5\n2024-05-01 22:00:00,8Z;1,25",
        "",
    ),
    "dates without zone": (
        "time,arm\n2024-02-29 12:00:00,0\n2024-02-29 12:00:00.400000001,0.5\n2024-02-29 12:00:01,1.25\n",
        "",
    ),
    "a first line before the clock": ("time,arm\n0,9\n1700000000,0\n1700000000.400000001,0.5\n1700000001,1.25\n", ""),
}


@pytest.mark.parametrize("kind", GOOD)
def test_a_table_is_read_as_it_is_meant(tmp_path, kind):
    text, more = GOOD[kind]
    scenario = load(tmp_path, text, more)
    track = scenario.provenance.tracks["arm"]
    np.testing.assert_array_equal(track.seconds, np.array(TIME) / 1e9)
    np.testing.assert_allclose(track.positions, ARM, rtol=1e-15)
    (tmp_path / "log.csv").write_bytes(scenario.sources["log.csv"])
    again = replay.load(tmp_path / "table.yaml")
    assert again.sources == scenario.sources
    np.testing.assert_array_equal(again.provenance.tracks["arm"].positions, track.positions)


BAD = {
    "separated by spaces": ("time arm\n0 0\n", "", "its cells seem to be separated by spaces: separate them by commas"),
    "without headings": ("0,0\n1,1\n", "", "its columns are ['0', '0']: numbers; write headings above them"),
    "another heading": ("Zeit,arm\n0,0\n", "", "its columns are ['Zeit', 'arm']; name the one with the times in"),
    "another separator than stated": (
        "time;arm\n0;0\n",
        "separator: ','",
        "its cells seem to be separated by semicolons: state separator",
    ),
    "decimal commas among commas": ("time,arm\n0,5,0,5\n", "", "if its numbers have decimal commas, separate"),
    "both decimal signs": ("time;arm\n0;0,5\n1;0.5\n", "", "a decimal point in line 3 and a decimal comma in line 2"),
    "thousands": ("time;arm\n0;1.234,5\n", "", "'1.234,5' is not a finite number; leave out the marks"),
    "decimal sign stated otherwise": ("time;arm\n0;0,5\n", "decimal: '.'", "if the comma is a decimal one, state"),
    "another date": ("time;arm\n01.05.2024 12:00:00;0\n", "", "or a date such as 2024-05-01T12:00:00.5Z"),
    "time of day": ("time,arm\n12:00:00,0\n", "", "or a date such as"),
    "no such day": ("time,arm\n2023-02-29 12:00:00,0\n", "", "'2023-02-29 12:00:00' is no date"),
    "mixed zones": (
        "time,arm\n2024-05-01 12:00:00Z,0\n2024-05-01 12:00:01,0\n",
        "",
        "line 3, column 'time': times are dates with and without a time zone",
    ),
    "dates and numbers": ("time,arm\n2024-05-01 12:00:00Z,0\n2,0\n", "", "times are dates and numbers"),
    "unit of dates": ("time,arm\n2024-05-01 12:00:00Z,0\n", "time: {unit: ms}", "which time.unit has no effect on"),
    "UTF-16": ("time,arm\n0,0\n".encode("utf-16"), "", "is UTF-16 text; save it as UTF-8"),
    "a pointer": (b"version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 9\n", "", "git lfs pull"),
    "a channel of a table": ("time,arm\n0,0\n", "channel: 0", "has no effect with a .csv file"),
    "a huge exponent": ("time,arm\n1e9999,0\n", "", "1e9999 is beyond 146 years"),
    "a heading twice": ("time,arm,arm\n0,0,0\n", "", "has a heading twice"),
    "comments alone": ("# time,arm\n", "", "has no headings in its first line"),
    "headings alone": ("time,arm\n", "", "has no samples of joints"),
}


@pytest.mark.parametrize("kind", BAD)
def test_what_is_wrong_with_a_table_is_told_with_its_likely_cause(tmp_path, kind):
    text, more, message = BAD[kind]
    with pytest.raises(ScenarioError) as caught:
        load(tmp_path, text, more)
    assert message in str(caught.value)
    assert "table.yaml:9:" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_epoch_stamps_at_1_khz_keep_the_velocity(tmp_path):
    """A double holds such a time to 0.24 us, which would be 2e-4 of the velocity."""
    rows = "".join(f"1700000000.{k:09d},{0.5 * k * 1e-9!r}\n" for k in range(123_456, 10**9, 1_000_000))
    scenario = load(tmp_path, "time,arm\n" + rows)
    velocity = np.concatenate([block.joint_velocities[:, 0] for block in replay.simulate(scenario)])
    np.testing.assert_allclose(velocity[:-1], 0.5, rtol=1e-11)


@pytest.mark.parametrize("format", ["csv", "json", "parquet"])
def test_what_replay_exports_moves_the_joints_again(tmp_path, format):
    first = load(tmp_path, GOOD["comma"][0])
    recording = replay.read(record(first, tmp_path / "out", rrd=False).mcap)
    (file,) = export(recording, tmp_path / "log", format=format, topics=["/joint_states"])
    (tmp_path / "again.yaml").write_text(SCENARIO.replace("log.csv MORE", f"log/{file.name}"))
    again = replay.load(tmp_path / "again.yaml")
    track = again.provenance.tracks["arm"]
    np.testing.assert_array_equal(track.seconds, recording.time / 1e9)
    np.testing.assert_array_equal(track.positions, recording.joint_positions[:, 0])
    second = replay.read(record(again, tmp_path / "out2", rrd=False).mcap)
    third = replay.scenario.load.load_sources(second.provenance.root, second.files)
    assert third.sources == again.sources
    assert third.provenance.originals == again.provenance.originals


@pytest.mark.parametrize("document", [[], {}, {"topics": {}}, {"topics": {"/joint_states": {"time": 1}}}])
def test_other_json_is_no_log(tmp_path, document):
    (tmp_path / "log.json").write_text(json.dumps(document))
    (tmp_path / "again.yaml").write_text(SCENARIO.replace("log.csv MORE", "log.json"))
    with pytest.raises(ScenarioError, match="is no JSON that replay export writes"):
        replay.load(tmp_path / "again.yaml")
