"""Tests run against a tree with a fault in it, in a process that is ended when it takes too long or too much.

What takes long to import and is not ours is imported once; each trial is a fork of that. A trial's tree is a copy: the
checkout is never touched.
"""

from __future__ import annotations

import contextlib
import ctypes
import importlib
import json
import math
import os
import resource
import shutil
import signal
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import psutil

LEFT_OUT = shutil.ignore_patterns(
    ".git", ".venv", "__pycache__", "*.egg-info", ".*_cache", ".hypothesis", "recordings", "regress", "build", "dist"
)
PRELOADED = (
    *("pytest", "hypothesis", "numpy", "numba", "scipy.spatial", "scipy.optimize", "pydantic", "trimesh", "pyarrow"),
    *(
        "mcap.writer",
        "rerun",
        "matplotlib.figure",
        "ruamel.yaml",
        "jinja2",
        "click",
        "rich",
        "mpmath",
        "fcl",
        "xmlschema",
    ),
)
"""Packages that a trial finds imported; `replay` and `tests` are each trial's own."""
MOST_MEMORY = 3 << 30
"""Bytes of a trial and its children; beyond, it is ended."""
_OPTIONS = ("-x", "-q", "--no-header", "--tb=line", "-p", "no:cacheprovider")
_OPTIONS += ("-W", "ignore::pytest.PytestAssertRewriteWarning")  # of what is preloaded
_PR_SET_CHILD_SUBREAPER = 36  # linux/prctl.h
_BY_FILE = "seconds.json"
_NO_TEST = 5  # pytest's exit code
_PAUSE = 0.05  # seconds between two looks
_CLOCK = 10.0  # what a limit of processor time is by the clock: the machine may be busy, and tests wait for processes


@dataclass(frozen=True)
class Outcome:
    """How a trial ended.

    Attributes:
        verdict: "passed", "failed", "too long" or "too large".
        seconds: processor time of the process and of those that it waited for.
        by_file: processor time of each test file; nothing of a trial that did not pass.
        text: the end of what it printed.
    """

    verdict: str
    seconds: float
    by_file: dict[str, float]
    text: str

    @property
    def failed_test(self) -> str:
        """The test that failed first; "" when none says so."""
        heads = ("FAILED ", "ERROR ")
        lines = (line for line in self.text.splitlines() if line.startswith(heads))
        return next((line.split(" ", 1)[1].split(" - ")[0] for line in lines), "")


class Tree:
    """A scratch copy of the checkout, with a cache of kernels of its own."""

    def __init__(self, checkout: Path, work: Path) -> None:
        """Copy the checkout to WORK/tree; kernels that are compiled for the faultless tree are kept in WORK/kernels."""
        self.root = work / "tree"
        self.kernels = work / "kernels"
        self._cache = work / "cache"
        self._temporary = work / "tmp"
        self._stamp = time.time() - 1e6  # modules are compiled again when their second changes
        shutil.rmtree(self.root, ignore_errors=True)
        shutil.copytree(checkout, self.root, ignore=LEFT_OUT)
        self.kernels.mkdir(parents=True, exist_ok=True)

    @contextlib.contextmanager
    def with_fault(self, file: str, text: str) -> Iterator[None]:
        """Replace a module's text for a while."""
        path = self.root / file
        before = path.read_text(encoding="utf-8")
        try:
            self._write(path, text)
            yield
        finally:
            self._write(path, before)

    def _write(self, path: Path, text: str) -> None:
        path.write_text(text, encoding="utf-8")
        self._stamp += 2.0
        os.utime(path, (self._stamp, self._stamp))

    def run(self, tests: Sequence[str], limit: float, *, compiled: bool, faultless: bool = False) -> Outcome:
        """Run tests until the first fails.

        Args:
            tests: files or single tests.
            limit: seconds of processor time that a process may take; what waits without an end is ended by the clock.
            compiled: whether kernels are compiled; else they are plain Python.
            faultless: keep the kernels that are compiled: no fault is in the tree.
        """
        cache = self.kernels
        if not faultless:
            cache = self._cache
            shutil.rmtree(cache, ignore_errors=True)
            shutil.copytree(self.kernels, cache, copy_function=os.link)
        shutil.rmtree(self._temporary, ignore_errors=True)
        self._temporary.mkdir()
        output = self._temporary / "output.txt"
        child = os.fork()
        if child == 0:
            resource.setrlimit(resource.RLIMIT_CPU, (math.ceil(limit),) * 2)
            _be_pytest(self.root, tests, output, cache, self._temporary, compiled=compiled)
        try:
            verdict, seconds = _watch(child, time.monotonic() + _CLOCK * limit)
        finally:
            _end_descendants()
        text = output.read_text(errors="replace")[-3000:] if output.exists() else ""
        file = self._temporary / _BY_FILE
        by_file = json.loads(file.read_text()) if verdict == "passed" and file.exists() else {}
        return Outcome(verdict, seconds, by_file, text)


def preload() -> None:
    """Import what all trials need, and become the parent of what they leave behind, so that it can be ended."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(128 + signal.SIGTERM))  # by way of what ends trials
    for name in PRELOADED:
        importlib.import_module(name)


def _be_pytest(root: Path, tests: Sequence[str], output: Path, cache: Path, temporary: Path, *, compiled: bool) -> None:
    """Become a process that runs tests and ends with pytest's exit code; never returns."""
    code = 70
    try:
        os.setsid()
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        descriptor = os.open(output, os.O_WRONLY | os.O_CREAT)
        os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
        os.dup2(descriptor, 1)
        os.dup2(descriptor, 2)
        os.chdir(root)
        os.environ.update(PYTHONPATH=str(root), NUMBA_CACHE_DIR=str(cache), TMPDIR=str(temporary), OMP_NUM_THREADS="1")
        os.environ.pop("PYTHONDONTWRITEBYTECODE", None)  # of many trials hardly a module differs
        sys.dont_write_bytecode = False
        if not compiled:
            os.environ["NUMBA_DISABLE_JIT"] = "1"
            importlib.import_module("numba").core.config.reload_config()
        for name in [name for name in sys.modules if name.split(".")[0] in ("replay", "tests")]:
            del sys.modules[name]
        sys.path[:] = [str(root), *(place for place in sys.path if Path(place).resolve() not in (Path.cwd(), root))]
        importlib.invalidate_caches()
        pytest = importlib.import_module("pytest")
        code = int(pytest.main([*_OPTIONS, *tests], plugins=[_Watch(temporary / _BY_FILE)]))
    except BaseException as error:  # whatever a fault does
        print(f"{type(error).__name__}: {error}", flush=True)
    finally:
        with contextlib.suppress(Exception):  # a fault may have closed them
            sys.stdout.flush()
            sys.stderr.flush()
        os._exit(code)


class _Watch:
    """A plugin of pytest that notes how long the tests of each file take."""

    def __init__(self, file: Path) -> None:
        self._file = file
        self._seconds: dict[str, float] = {}

    def pytest_runtest_logfinish(self, nodeid: str) -> None:
        """Note the time since the last test; `nodeid` begins with the file."""
        file = nodeid.partition("::")[0]
        now = time.process_time()
        self._seconds[file] = self._seconds.get(file, 0.0) + now - getattr(self, "_before", 0.0)
        self._before = now

    def pytest_sessionfinish(self) -> None:
        """Write what was noted."""
        self._file.write_text(json.dumps(self._seconds))


def _watch(child: int, deadline: float) -> tuple[str, float]:
    """Wait for a trial and return its verdict and processor time [s]; end what takes too much."""
    verdict = ""
    looked = 0.0
    while True:
        ended, status, used = os.wait4(child, 0 if verdict else os.WNOHANG)
        if ended:
            break
        if time.monotonic() > deadline:
            verdict = "too long"
        elif time.monotonic() > looked + 1.0:
            looked = time.monotonic()
            verdict = "too large" if _memory(child) > MOST_MEMORY else ""
        if verdict:
            os.kill(child, signal.SIGKILL)
        else:
            time.sleep(_PAUSE)
    code = os.waitstatus_to_exitcode(status)
    if code == _NO_TEST:
        raise RuntimeError("no test was found")
    if code in (-signal.SIGXCPU, -signal.SIGKILL):
        verdict = verdict or "too long"
    return verdict or ("passed" if code == 0 else "failed"), used.ru_utime + used.ru_stime


def _end_descendants() -> None:
    """End all that a trial has started, also what has a session of its own and was left behind (see `preload`)."""
    for process in psutil.Process().children(recursive=True):
        with contextlib.suppress(psutil.NoSuchProcess):
            process.kill()
    with contextlib.suppress(ChildProcessError):
        while os.waitpid(-1, os.WNOHANG)[0]:
            pass


def _memory(child: int) -> int:
    total = 0
    with contextlib.suppress(psutil.NoSuchProcess):
        process = psutil.Process(child)
        for one in [process, *process.children(recursive=True)]:
            with contextlib.suppress(psutil.NoSuchProcess):
                total += one.memory_info().rss
    return total
