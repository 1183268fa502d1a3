"""A disk that is full, or may not be written to, while scenarios run."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from replay.batch.case import CaseStatus
from replay.batch.run import Execution, run_all
from replay.errors import NoSpaceError
from replay.logs.part_file import write_file
from tests.batch import scenes
from tests.batch.scenes import TWO


def test_a_folder_that_cannot_be_written_is_the_error_of_its_scenario(tmp_path):
    (tmp_path / "bad").write_text("where its folder should be")
    run = run_all([scenes.scene("bad"), scenes.scene("good")], tmp_path, rrd=False, execution=TWO)
    bad, good = run.results
    assert (bad.status, good.status) == (CaseStatus.FAILED, CaseStatus.PASSED)
    assert (
        bad.error
        == f"{tmp_path / 'bad' / 'log.txt'}: cannot be written: {tmp_path / 'bad'} is a file where a folder is needed"
    )
    (tmp_path / "good" / "result.json").unlink()
    (tmp_path / "good" / "result.json").mkdir()
    (again,) = run_all([scenes.scene("good")], tmp_path, rrd=False, overwrite=True, execution=TWO).results
    assert (again.status, again.recordings) == (CaseStatus.FAILED, None)


def test_a_full_disk_ends_the_run_and_leaves_no_whole_run(tmp_path, monkeypatch):
    def full(path, data):
        if path.name == "result.json":
            raise NoSpaceError(str(path), "No space left on device")
        return write_file(path, data)

    monkeypatch.setattr("replay.batch.case_folder.write_file", full)
    with pytest.raises(NoSpaceError):
        run_all([scenes.scene("good"), scenes.scene("other")], tmp_path, rrd=False, execution=TWO)
    assert json.loads((tmp_path / "run.json").read_text())["interrupted"] is True


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a full disk")
def test_a_disk_that_is_full_for_a_recording_ends_the_run(tmp_path):
    (tmp_path / "a").mkdir()
    (tmp_path / "a" / "a.mcap.part").symlink_to("/dev/full")
    with pytest.raises(NoSpaceError, match="No space left"):
        run_all([scenes.scene("a"), scenes.scene("b")], tmp_path, rrd=False, execution=Execution(workers=1))
    assert json.loads((tmp_path / "run.json").read_text())["interrupted"] is True
    assert not (tmp_path / "b" / "b.mcap").exists()


FULL = """
mkdir full && mount -t tmpfs -o size={size}k none full
{python} -m replay {command} 2>error.txt
echo $? > code.txt
cp -r full/. left/
"""


def on_a_small_disk(folder, command, size):
    """Run a command where `full` is a disk of some KiB; return its exit code, what it said, and its files."""
    script = FULL.format(size=size, command=command, python=sys.executable)
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])}
    (folder / "left").mkdir()
    subprocess.run(["unshare", "-m", "bash", "-c", script], cwd=folder, check=True, env=environment)
    return int((folder / "code.txt").read_text()), (folder / "error.txt").read_text(), folder / "left"


mounts = pytest.mark.skipif(
    sys.platform != "linux" or subprocess.run(["unshare", "-m", "true"], check=False, capture_output=True).returncode,
    reason="needs to mount a small disk",
)


@mounts
@pytest.mark.parametrize("size", [60, 76, 92])
def test_run_json_says_what_was_finished_before_the_disk_was_full(tmp_path, size):
    for k in range(6):
        scenes.write(tmp_path / "in", f"s{k}", duration=3)
    code, error, left = on_a_small_disk(tmp_path, "run in -o full/out --no-rrd --workers 1", size)
    assert code == 2
    assert error.splitlines()[-1].endswith("No space left on device")
    summary = json.loads((left / "out" / "run.json").read_text())
    assert summary["interrupted"] is True
    statuses = {name: entry["status"] for name, entry in summary["scenarios"].items()}
    whole = sorted(file.stem for file in left.glob("out/*/*.mcap"))
    assert sorted(name for name, status in statuses.items() if status == "passed") == whole
    assert 0 < len(whole) < 6
    assert "interrupted" in statuses.values()
    assert all(summary["scenarios"][name].get("error") for name in statuses if name not in whole)
    assert not list(left.rglob("*.part")) and not list(left.rglob(".lock"))


@mounts
def test_the_last_words_find_room_on_a_disk_that_others_have_filled(tmp_path):
    script = """if True:
        import os
        from pathlib import Path
        from replay.batch.case import CaseResult
        from replay.batch.run_file import RunFile
        file = RunFile(Path("full"), ["a", "b"], workers=1)
        file.begin([])
        file.add(CaseResult("a", seconds=1.25, memory=123456789))
        filler = os.open("full/filler", os.O_WRONLY | os.O_CREAT)
        try:
            while True: os.write(filler, bytes(4096))
        except OSError: pass
        run = file.end(interrupted=True)
        print(run.results)
    """
    (tmp_path / "script.py").write_text(script)
    code, error, left = on_a_small_disk(tmp_path, f"--version; {sys.executable} script.py", 64)
    assert (code, error) == (0, "")
    scenarios = json.loads((left / "run.json").read_text())["scenarios"]
    assert {name: entry["status"] for name, entry in scenarios.items()} == {"a": "passed", "b": "interrupted"}
    assert scenarios["b"]["error"] == "the run was ended before this scenario was"
