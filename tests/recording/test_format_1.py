"""Recordings, baselines, runs and histories of format 1 are read, compared and run again by this version.

The data was made by the last version that wrote format 1, see tests/data/README.md.
"""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

import replay
from replay.cli.exit_codes import ExitCode
from replay.cli.main import run
from replay.comparison.difference import DiffVerdict
from replay.recording.export import tables
from replay.recording.reader import read
from replay.recording.summary import summarize
from tests.comparison import made_up

HERE = Path(__file__).parents[1] / "data" / "format_1"
RULES = Path(__file__).parents[2] / "scenarios" / "rules.yaml"
OLD = HERE / "run" / "pass" / "pass.mcap"
WALL, SKIRT = "plate/wall|slider/cube", "plate/skirt|slider/cube"


@pytest.fixture(scope="module")
def night(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The old night, copied, and a night of this version after it: into its own folder, with the old history."""
    folder = tmp_path_factory.mktemp("night")
    shutil.copytree(HERE, folder, dirs_exist_ok=True)
    return folder


def test_what_it_does_not_have_reads_as_absent() -> None:
    old = read(OLD)
    assert old.provenance.format == 1 and summarize(OLD).frames == len(old.time) == 21
    assert old.collision is not None
    assert old.collision.between is None and old.collision.clearance_bound is None
    assert len(old.collision.crossings.pair) == 0
    assert len(old.events) > 0 and old.events.earliest is None and old.events[0].earliest is None
    assert [event.time for event in old.events] == old.time[old.events.frame].tolist()
    contacts = [event.begins for event in old.events if event.kind == "contact" and event.subject == WALL]
    assert contacts == [True]
    exported = tables(old)
    assert "earliest [ns]" not in exported["/events"]
    assert f"{WALL} clearance [m]" in exported["/collision"] and f"{WALL} between" not in exported["/collision"]


def test_written_anew_it_says_that_nobody_looked_between_its_frames(tmp_path: Path) -> None:
    old = read(OLD)
    new = read(made_up.write(made_up.with_provenance(old, format=2), tmp_path / "new.mcap"))
    assert new.collision is not None and old.collision is not None
    assert (new.collision.between == 3).all() and np.isnan(new.collision.clearance_bound).all()
    assert np.array_equal(new.collision.level, old.collision.level)


def test_it_is_the_same_as_itself_and_as_a_run_of_today(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert replay.diff(OLD, OLD).verdict is DiffVerdict.SAME
    assert run(["run", str(OLD), "-o", str(tmp_path), "--no-rrd"]) is ExitCode.FINE
    new = tmp_path / "pass" / "pass.mcap"
    capsys.readouterr()
    assert run(["diff", str(OLD), str(new), "--rules", str(RULES)]) is ExitCode.FINE
    told = capsys.readouterr().out
    assert told.startswith("same: pass: ")
    assert told.count("/collision: - -> between, clearance_bound (4 signals)") == 1
    assert "/schemas/collision" not in told
    back = replay.diff(new, OLD, rules=RULES)
    assert back.verdict is DiffVerdict.DIFFERENT
    assert [(item.topic, item.name, len(item.signals)) for item in back.missing] == [
        ("/collision", "between, clearance_bound", 4)
    ]


def test_a_night_goes_on_after_it(night: Path, capsys: pytest.CaptureFixture[str]) -> None:
    command = ["regress", str(night / "scenarios"), "--baseline", str(night / "baselines"), "-o", str(night / "run")]
    history = night / "history.jsonl"
    more = ["--rules", str(RULES), "--history", str(history), "--rrd", "none"]
    assert run([*command, *more]) is ExitCode.FINE
    assert "1 scenario: 1 same" in capsys.readouterr().out
    nights = [json.loads(line) for line in history.read_text().splitlines()]
    assert [entry["verdicts"] for entry in nights] == [{"pass": "same"}] * 2
    assert run(["diff", str(HERE / "run"), str(night / "run"), "--rules", str(RULES)]) is ExitCode.FINE
    accept = ["accept", str(night / "run"), "--baseline", str(night / "baselines"), "--reason", "newer", "--yes"]
    assert run(accept) is ExitCode.FINE
    assert read(night / "baselines" / "pass" / "pass.mcap").provenance.format == 2
