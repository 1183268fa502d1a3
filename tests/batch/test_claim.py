"""One writer a folder: whoever comes second is refused and told by whom; what the dead have left is taken over."""

import contextlib
import os
import subprocess
import sys
import threading
import time

import pytest

from replay.batch.claim import LOCK, claim
from replay.batch.run import Execution, run_all
from replay.cli.exit_codes import ExitCode
from replay.cli.main import run
from replay.errors import BusyError, WriteError
from tests.batch import scenes

HOLD = """
import sys, time
from pathlib import Path
from replay.batch.claim import claim
with claim(Path(sys.argv[1]), shared=sys.argv[2] == "shared") as held:
    if sys.argv[2] == "with a worker":
        import subprocess
        sleep = "import sys, time; time.sleep(float(sys.argv[1]))"
        subprocess.Popen([sys.executable, "-c", sleep, "1.5"], pass_fds=held.handles, stdout=subprocess.DEVNULL)
    print("held", flush=True)
    time.sleep(60)
"""


@contextlib.contextmanager
def holder(folder, how=""):
    with subprocess.Popen([sys.executable, "-c", HOLD, folder, how], stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout.readline() == "held\n"
            yield process
        finally:
            process.kill()


def test_the_second_is_refused_at_once_and_told_which_process_writes(tmp_path, capsys):
    scenario = scenes.write(tmp_path / "in", "a")
    out = tmp_path / "out"
    with holder(out) as process:
        (tmp_path / "link").symlink_to(out)
        for folder in (out, tmp_path / "link", out / ".." / "out"):
            with pytest.raises(BusyError, match=f"in use by process {process.pid} since "), claim(folder):
                pass
        for command in ("run", "regress"):
            more = ["--baseline", str(tmp_path / "base")] if command == "regress" else []
            assert run([command, str(scenario), "-o", str(out), *more]) is ExitCode.INVALID
            said = capsys.readouterr().err
            assert f"out: is in use by process {process.pid} " in said and said.count("\n") == 1
        assert sorted(file.name for file in out.iterdir()) == [LOCK]


def test_accept_is_refused_while_another_writes_the_run_or_the_baseline(tmp_path, capsys):
    scenario = scenes.write(tmp_path / "in", "a")
    out, base = tmp_path / "out", tmp_path / "base"
    assert run(["run", str(scenario), "-o", str(out), "--no-rrd"]) is ExitCode.FINE
    accept = ["accept", str(out), "--baseline", str(base), "--yes", "--reason", "x"]
    for folder in (out, base):
        with holder(folder) as process:
            assert run(accept) is ExitCode.INVALID
            assert f"in use by process {process.pid} " in capsys.readouterr().err
    with holder(out, "shared"):  # another one that only reads
        assert run(accept) is ExitCode.FINE
    assert (base / "a" / "a.mcap").is_file()
    assert not (base / LOCK).exists()


def test_the_lock_of_a_dead_process_is_taken_over(tmp_path):
    with holder(tmp_path) as process:
        process.kill()
        process.wait()
        assert (tmp_path / LOCK).is_file()
        with claim(tmp_path):
            assert str(os.getpid()) in (tmp_path / LOCK).read_text()
    assert not (tmp_path / LOCK).exists()
    (tmp_path / LOCK).write_text("anything")
    with claim(tmp_path):
        pass


def test_the_workers_of_a_dead_process_are_waited_for(tmp_path):
    with holder(tmp_path, "with a worker") as process:
        process.kill()
        process.wait()
        begin = time.monotonic()
        with claim(tmp_path):
            assert time.monotonic() - begin > 0.5


def test_workers_keep_the_claim_of_a_run_that_is_killed(tmp_path, monkeypatch):
    """The worker's end of the claim is what keeps it: nobody else may write where it may still rename a file."""
    monkeypatch.setattr("replay.batch.run.run_case", try_to_claim)
    (result,) = run_all([scenes.scene("a")], tmp_path, rrd=False, execution=Execution(workers=1)).results
    assert result.notes == ("busy", "inherited")


def try_to_claim(order, progress):
    from replay.batch.case import CaseResult

    try:
        with claim(order.folder.parent):
            found = "free"
    except BusyError:
        found = "busy"
    lock = (order.folder.parent / LOCK).stat()
    handles = [number for number in range(3, 256) if _is(number, lock)]
    return CaseResult("a", frames=1, notes=(found, "inherited" if handles else "not inherited"))


def _is(number, other):
    try:
        return os.path.samestat(os.fstat(number), other)
    except OSError:
        return False


def test_claims_of_one_thread_lie_within_each_other_and_those_of_two_do_not(tmp_path):
    said = []

    def other():
        try:
            with claim(tmp_path):
                said.append("ours")
        except BusyError as error:
            said.append(error.user)

    with claim(tmp_path), claim(tmp_path / "."):
        thread = threading.Thread(target=other)
        thread.start()
        thread.join()
        with claim(tmp_path):
            assert (tmp_path / LOCK).exists()
        assert (tmp_path / LOCK).exists()
    assert len(said) == 1 and said[0].startswith(f"process {os.getpid()} ")


def test_a_folder_that_was_made_and_is_not_used_goes_again(tmp_path):
    with claim(tmp_path / "new"):
        pass
    assert not (tmp_path / "new").exists()
    with claim(tmp_path / "none", shared=True) as found:
        assert found.handles == ()
    assert not (tmp_path / "none").exists()
    (tmp_path / "file").write_text("")
    with pytest.raises(WriteError, match="cannot be written"), claim(tmp_path / "file"):
        pass


ODD = [
    "",
    "[" * 4000,
    "[]",
    '{"process": -5, "host": "x", "since": "y"}',
    '{"process": %s, "host": "", "since": ""}' % ("9" * 4000),
]


@pytest.mark.parametrize("text", ODD, ids=range(len(ODD)))
def test_a_lock_that_says_anything_names_nobody(tmp_path, text):
    with holder(tmp_path):
        (tmp_path / LOCK).write_text(text)
        with pytest.raises(BusyError, match="in use by another process; wait"), claim(tmp_path):
            pass


def test_the_lock_is_never_written_through_a_link(tmp_path):
    (tmp_path / "precious").write_text("text")
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / LOCK).symlink_to(tmp_path / "precious")
    with pytest.raises(WriteError, match="it is a link, and nothing is written through links"), claim(tmp_path / "out"):
        pass
    (tmp_path / "out" / LOCK).unlink()
    (tmp_path / "out" / LOCK).hardlink_to(tmp_path / "precious")
    with claim(tmp_path / "out"):
        assert str(os.getpid()) in (tmp_path / "out" / LOCK).read_text()
    assert (tmp_path / "precious").read_text() == "text"
