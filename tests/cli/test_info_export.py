"""`replay info` and `replay export`: whole recordings and damaged ones."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from replay.cli.exit_codes import ExitCode
from replay.cli.main import run


def test_info_lists_topics_counts_and_provenance(recorded, capsys):
    assert run(["info", str(recorded / "swing.mcap")]) is ExitCode.FINE
    text = capsys.readouterr().out
    assert "/distance/tip" in text
    assert "replay.DistanceReading" in text
    assert "distance exact@3" in text
    assert "swing.yaml" in text
    assert run(["info", str(recorded / "swing.mcap"), "--format", "json"]) is ExitCode.FINE
    counts = {topic["topic"]: topic["messages"] for topic in json.loads(capsys.readouterr().out)["topics"]}
    assert counts["/collision"] == counts["/tf"] == counts["/joint_states"] == 61


def test_info_salvages_a_cut_file_with_exit_code_3(recorded, tmp_path, capsys):
    data = (recorded / "swing.mcap").read_bytes()
    part = tmp_path / "swing.mcap.part"
    part.write_bytes(data[: len(data) // 2])
    assert run(["info", str(part)]) is ExitCode.LOSSES
    said = capsys.readouterr().err
    assert said.startswith(f"replay: {part}: cut at byte") and said.endswith("; none of 61 frames were salvaged\n")
    cut = tmp_path / "cut.mcap"  # a copy that was stopped, say
    cut.write_bytes(part.read_bytes())
    assert run(["info", str(cut)]) is ExitCode.LOSSES
    assert run(["export", str(cut), "--format", "csv", "-o", str(tmp_path), "--topic", "/tf"]) is ExitCode.LOSSES
    cut.write_bytes(data[:-20])
    capsys.readouterr()
    assert run(["info", str(cut)]) is ExitCode.LOSSES
    assert capsys.readouterr().err.endswith("; all 61 frames were salvaged\n")
    cut.write_bytes(data[:30])
    assert run(["info", str(cut)]) is ExitCode.INVALID


@pytest.mark.parametrize("encoding", ["ascii", "latin-1"])
def test_a_name_that_the_terminal_cannot_show_is_shown_as_escapes(recorded, tmp_path, encoding):
    named = tmp_path / "bone 🦴.mcap"
    named.write_bytes((recorded / "swing.mcap").read_bytes())
    command = [sys.executable, "-m", "replay", "info", str(named)]
    environment = {**os.environ, "PYTHONIOENCODING": encoding}
    done = subprocess.run(command, env=environment, capture_output=True, check=False)
    assert (done.returncode, done.stderr) == (0, b"")
    assert done.stdout.startswith(str(tmp_path).encode())


def test_export_writes_tables_with_units(recorded, tmp_path, capsys):
    arguments = [
        "export",
        str(recorded / "swing.mcap"),
        "--format",
        "csv",
        "-o",
        str(tmp_path),
        "--topic",
        "/distance/*",
    ]
    assert run(arguments) is ExitCode.FINE
    (written,) = capsys.readouterr().out.split()
    assert "[m]" in Path(written).read_text().splitlines()[0]
