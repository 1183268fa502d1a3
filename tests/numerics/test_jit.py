"""The kernel cache: an edited callee is never served stale, and every kind of install finds a place for it."""

import importlib
import os
import pkgutil
import shutil
import subprocess
import sys
from pathlib import Path

import numba
import numpy as np
import pytest
from numba.core.registry import CPUDispatcher

import replay
from replay.numerics import jit

CALLEE = "from replay.numerics.jit import kernel\n\n\n@kernel\ndef inner(x):\n    return x + {}\n"
CALLER = (
    "from replay.numerics.jit import kernel\nfrom replay.geometry.callee import inner\n\n\n"
    "@kernel\ndef outer(x):\n    return 10.0 * inner(x)\n"
)
PROBE = "from replay.collision.caller import outer; from replay.numerics.jit import cache_directory as c;"


@pytest.fixture
def package(tmp_path):
    """A copy of the jit policy in a package of its own, with a kernel that calls a kernel in another room."""
    root = tmp_path / "site" / "replay"
    for room in ("numerics", "geometry", "collision"):
        (root / room).mkdir(parents=True)
        (root / room / "__init__.py").write_text("")
    (root / "__init__.py").write_text("")
    for module in ("jit.py", "announcement.py"):
        shutil.copy(Path(replay.__file__).parent / "numerics" / module, root / "numerics" / module)
    (root / "geometry" / "callee.py").write_text(CALLEE.format("1.0"))
    (root / "collision" / "caller.py").write_text(CALLER)
    return root


def run(package: Path, code: str, **environment: str) -> str:
    env = {**os.environ, "PYTHONPATH": str(package.parent), **environment}
    command = [sys.executable, "-B", "-c", PROBE + code]  # Python itself goes by time and size
    done = subprocess.run(command, env=env, capture_output=True, text=True, cwd=package.parent, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


def test_an_edited_callee_in_another_module_is_never_served_stale(package, tmp_path):
    cache = {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    assert run(package, "print(outer(1.0))", **cache) == "20.0"
    callee = package / "geometry" / "callee.py"
    stamp = callee.stat()
    callee.write_text(CALLEE.format("2.0"))
    os.utime(callee, ns=(stamp.st_atime_ns, stamp.st_mtime_ns))  # same size, same time: only the content differs
    assert run(package, "print(outer(1.0))", **cache) == "30.0"


def test_compiled_code_is_reused_while_nothing_changes(package, tmp_path):
    cache = {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    hits = "outer(1.0); print(sum(outer.stats.cache_hits.values()))"
    assert run(package, hits, **cache) == "0"
    assert run(package, hits, **cache) == "1"


def test_compiling_is_announced_and_loading_is_not(package, tmp_path):
    cache = {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    code = "import replay.numerics.announcement as a; a.announce_by(print); a._announcement._left = 0.0; outer(1.0)"
    assert run(package, code, **cache) == "compiling kernels; this takes about a minute, once"
    assert run(package, code, **cache) == ""


def test_numba_cache_dir_is_honoured(package, tmp_path):
    chosen = tmp_path / "chosen"
    assert run(package, "outer(1.0); print(c())", NUMBA_CACHE_DIR=str(chosen)).startswith(str(chosen))
    assert list(chosen.rglob("*.nbi"))


def test_an_install_that_cannot_be_written_uses_the_users_cache_folder(package, tmp_path):
    blocked = package / "numerics" / "__pycache__"
    blocked.write_text("a file where the folder would be: not even root can create a folder below it")
    home = {"XDG_CACHE_HOME": str(tmp_path / "xdg"), "NUMBA_CACHE_DIR": "", "PYTHONDONTWRITEBYTECODE": "1"}
    assert run(package, "outer(1.0); print(c())", **home).startswith(str(tmp_path / "xdg"))
    nowhere = {**home, "XDG_CACHE_HOME": str(blocked), "TMPDIR": str(tmp_path)}
    assert run(package, "outer(1.0); print(c())", **nowhere).startswith(str(tmp_path))


def test_leaf_kernels_compute_what_kernels_do_with_or_without_the_option(monkeypatch):
    def total(rows):
        result = 0.0
        for row in rows:
            result += row[0] / row[1]
        return result

    rows = np.random.default_rng(1).normal(size=(50, 2))
    expected = jit.kernel(total)(rows)
    leaf = jit.leaf_kernel(total)
    assert leaf.targetoptions["_nrt"] is False
    assert leaf(rows) == expected
    monkeypatch.setattr(jit, "_counting_is_optional", lambda: False)
    usual = jit.leaf_kernel(total)
    assert "_nrt" not in usual.targetoptions
    assert usual(rows) == expected


def test_a_leaf_kernel_that_allocates_fails_to_compile():
    @jit.leaf_kernel
    def allocates(n):
        return np.zeros(n).sum()

    with pytest.raises(numba.core.errors.NumbaError):
        allocates(3)


def test_leaf_kernels_call_leaf_kernels_only():
    # What a leaf kernel calls is compiled without reference counting too, if it is the first to call it: something that
    # allocates would compile or not depending on what ran before.
    leaves = []
    for room in jit.KERNEL_ROOMS:
        package = importlib.import_module(f"replay.{room}")
        for found in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
            for value in vars(importlib.import_module(found.name)).values():
                if isinstance(value, CPUDispatcher) and value.targetoptions.get("_nrt") is False:
                    leaves.append(value.py_func)
    assert len(leaves) > 50
    for leaf in leaves:
        called = (leaf.__globals__.get(name) for name in leaf.__code__.co_names)
        for callee in called:
            if isinstance(callee, CPUDispatcher):
                assert callee.targetoptions.get("_nrt") is False, f"{leaf.__module__}.{leaf.__name__}: {callee}"
