"""The wheel, installed outside the checkout, is all that its user needs besides what it depends on."""

import ast
import importlib.metadata
import itertools
import json
import os
import re
import shutil
import subprocess
import sys
import sysconfig
import tomllib
import venv
import zipfile
from pathlib import Path

import pytest

import replay
from replay.numerics.jit import store

ROOT = Path(replay.__file__).parents[1]
NAME = "replay-mechanics"


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    """Return the wheel, built from a copy: building leaves its own files beside the sources."""
    source = tmp_path_factory.mktemp("source")
    for name in ("pyproject.toml", "README.md"):
        shutil.copy(ROOT / name, source)
    for name in ("replay", "schemas", "scenarios"):
        shutil.copytree(ROOT / name, source / name, ignore=shutil.ignore_patterns("__pycache__", "*.nbi", "*.nbc"))
    command = [
        sys.executable,
        "-m",
        "pip",
        "wheel",
        "--no-deps",
        "--no-build-isolation",
        "--no-index",
        "-w",
        "dist",
        ".",
    ]
    done = subprocess.run(command, check=False, cwd=source, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    (built,) = (source / "dist").iterdir()
    return built


@pytest.fixture(scope="module")
def installed(wheel, tmp_path_factory):
    """Return a clean environment with the wheel; what it depends on is seen where it is installed already."""
    place = tmp_path_factory.mktemp("environment")
    venv.create(place, with_pip=False, symlinks=os.name != "nt")
    python = place / "bin" / "python"
    site = Path(sysconfig.get_path("purelib", vars={"base": str(place), "platbase": str(place)}))
    # a path that is named by a .pth file is not searched for further .pth files: the checkout's own stays unseen
    (site / "dependencies.pth").write_text(sysconfig.get_path("purelib") + "\n")
    command = [sys.executable, "-m", "pip", "--python", str(python), "install", "--no-deps", "--no-index", str(wheel)]
    done = subprocess.run(command, check=False, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    if kernels := store.directory():
        shutil.copytree(kernels, place / "cache" / "replay")  # the same code: nothing has to be compiled again
    return place


def use(installed, cwd, *arguments):
    """Return what a command of the environment prints."""
    environment = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
    environment["NUMBA_CACHE_DIR"] = str(installed / "cache")
    command = [str(installed / "bin" / arguments[0]), *map(str, arguments[1:])]
    done = subprocess.run(command, check=False, cwd=cwd, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_the_wheel_holds_what_people_and_editors_need(wheel):
    names = zipfile.ZipFile(wheel).namelist()
    for file in (
        *(ROOT / "schemas").iterdir(),
        *(ROOT / "scenarios").glob("*.yaml"),
        *(ROOT / "replay").rglob("*.j2"),
        *(ROOT / "replay").rglob("*.js"),
    ):
        assert any(name.endswith(f"/{file.relative_to(ROOT)}") or name == str(file.relative_to(ROOT)) for name in names)
    assert "replay/py.typed" in names
    assert not any("__pycache__" in name or name.startswith("tests/") for name in names)


def test_what_is_imported_is_declared():
    declared = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    known = [*declared["dependencies"], *itertools.chain(*declared["optional-dependencies"].values())]
    known = {re.split(r"[\s<>=~!\[;]", requirement)[0].lower().replace("_", "-") for requirement in known}
    owners = importlib.metadata.packages_distributions()
    for path in (ROOT / "replay").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            names += [node.module] if isinstance(node, ast.ImportFrom) and node.module and not node.level else []
            for module in {name.partition(".")[0] for name in names} - sys.stdlib_module_names - {"replay"}:
                found = {name.lower().replace("_", "-") for name in owners.get(module, [])}
                assert not found or found & known, f"{path}: {module} of {', '.join(found)} is not in pyproject.toml"


def test_metadata_say_what_it_is(wheel):
    archive = zipfile.ZipFile(wheel)
    (place,) = (name for name in archive.namelist() if name.endswith(".dist-info/METADATA"))
    lines = archive.read(place).decode().splitlines()
    assert f"Name: {NAME}" in lines
    assert f"Version: {replay.__version__}" in lines
    assert "Requires-Python: >=3.11" in lines
    for begin in ("Summary: ", "Keywords: ", "Description-Content-Type: text/markdown", "Provides-Extra: dask"):
        assert any(line.startswith(begin) for line in lines), begin


@pytest.fixture(scope="module")
def recorded(installed, tmp_path_factory):
    """Return a folder in which the environment has run a scenario that comes with it, twice."""
    folder = tmp_path_factory.mktemp("recorded")
    for name in ("one", "two"):
        use(installed, folder, "replay", "run", installed / "share/replay/scenarios/carm_clear.yaml", "-o", name)
    return folder


def test_it_runs_and_compares_outside_the_checkout(installed, recorded, tmp_path):
    where = use(installed, tmp_path, "python", "-c", "import replay; print(replay.__file__)")
    assert Path(where.strip()).is_relative_to(installed)
    assert use(installed, tmp_path, "replay", "--version").split()[-1] == replay.__version__
    assert json.loads(use(installed, tmp_path, "replay", "schema"))["$schema"].startswith("https://json-schema.org/")
    assert "same" in use(installed, recorded, "replay", "diff", "one", "two")


@pytest.mark.skipif(not list(Path("/usr/share/vulkan/icd.d").glob("*.json")), reason="needs a Vulkan driver")
def test_it_shows_outside_the_checkout(installed, recorded, tmp_path):
    file, picture = recorded / "one" / "carm_clear" / "carm_clear.rrd", tmp_path / "picture.png"
    use(installed, tmp_path, "replay", "view", file, "--screenshot", picture, "--at", "1")
    assert picture.read_bytes().startswith(b"\x89PNG")
