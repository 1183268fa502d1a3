"""Files of kernels: found again, whole or not there, shared between processes, never in the way of a result."""

import errno
import hashlib
import os
import signal
import subprocess
import time

import pytest

from replay.numerics.jit import progress, store

HITS = "print(outer(1.0), sum(outer.stats.cache_hits.values()))"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setattr(store, "directory", lambda: tmp_path)
    return tmp_path


def test_compiled_code_is_reused_while_nothing_changes(package):
    assert package.run(HITS) == "20.0 0"
    assert package.run(HITS) == "20.0 1"


def test_numba_cache_dir_is_honoured(package, tmp_path):
    chosen = tmp_path / "chosen"
    assert package.run("outer(1.0); print(directory())", NUMBA_CACHE_DIR=str(chosen)).startswith(str(chosen))
    assert list(chosen.rglob("*.kernel"))


def test_an_install_that_cannot_be_written_uses_the_users_cache_folder(package, tmp_path):
    blocked = package.root / "numerics" / "jit" / "__pycache__"
    blocked.write_text("a file where the folder would be: not even root can create a folder below it")
    home = {"XDG_CACHE_HOME": str(tmp_path / "xdg"), "NUMBA_CACHE_DIR": "", "PYTHONDONTWRITEBYTECODE": "1"}
    assert package.run("outer(1.0); print(directory())", **home).startswith(str(tmp_path / "xdg"))
    nowhere = {**home, "XDG_CACHE_HOME": str(blocked), "TMPDIR": str(tmp_path)}
    assert package.run("outer(1.0); print(directory())", **nowhere).startswith(str(tmp_path))


@pytest.mark.skipif(os.name != "posix", reason="owners and modes are a matter of POSIX")
def test_a_folder_that_others_can_write_to_is_not_used(tmp_path, monkeypatch):
    said = []
    monkeypatch.setattr(progress, "_remark", said.append)
    monkeypatch.setattr(progress, "_said", set())
    open_to_all, real, own = tmp_path / "open", tmp_path / "real", tmp_path / "own"
    for folder in (open_to_all / "kernels", real, own):
        folder.mkdir(parents=True)
    open_to_all.chmod(0o777)
    (tmp_path / "link").symlink_to(real)
    monkeypatch.setattr(store, "_candidate_bases", lambda: [open_to_all / "kernels", tmp_path / "link", own])
    store.directory.cache_clear()
    try:
        assert store.directory() == own
    finally:
        store.directory.cache_clear()
    assert [text.rsplit(": ", 1)[1] for text in said] == [f"others can write to {open_to_all}", "it is a link"]
    assert own.stat().st_mode & 0o777 == 0o700


@pytest.mark.parametrize("damage", ["cut", "another's"])
def test_a_damaged_file_is_compiled_again_and_mended(package, damage):
    package.run(HITS)
    (file,) = package.cache.rglob("*.kernel")
    data = bytearray(file.read_bytes())
    whole = bytes(data)
    other = hashlib.sha256(b"not a kernel").digest() + b"not a kernel"
    file.write_bytes(data[: len(data) // 2] if damage == "cut" else other)
    assert package.run(HITS) == "20.0 0"
    assert len(file.read_bytes()) == len(whole)
    assert package.run(HITS) == "20.0 1"


def test_two_processes_that_need_a_kernel_compile_it_once(package):
    slow = "import time\nfrom numba.core import event\n"
    slow += "class Wait(event.Listener):\n    def on_start(self, e): time.sleep(0.5)\n    def on_end(self, e): pass\n"
    slow += "event.register('numba:compile', Wait())\n"
    both = [package.start(slow + HITS) for _ in range(3)]
    said = sorted(process.communicate()[0].strip() for process in both)
    assert said == ["20.0 0", "20.0 1", "20.0 1"]
    assert not list(package.cache.rglob("*.lock"))


@pytest.mark.skipif(os.name != "posix", reason="locks are a matter of POSIX")
def test_a_process_that_is_killed_while_it_compiles_holds_nobody_up(package):
    stuck = "import time\nfrom numba.core import event\n"
    stuck += "class Wait(event.Listener):\n    def on_start(self, e): print('now', flush=True); time.sleep(600)\n"
    stuck += "    def on_end(self, e): pass\n"
    stuck += "event.register('numba:compile', Wait())\nouter(1.0)"
    first = package.start(stuck)
    assert first.stdout.readline() == "now\n"
    second = package.start(HITS)
    with pytest.raises(subprocess.TimeoutExpired):
        second.wait(timeout=2.0)
    first.send_signal(signal.SIGKILL)
    first.communicate()
    assert second.communicate()[0].strip() == "20.0 0"


def test_a_file_that_is_not_what_was_saved_is_as_if_it_were_not_there(folder):
    store.save("a.b-1", "0" * 32, bytes(100))
    (file,) = folder.iterdir()
    whole = file.read_bytes()
    damaged = [b"", whole[:20], whole[:-1], whole + b"0", *(whole[:k] + b"1" + whole[k + 1 :] for k in (0, 31, 32, 90))]
    for data in damaged:
        file.write_bytes(data)
        assert store.load("a.b-1", "0" * 32) is None
        assert not file.exists()
    store.save("a.b-1", "0" * 32, bytes(100))
    assert store.load("a.b-1", "0" * 32) == bytes(100)


def test_a_full_disk_costs_a_remark_and_no_result(folder, monkeypatch):
    said = []
    monkeypatch.setattr(progress, "_remark", said.append)
    monkeypatch.setattr(progress, "_said", set())

    def full(*_, **__):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(store.tempfile, "mkstemp", full)
    store.save("a.b-1", "k" * 32, b"payload")
    store.save("a.b-1", "l" * 32, b"payload")
    assert said == ["compiled kernels cannot be kept: No space left on device; the next run compiles them again"]
    assert store.load("a.b-1", "k" * 32) is None
    assert not list(folder.iterdir())


def test_a_few_versions_of_each_kernel_are_kept_the_last_used_ones(folder):
    for k in range(6):
        store.save("a.b-1", f"{k:032}", b"payload %d" % k)
        os.utime(folder / f"a.b-1-{k:032}.kernel", ns=(k, k))
        store.save("a.b-2", f"{k:032}", b"other")
    assert store.load("a.b-1", f"{2:032}") == b"payload 2"  # used again: it is younger than the others now
    store.save("a.b-1", f"{6:032}", b"payload 6")
    kept = [k for k in range(7) if store.has("a.b-1", f"{k:032}")]
    assert kept == [2, 4, 5, 6]


def test_what_killed_processes_left_is_swept_after_a_day(folder):
    left = folder / "a.b-1-x.part"
    left.write_bytes(b"half")
    store.save("a.b-1", "0" * 32, b"payload")
    assert left.exists()
    yesterday = time.time() - 2 * 86400
    os.utime(left, (yesterday, yesterday))
    store.save("a.b-1", "1" * 32, b"payload")
    assert not left.exists()


def test_a_claim_is_one_process_at_a_time(folder):
    with store.claim("a", "k") as mine:
        assert mine
        assert store.is_claimed("a", "k")
        assert not store.is_claimed("b", "k")
    assert not store.is_claimed("a", "k")
