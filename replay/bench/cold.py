"""The first run: an empty folder of kernels, each shipped scenario, and what compiling each kernel costs."""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from typing import Any

from replay.bench.goals import Goal
from replay.bench.report import Grid, Report
from replay.bench.shipped import FOLDER

SCENES = "first run, empty kernel cache"
KERNELS = "compiling kernels, one process, exclusive CPU seconds"
_SCENE = "carm_bodyguard"
_LISTED = 15
_COMPILE = """
import json, sys, time, numba
if sys.argv[1] == "plain":
    numba.__version__ = "0"  # one that is not known: kernels are compiled by numba's public decorator
from numba.core import event
from replay.batch.prepare import kernels_for, needs_of
from replay.scenario.load import load

class Watch(event.Listener):
    def __init__(self):
        self.open, self.spent = [], {}
    def on_start(self, event):
        self.open.append([time.process_time(), 0.0])
    def on_end(self, event):
        begin, within = self.open.pop()
        whole = time.process_time() - begin
        function = event.data["dispatcher"].py_func
        name = f"{function.__module__}.{function.__qualname__}"
        self.spent[name] = self.spent.get(name, 0.0) + whole - within
        if self.open:
            self.open[-1][1] += whole

kernels = [kernel for needs in needs_of([load(path) for path in sys.argv[2:]], None) for kernel in kernels_for(needs)]
watch = Watch()
event.register("numba:compile", watch)
begin = time.process_time()
for kernel in dict.fromkeys(kernels):
    kernel.compile(kernel.declared)
print(json.dumps([time.process_time() - begin, watch.spent]))
"""


def measure(report: Report, *, quick: bool) -> None:
    """Add the tables of the first run to a report: about a minute and a half a scene on two busy cores at most.

    Args:
        report: added to.
        quick: two scenes, and no comparison with numba's public decorator.
    """
    names = sorted(path.stem for path in FOLDER.glob("*.yaml") if path.stem != "rules")
    names += [] if quick else sorted(path.stem for path in (FOLDER / "experiments").glob("*.yaml"))
    chosen = [name for name in names if not quick or name in ("carm_clear", _SCENE)]
    rows = [_first_run(name) for name in chosen]
    if rows:
        report.grids[SCENES] = Grid(rows)
    scene = FOLDER / f"{_SCENE}.yaml"
    if not scene.is_file():
        return
    whole, spent = _compiling("ours", [str(scene)])
    slowest = sorted(spent.items(), key=lambda item: -item[1])[:_LISTED]
    table: list[dict[str, Any]] = [{"kernel": name, "CPU [s]": f"{seconds:.2f}"} for name, seconds in slowest]
    table.append({"kernel": f"all {len(spent)}", "CPU [s]": f"{whole:.1f}"})
    if not quick:
        plain, others = _compiling("plain", [str(scene)])
        table.append({"kernel": f"all {len(others)}, by numba's public decorator", "CPU [s]": f"{plain:.1f}"})
        report.goals.append(Goal("cold.kernels", plain / whole))
    report.grids[KERNELS] = Grid(table)


def _first_run(name: str) -> dict[str, Any]:
    path = next(place for place in (FOLDER / f"{name}.yaml", FOLDER / "experiments" / f"{name}.yaml") if place.exists())
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "replay", "run", str(path), "-o", f"{folder}/run"]
        environment = {**os.environ, "NUMBA_CACHE_DIR": f"{folder}/kernels"}
        spent = {}
        for kind in ("first", "second"):
            begin, before = time.perf_counter(), resource.getrusage(resource.RUSAGE_CHILDREN)
            done = subprocess.run([*command, "--overwrite"], env=environment, capture_output=True, check=False)
            after = resource.getrusage(resource.RUSAGE_CHILDREN)
            cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
            spent[kind] = (time.perf_counter() - begin, cpu) if done.returncode in (0, 4) else (float("nan"),) * 2
    return {
        "scenario": name,
        "wall [s]": f"{spent['first'][0]:.1f}",
        "CPU [s]": f"{spent['first'][1]:.1f}",
        "the next run, wall [s]": f"{spent['second'][0]:.1f}",
        "CPU of it [s]": f"{spent['second'][1]:.1f}",
    }


def _compiling(way: str, scenes: Sequence[str]) -> tuple[float, dict[str, float]]:
    with tempfile.TemporaryDirectory() as folder:
        environment = {**os.environ, "NUMBA_CACHE_DIR": folder}
        done = subprocess.run(
            [sys.executable, "-c", _COMPILE, way, *scenes], env=environment, capture_output=True, text=True, check=True
        )
    whole, spent = json.loads(done.stdout)
    return whole, spent
