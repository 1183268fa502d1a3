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
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

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
        "coverage",
    ),
)
"""Packages that a trial finds imported; `replay` and `tests` are each trial's own."""
MOST_MEMORY = 3 << 30
"""Bytes of a trial and its children; beyond, it is ended."""
_OPTIONS = ("-q", "--no-header", "--tb=line", "-p", "no:cacheprovider")
_OPTIONS += ("-W", "ignore::pytest.PytestAssertRewriteWarning")  # of what is preloaded
_AUTOGROUP = Path("/proc/self/autogroup")
_PR_SET_CHILD_SUBREAPER = 36  # linux/prctl.h
_TOLD = "told.json"
_NO_TEST = 5  # pytest's exit code when all are left out
_PAUSE = 0.05  # seconds between two looks
_CLOCK = 10.0  # what a limit of processor time is by the clock: the machine may be busy, and tests wait for processes


@dataclass(frozen=True)
class Outcome:
    """How a trial ended.

    Attributes:
        verdict: "passed", "failed", "too long" or "too large".
        seconds: processor time of the process and of those that it waited for.
        by_test: processor time of each test that passed.
        text: the end of what it printed.
        lines: by module and line which of these tests executed it, as a number whose bits are in their order.
    """

    verdict: str
    seconds: float
    by_test: dict[str, float]
    text: str
    lines: dict[str, dict[str, str]] = field(default_factory=dict)

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

    def run(
        self,
        tests: Sequence[str],
        limit: float,
        *,
        compiled: bool,
        faultless: bool = False,
        each: float = math.inf,
        reach: bool = False,
    ) -> Outcome:
        """Run tests until the first fails.

        Args:
            tests: files or single tests.
            limit: seconds of processor time that a process may take; what waits without an end is ended by the clock.
            compiled: whether kernels are compiled; else they are plain Python.
            faultless: keep the kernels that are compiled: no fault is in the tree.
            each: seconds of processor time that a test may take; then it is left, and not among the outcome's tests.
            reach: run all, also after one that fails, and note which lines of the package each executes.
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
            watch = _Watch(self._temporary / _TOLD, each, limit / 2, self.root if reach else None)
            _be_pytest(self.root, tests, output, cache, self._temporary, watch, compiled=compiled)
        try:
            verdict, seconds = _watch(child, time.monotonic() + _CLOCK * limit)
        finally:
            _end_descendants()
        text = output.read_text(errors="replace")[-3000:] if output.exists() else ""
        file = self._temporary / _TOLD
        told = json.loads(file.read_text()) if file.exists() else {"seconds": {}, "lines": {}}
        return Outcome(verdict, seconds, told["seconds"], text, told["lines"])


def preload() -> None:
    """Import what all trials need, and become the parent of what they leave behind, so that it can be ended."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(128 + signal.SIGTERM))  # by way of what ends trials
    for name in PRELOADED:
        importlib.import_module(name)


def _be_pytest(
    root: Path, tests: Sequence[str], output: Path, cache: Path, temporary: Path, watch: _Watch, *, compiled: bool
) -> None:
    """Become a process that runs tests and ends with pytest's exit code; never returns."""
    code = 70
    try:
        _begin_session()
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
        watch.begin()
        code = int(pytest.main([*_OPTIONS, *([] if watch.reaches else ["-x"]), *tests], plugins=[watch]))
    except BaseException as error:  # whatever a fault does
        print(f"{type(error).__name__}: {error}", flush=True)
    finally:
        with contextlib.suppress(Exception):  # a fault may have closed them
            sys.stdout.flush()
            sys.stderr.flush()
        os._exit(code)


def _begin_session() -> None:
    """Begin a session, no more urgent than the one before: Linux may schedule sessions, and a new one has priority 0.

    Where it schedules groups of control instead, as in containers, the file is there and says nothing.
    """
    said = _AUTOGROUP.read_text().split() if _AUTOGROUP.exists() else []
    os.setsid()
    if said:
        with contextlib.suppress(OSError):
            _AUTOGROUP.write_text(said[-1])


class _Watch:
    """A plugin of pytest that notes how long tests take and, where asked, which lines they execute.

    A test that takes too long is left, and none is begun when all have taken too long.
    """

    def __init__(self, file: Path, each: float, whole: float, reached: Path | None) -> None:
        self._file = file
        self._each = each
        self._whole = whole
        self._reached = reached
        self._coverage: Any = None
        self._seconds: dict[str, float] = {}
        self._begin = 0.0

    @property
    def reaches(self) -> bool:
        """Whether lines are noted."""
        return self._reached is not None

    def begin(self) -> None:
        """Begin to note lines: before the package is imported."""
        if self._reached:
            source = str(self._reached / "replay")
            self._coverage = importlib.import_module("coverage").Coverage(
                data_file=None, config_file=False, source=[source]
            )
            self._coverage.start()

    def pytest_runtest_logstart(self, nodeid: str) -> None:
        """Begin a test, with what is set up for it."""
        self._begin = time.process_time()
        if self._coverage:
            self._coverage.switch_context(nodeid)
        if self._each < math.inf:
            signal.signal(signal.SIGPROF, _leave)
            signal.setitimer(signal.ITIMER_PROF, self._each if self._begin < self._whole else 0.01)

    def pytest_runtest_logreport(self, report: Any) -> None:
        """Note what passed."""
        if report.when == "call" and report.passed:
            self._seconds[report.nodeid] = round(time.process_time() - self._begin, 3)

    def pytest_runtest_logfinish(self) -> None:
        """End a test."""
        signal.setitimer(signal.ITIMER_PROF, 0.0)

    def pytest_sessionfinish(self) -> None:
        """Write what was noted."""
        lines = self._lines() if self._coverage else {}
        self._file.write_text(json.dumps({"seconds": self._seconds, "lines": lines}))

    def _lines(self) -> dict[str, dict[str, str]]:
        self._coverage.stop()
        data = self._coverage.get_data()
        bit = {test: 1 << number for number, test in enumerate(self._seconds)}
        return {
            str(Path(file).relative_to(self._reached)): {
                str(line): f"{bits:x}"
                for line, contexts in data.contexts_by_lineno(file).items()
                if (bits := sum(bit.get(context, 0) for context in contexts))
            }
            for file in data.measured_files()
        }


def _leave(*_: object) -> None:
    """Leave a test that takes too long."""
    importlib.import_module("pytest").skip("takes too long")


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
    if code in (-signal.SIGXCPU, -signal.SIGKILL):
        verdict = verdict or "too long"
    return verdict or ("passed" if code in (0, _NO_TEST) else "failed"), used.ru_utime + used.ru_stime


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
