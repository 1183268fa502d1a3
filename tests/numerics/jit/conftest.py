"""A package of its own with the jit policy and kernels that tests edit, each run in a process of its own."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import replay

CALLEE = "from replay.numerics.jit import kernel\n\n\n@kernel\ndef inner(x):\n    return x + {}\n"
CALLER = (
    "from replay.numerics.jit import kernel\nfrom replay.geometry.callee import inner\n\n\n"
    "@kernel\ndef outer(x):\n    return 10.0 * inner(x)\n\n\n@kernel\ndef alone(x):\n    return x - 1.0\n"
)
PROBE = "from replay.collision.caller import *\nfrom replay.numerics.jit.store import directory\n"


class Package:
    """A copy of the jit policy, with a kernel that calls a kernel in another room."""

    def __init__(self, site: Path, cache: Path) -> None:
        self.root, self.cache = site / "replay", cache
        for room in ("numerics", "geometry", "collision"):
            (self.root / room).mkdir(parents=True)
            (self.root / room / "__init__.py").write_text("")
        (self.root / "__init__.py").write_text("")
        numerics = Path(replay.__file__).parent / "numerics"
        shutil.copytree(numerics / "jit", self.root / "numerics" / "jit", ignore=shutil.ignore_patterns("__pycache__"))
        shutil.copy(numerics / "compiling.py", self.root / "numerics")
        shutil.copy(numerics / "remarks.py", self.root / "numerics")
        self.write("geometry/callee.py", CALLEE.format("1.0"))
        self.write("collision/caller.py", CALLER)

    def write(self, name: str, text: str) -> None:
        """Write a module; its size and time stay those it had, where they can: only the content differs."""
        file = self.root / name
        stamp = file.stat() if file.exists() else None
        file.write_text(text)
        if stamp is not None:
            os.utime(file, ns=(stamp.st_atime_ns, stamp.st_mtime_ns))

    def start(self, code: str, **environment: str) -> subprocess.Popen:
        # it is about compiling, whether or not the tests' own kernels are compiled
        own = {name: value for name, value in os.environ.items() if name != "NUMBA_DISABLE_JIT"}
        env = {**own, "NUMBA_CACHE_DIR": str(self.cache), "PYTHONPATH": str(self.root.parent), **environment}
        command = [sys.executable, "-B", "-c", PROBE + code]  # -B: Python itself goes by time and size
        pipe = subprocess.PIPE
        return subprocess.Popen(command, env=env, stdout=pipe, stderr=pipe, text=True, cwd=self.root.parent)

    def run(self, code: str, **environment: str) -> str:
        process = self.start(code, **environment)
        out, err = process.communicate()
        assert process.returncode == 0, err
        return out.strip()

    def files(self) -> set[str]:
        return {file.name for file in self.cache.rglob("*.kernel")}


@pytest.fixture
def package(tmp_path):
    return Package(tmp_path / "site", tmp_path / "cache")
