"""A sample of the soak over all doors, the soak itself, and every input that has broken something before."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.fuzz import guard
from tests.fuzz.door import knock
from tests.fuzz.doors import House
from tests.fuzz.run import CORPUS

ROOT = Path(__file__).parents[2]
KEPT = sorted(path.parent for path in CORPUS.rglob("DOOR"))


def executions(count: int, seed: int) -> str:
    """Run inputs in a process of its own, whose hook and peak of memory concern nothing else."""
    command = [sys.executable, "-m", "tests.fuzz.run", str(count), str(seed)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout[-5000:] + done.stderr[-5000:]
    return done.stdout


def test_a_sample_of_damage_at_every_door() -> None:
    told = executions(400, seed=1)
    assert " 0 kinds broken" in told
    assert told.count(": refused") > 10 and told.count(": read") > 10


@pytest.mark.soak
def test_a_million_inputs() -> None:
    assert " 0 kinds broken" in executions(int(os.environ.get("SOAK", "1000000")), seed=2)


@pytest.mark.parametrize("way", ["/etc/hostname", "in/../{up}etc/hostname", "link"])
def test_a_foreign_file_is_noticed_whichever_way_it_is_named(way: str, tmp_path: Path) -> None:
    (tmp_path / "in").mkdir()
    (tmp_path / "link").symlink_to("/etc/hostname")
    file = tmp_path / way.format(up="../" * 20)
    code = f"from tests.fuzz import guard\nguard.install()\nwith guard.watched():\n    open({str(file)!r})\n"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False)
    assert "AssertionError: opened: ['open /etc/hostname']" in done.stderr


@pytest.fixture(scope="module")
def house(tmp_path_factory: pytest.TempPathFactory) -> House:
    return House(tmp_path_factory.mktemp("house"))


@pytest.mark.parametrize("case", KEPT, ids=lambda path: path.relative_to(CORPUS).as_posix())
def test_what_broke_once_is_refused_or_read(case: Path, house: House, tmp_path: Path) -> None:
    door = house.doors[(case / "DOOR").read_text().strip()]
    files = {
        file.relative_to(case).as_posix(): file.read_bytes()
        for file in case.rglob("*")
        if file.is_file() and file.name != "DOOR"
    }
    with guard.watched():
        knock(door, tmp_path, files)
