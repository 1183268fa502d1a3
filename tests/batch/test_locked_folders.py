"""Folders that may not be looked into: one line each, and no night that ends by one."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import trimesh

from replay.cli.exit_codes import ExitCode
from replay.cli.main import run
from tests.batch import scenes

ROOT = Path(__file__).parents[2]
CAPABILITIES = "-dac_override,-dac_read_search"
SETPRIV = shutil.which("setpriv")
AS_ANYBODY = [SETPRIV, f"--bounding-set={CAPABILITIES}", f"--inh-caps={CAPABILITIES}"] if os.geteuid() == 0 else []
"""What takes the right from root to look into any folder."""
NAMES = ("a", "b", "c")
BALL = "  ball: {pose: {xyz: [0, 3, 0]}, shapes: {ball: {type: mesh, file: ball.stl, scale: 1}}}\n"
MANY = """
import json, sys
from replay.cli.main import run
for arguments in json.loads(sys.argv[1]):
    print(int(run(arguments)), file=sys.stderr)
"""

pytestmark = pytest.mark.skipif(bool(AS_ANYBODY) and SETPRIV is None, reason="root may look into any folder")


def anybody(folder, *command):
    """Run Python as somebody without special rights; return its end."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    command = [*AS_ANYBODY, sys.executable, *command]
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)


@pytest.fixture(scope="module")
def night(tmp_path_factory):
    folder = tmp_path_factory.mktemp("night")
    for name in NAMES:
        scenes.write(folder / "in", name, duration=0.2)
    first = folder / "in" / "a.yaml"
    first.write_text(first.read_text().replace("links:\n", f"links:\n{BALL}"))
    (folder / "in" / "ball.stl").write_bytes(trimesh.creation.box().export(file_type="stl"))
    more = ["--workers", "1", "--rrd", "none", "--missing-baseline", "create"]
    assert (
        run(["regress", str(folder / "in"), "--baseline", str(folder / "base"), "-o", str(folder / "out"), *more]) == 0
    )
    shutil.copytree(folder / "out", folder / "part")
    return folder


@pytest.fixture
def locked(night):
    """Lock folders of the night until the test is over."""
    folders = []

    def lock(name):
        folders.append(night / name)
        folders[-1].chmod(0)

    yield lock
    for folder in folders:
        folder.chmod(0o755)


REGRESS = ("-m", "replay", "regress", "in", "--baseline", "base", "--workers", "1", "--rrd", "none")


def verdicts(folder):
    return {name: entry["verdict"] for name, entry in json.loads((folder / "run.json").read_text())["verdicts"].items()}


def test_a_baseline_that_may_not_be_looked_into_is_that_scenarios_verdict(night, locked):
    locked("base/a")
    done = anybody(night, *REGRESS, "-o", "again")
    assert (done.returncode, "Traceback" in done.stderr) == (ExitCode.INVALID, False)
    assert verdicts(night / "again") == {"a": "unreadable baseline", "b": "same", "c": "same"}
    assert "a: unreadable baseline: base/a/a.mcap: cannot be read: Permission denied" in done.stdout
    assert "unreadable baseline" in (night / "again" / "index.html").read_text()


@pytest.mark.parametrize("more", [(), ("--resume",)])
def test_a_scenarios_folder_that_may_not_be_looked_into_is_its_failure(night, locked, more):
    locked("out/a")
    done = anybody(night, *REGRESS, "-o", "out", *more)
    assert (done.returncode, "Traceback" in done.stderr) == (ExitCode.FAILED, False)
    assert verdicts(night / "out") == {"a": "failed", "b": "same", "c": "same"}
    assert "a: failed: out/a/log.txt: cannot be written: Permission denied" in done.stdout
    assert "Permission denied" in (night / "out" / "junit.xml").read_text()


def test_nobody_says_of_a_locked_baseline_that_it_is_not_there(night, locked):
    locked("base/a")
    code = "from pathlib import Path; from replay.batch.baseline import Baseline; print(Baseline(Path('base')).names())"
    assert anybody(night, "-c", code).stdout == "['a', 'b', 'c']\n"
    done = anybody(night, "-m", "replay", "diff", "base", "out")
    assert done.returncode == ExitCode.INVALID
    assert done.stderr == "replay: error: base/a: cannot be looked through: Permission denied\n"


@pytest.mark.parametrize("mode", [0o000, 0o444])
def test_meshes_that_may_not_be_looked_at_are_one_line_each(mode, night, locked):
    locked("base/objects")
    (night / "base" / "objects").chmod(mode)
    arguments = [
        ["validate", "base/a/a.mcap"],
        ["run", "base/a/a.mcap", "-o", "never"],
        ["explain", "base/a/a.mcap", "/distance/tip", "--at", "0"],
    ]
    told = anybody(night, "-c", MANY, json.dumps(arguments)).stderr.splitlines()
    assert told[1::2] == ["2"] * len(arguments)
    assert all(
        "base/objects/" in line and line.endswith("'ball.stl' cannot be read: Permission denied") for line in told[::2]
    )


def test_meshes_further_up_are_found_behind_a_folder_that_may_not_be_looked_into(night, locked):
    (night / "base" / "a" / "objects").mkdir()
    locked("base/a/objects")
    done = anybody(night, "-m", "replay", "validate", "base/a/a.mcap")
    assert (done.stdout, done.returncode) == ("a: valid, 3 frames, 3 links\n", ExitCode.FINE)


@pytest.mark.parametrize("place", ["part/a", "part/run.json"])
def test_parts_of_a_night_that_may_not_be_looked_into_are_neither_merged_nor_accepted(place, night, locked):
    locked(place)
    arguments = [["merge", "part", "-o", "whole"], ["accept", "part", "--baseline", "base", "--yes", "--reason", "why"]]
    told = anybody(night, "-c", MANY, json.dumps(arguments)).stderr.splitlines()
    shutil.rmtree(night / "whole", ignore_errors=True)
    assert told[1::2] == ["2"] * len(arguments)
    assert all(line.startswith("replay: error: ") and line.endswith("Permission denied") for line in told[::2])


def test_an_acceptance_names_the_place_that_it_may_not_write(night, locked):
    text = (night / "in" / "a.yaml").read_text()
    (night / "new").mkdir()
    (night / "new" / "ball.stl").write_bytes(trimesh.creation.box((2, 2, 2)).export(file_type="stl"))
    (night / "new" / "a.yaml").write_text(text)
    run(["run", str(night / "new"), "-o", str(night / "ran"), "--workers", "1", "--no-rrd"])
    locked("base/objects")
    done = anybody(night, "-m", "replay", "accept", "ran", "--baseline", "base", "--yes", "--reason", "why")
    assert done.returncode == ExitCode.INVALID
    assert done.stderr.startswith("replay: error: base/objects")
    assert done.stderr.endswith(": cannot be written: Permission denied\n")


def test_a_link_into_a_locked_folder_hides_no_scenario(night, locked):
    locked("base/a")
    (night / "in" / "aa").symlink_to(night / "base" / "a" / "x")
    done = anybody(night, "-m", "replay", "validate", "in")
    (night / "in" / "aa").unlink()
    assert "in/aa is left out: it cannot be looked at: Permission denied" in done.stderr
    assert [line.partition(":")[0] for line in done.stdout.splitlines()] == [*NAMES]


def test_arguments_in_a_locked_folder_are_one_line(night, locked):
    (night / "locked").mkdir()
    locked("locked")
    place = "locked/x"
    arguments = [
        ["run", place],
        ["run", "in", "-o", place],
        ["validate", place],
        ["info", place],
        ["export", "base/a/a.mcap", "--format", "csv", "-o", place],
        ["diff", place, "base"],
        ["diff", "base", "out", "--html", place],
        ["regress", "in", "--baseline", place],
        ["accept", place, "--baseline", "base", "--reason", "why"],
        ["view", place],
        ["import", place, "-o", "part.yaml"],
        ["import", "in/a.yaml", "-o", f"{place}.yaml"],
        ["import", "in/a.yaml", "-o", "part.yaml", "--package", f"a={place}"],
    ]
    done = anybody(night, "-c", MANY, json.dumps(arguments))
    told = done.stderr.splitlines()
    assert told[1::2] == ["2"] * len(arguments)
    assert all(line.startswith("replay: error: ") and "fault" not in line for line in told[::2])


def test_what_an_acceptance_has_not_put_in_place_is_no_recording_of_the_baseline(night):
    staging = night / "base" / ".staging"
    staging.mkdir()
    shutil.copy(night / "base" / "a" / "a.mcap", staging / "a.mcap")
    assert run(["diff", str(night / "base"), str(night / "base")]) is ExitCode.FINE
    shutil.rmtree(staging)
