"""Nothing that lies in the folder in which a command is called is imported: not by it, nor by what it starts."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

import replay
from replay.batch.import_path import import_path
from tests.batch import scenes
from tests.batch.tasks import behave

ROOT = Path(replay.__file__).parents[1]
LIBRARIES = ("numpy", "numba", "click", "rich", "pydantic", "ruamel", "psutil", "zstandard", "google", "scipy", "yaml")


@pytest.fixture(scope="module")
def hostile(tmp_path_factory):
    """A folder with a file of each module's name, in whose place it would be run."""
    folder = tmp_path_factory.mktemp("hostile")
    for name in {*sys.stdlib_module_names, *LIBRARIES} - {*sys.builtin_module_names, "sys"}:
        text = f"open({str(folder / 'RAN')!r}, 'a').write({name!r} + chr(10))\nraise ImportError('not the real one')\n"
        (folder / f"{name}.py").write_text(text)
    scenes.write(folder, "good")
    return folder


def call(command, folder, **environment):
    environment = {**os.environ, "PYTHONPATH": str(ROOT), **environment}
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert not (folder / "RAN").exists(), (folder / "RAN").read_text()
    return done.stdout


def script(folder, text):
    """Return a script in a folder of its own, as an installed command is one."""
    folder.mkdir()
    (folder / "command.py").write_text(text)
    return str(folder / "command.py")


def test_neither_by_the_command_nor_by_its_workers(hostile, tmp_path):
    arguments = ("run", "good.yaml", "--no-rrd", "--workers", "1", "-o")
    said = call([sys.executable, "-m", "replay", *arguments, str(tmp_path / "a")], hostile)
    assert "good: passed" in said
    command = script(tmp_path / "bin", "from replay.cli.main import main\nmain()\n")
    call([sys.executable, command, *arguments, str(tmp_path / "b")], hostile)
    a, b = (tmp_path / name / "good" / "good.mcap" for name in "ab")
    assert a.read_bytes() == b.read_bytes()


STARTS = """
import multiprocessing, sys
from replay.cli.main import main

def double(number, answers):
    answers.put(2 * number)

if __name__ == "__main__":
    try:
        main(["--version"])
    except SystemExit:
        pass
    for way in ("spawn", "forkserver"):
        context = multiprocessing.get_context(way)
        answers = context.SimpleQueue()
        process = context.Process(target=double, args=(21, answers))
        process.start()
        process.join()
        print(way, process.exitcode or answers.get())
"""


@pytest.mark.skipif(os.name != "posix", reason="there is no forkserver")
def test_nor_by_processes_that_libraries_start(hostile, tmp_path):
    said = call([sys.executable, script(tmp_path / "bin", STARTS)], hostile)
    assert said.splitlines()[-2:] == ["spawn 42", "forkserver 42"]


def test_settings_that_libraries_look_for_there_change_nothing(tmp_path):
    """numba reads a file in the current folder, which could leave kernels uncompiled or change their last digits."""
    (tmp_path / ".numba_config.yaml").write_text("disable_jit: 1\nopt: '0'\n")
    code = (
        "from numba.core import config; from replay.geometry import closing; print(config.DISABLE_JIT, int(config.OPT))"
    )
    pytest.importorskip("yaml")
    assert call([sys.executable, "-P", "-c", code], tmp_path).split() == ["0", "3"]


def test_a_checkout_is_found_where_it_is_the_current_folder(tmp_path, monkeypatch):
    monkeypatch.setattr(sys, "path", ["", str(tmp_path), "/somewhere", str(ROOT)])
    monkeypatch.chdir(tmp_path)
    assert import_path(behave.__module__) == ["/somewhere", str(ROOT)]
    monkeypatch.chdir(ROOT)
    assert import_path(behave.__module__) == [str(ROOT), str(tmp_path), "/somewhere", str(ROOT)]
