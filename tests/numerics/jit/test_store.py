"""Files of kernels: found again, whole or not there, shared between processes, never in the way of a result."""

import errno
import hashlib
import os
import re
import signal
import subprocess
import time

import pytest

from replay.numerics import remarks
from replay.numerics.jit import store
from tests.numerics.jit.conftest import CALLEE, CALLER

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
    monkeypatch.setattr(remarks, "_tell", said.append)
    monkeypatch.setattr(remarks, "_said", set())
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
    monkeypatch.setattr(remarks, "_tell", said.append)
    monkeypatch.setattr(remarks, "_said", set())

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


@pytest.mark.parametrize("place", ["a folder", "a link", "a pipe", "a device"])
def test_what_stands_in_a_kernels_place_is_not_read_and_makes_room(folder, tmp_path_factory, place):
    store.save("a.b-1", "0" * 32, b"payload")
    (file,) = folder.iterdir()
    elsewhere = tmp_path_factory.mktemp("elsewhere") / "kernel"
    file.rename(elsewhere)
    match place:
        case "a folder":
            (file / "sub").mkdir(parents=True)
        case "a link":
            file.symlink_to(elsewhere)
        case "a pipe":
            os.mkfifo(file)  # whoever opens it waits for a writer
        case "a device":
            file.symlink_to("/dev/zero")
    assert store.load("a.b-1", "0" * 32) is None
    store.save("a.b-1", "0" * 32, b"payload")
    assert store.load("a.b-1", "0" * 32) == b"payload"
    assert elsewhere.exists()


@pytest.mark.skipif(os.name != "posix" or os.getuid() != 0, reason="only root can give files to others")
def test_another_users_file_is_not_read(folder):
    store.save("a.b-1", "0" * 32, b"payload")
    (file,) = folder.iterdir()
    os.chown(file, 5555, -1)
    assert store.load("a.b-1", "0" * 32) is None


@pytest.mark.skipif(os.name != "posix", reason="owners and modes are a matter of POSIX")
def test_who_may_write_decides_over_a_folder(tmp_path, monkeypatch):
    monkeypatch.setattr(store, "_is_private", lambda group: group == 7001)
    said = {}
    for name, mode, group in (
        ("own", 0o700, 0),
        ("seen", 0o755, 7000),
        ("all", 0o777, 0),
        ("sticky", 0o1777, 0),
        ("group", 0o770, 7000),
        ("private", 0o770, 7001),
    ):
        (tmp_path / name).mkdir()
        if os.getuid() == 0:
            os.chown(tmp_path / name, -1, group)
        (tmp_path / name).chmod(mode)
        said[name] = store._who_else_writes(tmp_path / name)
        if said[name] is None:
            assert (tmp_path / name).stat().st_mode & 0o777 == 0o700
    refused = {name for name, reason in said.items() if reason == "others can write to it"}
    assert refused == {"all", "sticky", *(["group"] if os.getuid() == 0 else [])}
    assert {said[name] for name in said.keys() - refused} == {None}
    (tmp_path / "sticky" / "mine").mkdir(mode=0o700)
    (tmp_path / "all" / "mine").mkdir(mode=0o700)
    assert store._who_else_writes(tmp_path / "sticky" / "mine") is None
    assert store._who_else_writes(tmp_path / "all" / "mine") == f"others can write to {tmp_path / 'all'}"


def test_a_group_that_nobody_knows_is_not_private():
    assert not store._is_private(2**31 - 5)


def remarks_in(said):
    """Return what was said on stderr but for the progress, which a slow machine tells and a fast one does not."""
    assert "they are kept" not in said
    return [line for line in said.splitlines() if re.match(r"replay: compil(ing|ed \d+) kernels?\b", line) is None]


FULL = """
import resource, signal
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (0, resource.RLIM_INFINITY))
"""


@pytest.mark.skipif(os.name != "posix", reason="limits are a matter of POSIX")
@pytest.mark.parametrize("damage", ["none", "cut", "not there"])
def test_on_a_full_disk_kernels_are_read_or_compiled_and_one_line_says_so(package, damage):
    package.run(HITS)
    (file,) = package.cache.rglob("*.kernel")
    if damage == "cut":
        file.write_bytes(file.read_bytes()[:1000])
    elif damage == "not there":
        file.unlink()
    process = package.start(FULL + HITS + "; alone(1.0)")  # two are missing, and it is said once
    out, said = process.communicate()
    assert out.strip() == ("20.0 1" if damage == "none" else "20.0 0"), said
    assert remarks_in(said) == [
        "replay: compiled kernels cannot be kept: File too large; the next run compiles them again"
    ]
    assert file.exists() is (damage == "none")


def test_where_nothing_can_be_kept_kernels_are_compiled_and_one_line_says_so(package, tmp_path):
    blocked = tmp_path / "file"
    blocked.write_text("in the way of every folder")
    (package.root / "numerics" / "jit" / "__pycache__").write_text("")
    environment = {"NUMBA_CACHE_DIR": str(blocked), "XDG_CACHE_HOME": str(blocked)}
    code = "import tempfile; tempfile.tempdir = " + repr(str(blocked)) + "; print(directory())\n"
    process = package.start(code + "outer(1.0); alone(1.0)", **environment)
    out, said = process.communicate()
    assert out.strip() == "None", said
    assert len(remarks_in(said)) == 1
    assert remarks_in(said)[0].startswith("replay: compiled kernels cannot be kept: ")


@pytest.mark.parametrize("damage", ["index", "kernel", "full"])
def test_numbas_own_cache_is_mended_too(package, damage):
    file = package.root / "numerics" / "jit" / "compiler.py"
    package.write("numerics/jit/compiler.py", file.read_text().replace('TRIED = ("0.68.",)', 'TRIED = ("0.",)[:0]'))
    full = FULL if damage == "full" else ""
    process = package.start(full + HITS)
    out, said = process.communicate()
    assert out.strip() == "20.0 0", said
    if damage == "full":
        assert len(remarks_in(said)) == 1 and "cannot be kept" in said
        return
    assert package.run(HITS) == "20.0 1"
    for kept in package.cache.rglob("*.nbi" if damage == "index" else "*.nbc"):
        kept.write_bytes(kept.read_bytes()[:-10] if damage == "kernel" else b"")
    assert package.run(HITS) == "20.0 0"
    assert package.run(HITS) == "20.0 1"


def test_a_kernel_that_returns_arrays_is_whole_after_one_that_has_taken_it_in(package):
    package.write(
        "geometry/callee.py", CALLEE.format("1.0") + "\n\n@kernel\ndef rows(n):\n    return np.ones((n, 2))\n"
    )
    package.write("collision/caller.py", CALLER + "\n\n@kernel\ndef total(n):\n    return rows(n).sum()\n")
    for name in ("geometry/callee.py", "collision/caller.py"):
        text = (package.root / name).read_text().replace("import inner", "import inner, rows")
        package.write(name, "import numpy as np\n" + text)
    one_then_other = "from replay.geometry.callee import rows; print(total(3), rows(2).sum())"
    for _ in range(2):  # compiled, and from files
        assert package.run(one_then_other) == "6.0 4.0"
    assert package.run("from replay.geometry.callee import rows; print(rows(2).sum(), total(3))") == "4.0 6.0"
