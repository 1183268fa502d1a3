"""A cube that flies through a plate between two frames: what every command and every file says of it."""

from __future__ import annotations

import json
import re
from html import unescape
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from rerun.chunk import RrdReader

import replay
from replay import simulation
from replay.cli.exit_codes import ExitCode
from replay.cli.main import run
from replay.collision.columns import Between
from replay.comparison.difference import DiffVerdict
from replay.recording.record import record
from replay.scenario.methods import METHOD_REVISIONS

TUNNEL = """
version: 1
name: tunnel
rate: 10 Hz
duration: 1 s
links:
  plate: {shapes: {sheet: {type: cuboid, size: [1 cm, 1, 1], pose: {xyz: [0.95, 0, 0]}}}}
  cube:
    joint: {type: prismatic, axis: [1, 0, 0]}
    shapes: {block: {type: cube, size: 5 cm}}
motion:
  points: {cube: [{time: 0, position: 0}, {time: 1, position: 2}]}
expect:
  - {pair: [cube, plate], contact: WHEN}
model: {collision: {between: MODEL}}
"""
PAIR = "cube/block | plate/sheet"
CONTACT = f"contact between frames 4 and 5, {PAIR} first at 0.46 s, until 0.49 s"
LINE = "contact between frames 4 and 5, from 0.46 s until 0.49 s: cube/block | plate/sheet"
RULES = str(Path(__file__).parents[2] / "scenarios" / "rules.yaml")


def written(folder: Path, when: str = "never", model: str = "proven", name: str = "tunnel") -> Path:
    path = folder / f"{name}.yaml"
    path.write_text(TUNNEL.replace("WHEN", when).replace("MODEL", model))
    return path


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("tunnel")
    assert run(["run", str(written(folder)), "-o", str(folder / "out")]) is ExitCode.FAILED
    return folder / "out" / "tunnel"


def test_it_breaks_the_expectation_and_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["run", str(written(tmp_path)), "-o", str(tmp_path / "out"), "--no-rrd"]) is ExitCode.FAILED
    lines = capsys.readouterr().out.splitlines()
    assert f"  FAIL cube | plate: contact never ({CONTACT})" in lines
    assert f"  {LINE}" in lines
    folder = tmp_path / "out" / "tunnel"
    result = json.loads((folder / "result.json").read_text())
    assert result["between_frames"] == [LINE] and result["expectations"][0]["detail"] == CONTACT
    assert LINE in (folder / "log.txt").read_text()


def test_expectations_count_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, pair = written(tmp_path), "\n  - {pair: [cube, plate]"
    more = ["sometimes", "always", "{between: [0.46, 0.47]}", "{between: [0.5, 0.6]}"]
    lines = "".join(f"{pair}, contact: {when}}}" for when in more) + f"{pair}, clearance: {{min: 1 mm}}}}"
    path.write_text(path.read_text().replace("\nmodel:", f"{lines}\nmodel:"))
    assert run(["run", str(path), "-o", str(tmp_path / "out"), "--no-rrd"]) is ExitCode.FAILED
    assert [line.removeprefix("  ") for line in capsys.readouterr().out.splitlines() if "cube | plate:" in line] == [
        f"FAIL cube | plate: contact never ({CONTACT})",
        f"ok   cube | plate: contact sometimes ({CONTACT})",
        "FAIL cube | plate: contact always (contact in 0 of 11 frames, first not at 0 s)",
        f"ok   cube | plate: contact begins between 0.46 s and 0.47 s (contact of {PAIR} begins at 0.46 s)",
        f"FAIL cube | plate: contact begins between 0.5 s and 0.6 s (contact of {PAIR} begins at 0.46 s)",
        "FAIL cube | plate: clearance >= 0.001 m "
        f"(smallest clearance 0.02 m of {PAIR} at 0.5 s; 0 m between frames 4 and 5, {PAIR} first at 0.46 s)",
    ]


def test_frames_alone_do_not_see_it_and_validate_warns(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = written(tmp_path, model="sampled")
    for more in ([], ["--deep"]):
        assert run(["validate", str(path), *more]) is ExitCode.FINE
        assert capsys.readouterr().err.count("links.cube.shapes.block moves up to 0.2 m in a frame and is 0.05 m") == 1
    assert run(["validate", str(written(tmp_path, name="proven"))]) is ExitCode.FINE
    assert capsys.readouterr().err == ""
    assert run(["run", str(path), "-o", str(tmp_path / "out"), "--no-rrd"]) is ExitCode.FINE
    collision = replay.read(tmp_path / "out" / "tunnel" / "tunnel.mcap").collision
    assert (collision.between == Between.NOT_LOOKED).all() and np.isnan(collision.clearance_bound).all()


def test_the_recording_says_when(recorded: Path) -> None:
    recording = replay.read(recorded / "tunnel.mcap")
    assert recording.provenance.model["collision.between"] == f"proven@{METHOD_REVISIONS['collision.between.proven']}"
    states = [Between.NOT_LOOKED, *[Between.CLEAR] * 4, Between.CONTACT, *[Between.CLEAR] * 5]
    assert recording.collision.between[:, 0].tolist() == states
    bound = recording.collision.clearance_bound[1:, 0]
    truth = [0.755, 0.555, 0.355, 0.155, 0.0, 0.025, 0.225, 0.425, 0.625, 0.825]  # 0.945 - 0.025 - 2 t, or beyond
    assert ((bound >= 0.0) & (bound <= np.minimum(truth, 0.05) + 1e-12)).all()
    assert (bound[[0, 1, 2, 3, 5, 6]] > 0.0).all()
    contacts = [event for event in recording.events if event.kind == "contact"]
    assert [(event.begins, event.frame) for event in contacts] == [(True, 5), (False, 5)]
    for event, moment in zip(contacts, (0.46, 0.49), strict=True):
        assert event.earliest <= round(moment * 1e9) <= event.time <= event.earliest + 1000


def test_info_and_export_tell_it(recorded: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    command = ["export", str(recorded / "tunnel.mcap"), "--format", "json", "-o", str(tmp_path)]
    assert run(command) is ExitCode.FINE
    topics = json.loads((tmp_path / "tunnel.json").read_text())["topics"]
    events, pair = topics["/events"], topics["/collision"]
    assert list(events)[:2] == ["time [ns]", "earliest [ns]"]
    assert events["earliest [ns]"][0] <= 460_000_000 <= events["time [ns]"][0]
    name = "cube/block|plate/sheet"
    assert pair[f"{name} between"][:6] == ["not_looked", "clear", "clear", "clear", "clear", "contact"]
    assert pair[f"{name} clearance bound [m]"][5] == 0.0


@pytest.mark.parametrize("block", [None, 4, 3, 1])
def test_rerun_colours_the_bodies_while_they_meet(
    recorded: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, block: int | None
) -> None:
    """Whatever the blocks of frames: frame 5 is in the first one, or in a later one."""
    file = recorded / "tunnel.rrd"
    if block is not None:
        monkeypatch.setattr(simulation, "BLOCK_FRAMES", block)
        file = record(replay.load(written(tmp_path)), tmp_path / "out").rrd
    found = {}
    for chunk in RrdReader(str(file)).stream():
        batch = chunk.to_record_batch()
        names = batch.schema.names
        albedo = [name for name in names if name.endswith("albedo_factor")]
        if albedo and "time" in names and batch.num_rows == 2:
            times = [value.value for value in batch.column(names.index("time"))]
            found[str(chunk.entity_path)] = times, batch.column(names.index(albedo[0])).to_pylist()
    assert len(found) == 2
    for times, colors in found.values():
        assert times[0] == pytest.approx(460_000_000, abs=1000) and times[1] == pytest.approx(490_000_000, abs=1000)
        assert colors[0] == [0xEB2323FF] and colors[1] != colors[0]


def test_a_night_shows_it_in_every_report(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "in").mkdir()
    path = written(tmp_path / "in", "sometimes")
    night = [
        "regress",
        str(path),
        "--baseline",
        str(tmp_path / "base"),
        "-o",
        str(tmp_path / "night"),
        "--rules",
        RULES,
    ]
    assert run([*night, "--missing-baseline", "create", "--rrd", "none"]) is ExitCode.FINE
    page = unescape((tmp_path / "night" / "tunnel" / "report.html").read_text())
    assert LINE in page and CONTACT in page
    suite = ElementTree.parse(tmp_path / "night" / "junit.xml").getroot().find("testsuite")
    assert suite is not None and suite.findtext("system-out") == f"tunnel: {LINE}"
    written(tmp_path / "in", "never")
    assert run([*night, "--rrd", "none"]) is ExitCode.FAILED
    failure = ElementTree.parse(tmp_path / "night" / "junit.xml").getroot().find(".//failure")
    assert failure is not None and CONTACT in failure.attrib["message"]


def test_a_diff_measures_in_microseconds(tmp_path: Path, recorded: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = written(tmp_path, "sometimes")
    path.write_text(path.read_text().replace("0.95, 0, 0", "0.9505, 0, 0"))  # 250 us later at 2 m/s
    assert run(["run", str(path), "-o", str(tmp_path / "out"), "--no-rrd"]) is ExitCode.FINE
    later = tmp_path / "out" / "tunnel" / "tunnel.mcap"
    capsys.readouterr()
    assert run(["diff", str(recorded / "tunnel.mcap"), str(later), "--rules", RULES]) is ExitCode.DIFFERENT
    told = capsys.readouterr().out
    assert re.search(
        r"contact begins 2(49|48|50)[.0-9]* us later: frame 5 \(0\.46\d* s\) -> frame 5 \(0\.460\d* s\)", told
    )
    found = replay.diff(recorded / "tunnel.mcap", later)
    level = next(item for item in found.signals if item.signal.field == "level")
    assert sorted((event.what, event.shift_frames) for event in level.events) == [
        (what, 0) for what in ("contact begins", "contact ends", "overlap of bounds begins", "overlap of bounds ends")
    ]
    assert all(abs(event.shift - 2.5e-4) < 3e-6 for event in level.events)


def test_runs_of_both_models_are_compared(tmp_path: Path, recorded: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = written(tmp_path, model="sampled")
    assert run(["run", str(path), "-o", str(tmp_path / "out"), "--no-rrd"]) is ExitCode.FINE
    frames, proof = tmp_path / "out" / "tunnel" / "tunnel.mcap", recorded / "tunnel.mcap"
    found = replay.diff(frames, proof, rules=RULES)
    assert found.verdict is DiffVerdict.SAME
    told = {change.name: change.candidate for change in found.provenance}
    assert told["/collision"] == "between, clearance_bound (2 signals); 1 contact between two frames"
    assert told["model.collision.between"] == f"proven@{METHOD_REVISIONS['collision.between.proven']}"
    assert replay.diff(proof, frames, rules=RULES).verdict is DiffVerdict.DIFFERENT
