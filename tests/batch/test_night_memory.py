"""A night that is all recorded for eyes and all changed: memory, handles and files do not grow with its scenarios."""

import contextlib
import os
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest

from replay.cli.exit_codes import ExitCode
from replay.cli.main import run
from tests.batch import scenes

ROOT = Path(__file__).parents[2]
MIB = 1 << 20
WARM = 80
"""Scenarios after which a process has loaded what it needs."""


def watched(command, folder, places):
    """Run a command; return its exit code, and what was used by its processes when so many scenarios were done.

    Returns:
        The code, and by process ("parent" or a worker's number) a list of (scenarios done, MiB, handles).
    """
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "TMPDIR": str(places)}
    seen = {}
    with subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
        parent = psutil.Process(process.pid)
        while process.poll() is None:
            run_, compared = (len(list(folder.glob(f"*/*{end}"))) for end in (".mcap", ".difference.rrd"))
            with contextlib.suppress(psutil.Error):
                for member in (parent, *parent.children(recursive=True)):
                    name, done = ("parent", compared) if member == parent else (member.pid, run_)
                    with member.oneshot():
                        seen.setdefault(name, []).append((done, member.memory_info().rss / MIB, member.num_fds()))
            time.sleep(0.2)
    return process.returncode, seen


def growth(samples, column):
    """Return by how much the last samples are above those of the first WARM scenarios."""
    before = max(sample[column] for sample in samples if sample[0] <= WARM)
    return max(sample[column] for sample in samples[-5:]) - before


@pytest.mark.soak
@pytest.mark.parametrize("count", [240, 1000])
def test_a_night_does_not_grow_with_its_scenarios(tmp_path, count):
    names = [f"s{k:04d}" for k in range(count)]
    for name in names:
        scenes.write(tmp_path / "in", name)
    base = ["regress", str(tmp_path / "in"), "--baseline", str(tmp_path / "base"), "--workers", "2"]
    create = [*base, "-o", str(tmp_path / "first"), "--missing-baseline", "create", "--rrd", "none"]
    assert run(create) is ExitCode.FINE
    for name in names:
        scenes.write(tmp_path / "in", name, distance=1.25)
    out, places = tmp_path / "out", tmp_path / "places"
    places.mkdir()
    command = [sys.executable, "-m", "replay", *base, "-o", str(out), "--rrd", "all"]
    code, seen = watched(command, out, places)
    assert code == ExitCode.DIFFERENT
    assert len(list(out.glob("*/*.difference.rrd"))) == count
    parent = seen.pop("parent")
    workers = [samples for samples in seen.values() if samples[-1][0] > count - WARM and samples[0][0] <= WARM]
    assert len(workers) == 2
    found = {
        "workers [MiB]": [growth(samples, 1) for samples in workers],
        "workers' handles": [growth(samples, 2) for samples in workers],
        "parent [MiB]": growth([sample for sample in parent if sample[0] > 0], 1),
        "parent's handles": growth([sample for sample in parent if sample[0] > 0], 2),
    }
    print(found)
    assert max(found["workers [MiB]"]) <= 60.0, found
    assert found["parent [MiB]"] <= 150.0, found
    assert max(*found["workers' handles"], found["parent's handles"]) <= 8, found
    assert list(places.iterdir()) == []
    assert list(out.rglob("*.part")) == []
