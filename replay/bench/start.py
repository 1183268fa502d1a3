"""How long commands take to start, and the first run of all, each in a fresh process; what they load needlessly."""

from __future__ import annotations

import json
import math
import subprocess
import sys
import time
from collections.abc import Sequence
from importlib import resources

from replay.bench import cold
from replay.bench.goals import Goal
from replay.bench.report import Grid, Report
from replay.bench.shipped import FOLDER

HEAVY = ("numba", "rerun", "trimesh", "scipy", "matplotlib", "pyarrow", "fcl")
PROMISED = HEAVY[:3]
_COMMAND = """
import json, sys
from replay.cli.main import run
code = run(sys.argv[2:])
print(json.dumps([name for name in json.loads(sys.argv[1]) if name in sys.modules]), file=sys.stderr)
sys.exit(code)
"""
TABLE = "start of commands, fresh processes"


def run(*, quick: bool = False, rounds: int | None = None, first_runs: bool = True) -> Report:
    """Run the benchmark.

    Args:
        quick: fewer rounds, and of the first run two scenes; about a minute.
        rounds: 7, or 3 when quick, if None.
        first_runs: whether to run scenarios on an empty folder of kernels too, which takes minutes.
    """
    report = Report("start")
    with resources.as_file(resources.files("replay.bench").joinpath("pipeline.yaml")) as path:
        scene = FOLDER / "carm_bodyguard.yaml"
        commands = {
            "bare python": ["-c", "pass"],
            "import replay": ["-c", "import replay"],
            "replay --help": ["-m", "replay", "--help"],
            "replay validate": ["-m", "replay", "validate", str(scene if scene.exists() else path)],
        }
        times = {
            name: [_seconds(command) for _ in range(rounds or (3 if quick else 7))]
            for name, command in commands.items()
        }
        loaded = {name: _loaded(command[2:]) for name, command in commands.items() if command[0] == "-m"}
    report.grids[TABLE] = Grid(
        [
            {
                "command": name,
                "fastest [s]": f"{min(taken):.3f}",
                "slowest [s]": f"{max(taken):.3f}",
                "loads of the heavy": ", ".join(loaded[name]) or "none" if name in loaded else "",
            }
            for name, taken in times.items()
        ]
    )
    report.goals.append(Goal("start.help", min(times["replay --help"])))
    report.goals.append(Goal("start.validate", min(times["replay validate"])))
    report.goals.append(
        Goal("start.modules", float(len({*loaded["replay validate"], *loaded["replay --help"]} & {*PROMISED})))
    )
    if first_runs:
        cold.measure(report, quick=quick)
    return report


def _seconds(command: Sequence[str]) -> float:
    """Return how long a command takes; NaN if it fails."""
    begin = time.perf_counter()
    done = subprocess.run([sys.executable, *command], capture_output=True, check=False)
    return time.perf_counter() - begin if done.returncode == 0 else math.nan


def _loaded(arguments: Sequence[str]) -> list[str]:
    done = subprocess.run(
        [sys.executable, "-c", _COMMAND, json.dumps(HEAVY), *arguments], capture_output=True, text=True, check=False
    )
    found: list[str] = json.loads(done.stderr.splitlines()[-1])
    return found
