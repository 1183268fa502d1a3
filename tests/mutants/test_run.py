"""The tool that asks whether tests notice: what it plants, whom it asks, and how it tells."""

import subprocess
import sys
from pathlib import Path

import pytest

from tests.mutants.mutations import Mutation, is_python, mutations_of
from tests.mutants.run import CHECKOUT, equivalents, planted_faults
from tests.mutants.targets import Targets

SOURCE = '''"""Docstring 1 < 2."""
import numpy as np

LEAST: float = 0.5


@kernel
def inside(x: float, half: float = 1.0) -> bool:
    """Return 1 + 1."""
    if x < -half or not np.all(x > 0):
        return False
    count = 0
    count += 3 - 2
    assert count == 1, f"{count + 1}"
    return is_near(x)


class Box:
    def grow(self, flag):
        self.size = max(self.size, 2)
        self.rows.reshape(-1, flag)
        if flag:
            raise ValueError(f"{flag + 1}")
'''


def test_every_kind_of_slip_is_found_where_it_can_be_noticed_and_nowhere_else():
    found = mutations_of("replay/a.py", SOURCE)
    changes = {(m.function, m.old.strip(), m.new.strip()) for m in found}
    test, where = "if x < -half or not np.all(x > 0):", "inside"
    expected = {
        ("", "LEAST: float = 0.5", "LEAST: float = 1.0"),
        (where, "def inside(x: float, half: float = 1.0) -> bool:", "def inside(x: float, half: float = 2.0) -> bool:"),
        (where, test, "if x <= -half or not np.all(x > 0):"),
        (where, test, "if x >= -half or not np.all(x > 0):"),
        (where, test, "if x < half or not np.all(x > 0):"),
        (where, test, "if x < -half and not np.all(x > 0):"),
        (where, test, "if x < -half or np.all(x > 0):"),
        (where, test, "if x < -half or not np.any(x > 0):"),
        (where, test, "if x < -half or not np.all(x >= 0):"),
        (where, test, "if x < -half or not np.all(x <= 0):"),
        (where, test, "if x < -half or not np.all(x > 1):"),
        (where, test, "if not (x < -half or not np.all(x > 0)):"),
        (where, "return False", "return True"),
        (where, "count = 0", "count = 1"),
        (where, "count += 3 - 2", "count += 3 + 2"),
        (where, "count += 3 - 2", "count += 4 - 2"),
        (where, "count += 3 - 2", "count += 3 - 3"),
        (where, "count += 3 - 2", "pass"),
        (where, "return is_near(x)", "return not (is_near(x))"),
        ("Box.grow", "self.size = max(self.size, 2)", "self.size = min(self.size, 2)"),
        ("Box.grow", "self.size = max(self.size, 2)", "self.size = max(self.size, 3)"),
        ("Box.grow", "self.size = max(self.size, 2)", "pass"),
        ("Box.grow", "self.rows.reshape(-1, flag)", "pass"),
        ("Box.grow", "if flag:", "if not (flag):"),
        ("Box.grow", 'raise ValueError(f"{flag + 1}")', "pass"),
    }
    assert changes == expected
    assert all(m.kernel == (m.function == "inside") and m.room == "a" for m in found)
    assert len({m.id for m in found}) == len(found)
    for mutation in found:
        changed = mutation.applied_to(SOURCE)
        assert is_python(changed) and changed != SOURCE and changed.count("\n") == SOURCE.count("\n")
    moved = mutations_of("replay/a.py", "\n\n" + SOURCE)
    assert [m.id for m in moved] == [m.id for m in found]
    with pytest.raises(ValueError, match="is not what it was"):
        found[0].applied_to("\n" + SOURCE)


def test_alike_places_of_a_file_have_different_names():
    first, second = (
        m for m in mutations_of("replay/a.py", "def f(x):\n    x[1]()\n    x[1]()\n") if m.kind == "constant"
    )
    assert (first.number, second.number) == (0, 1) and first.id != second.id
    assert isinstance(first, Mutation)


def test_the_nearest_and_quickest_tests_are_asked_and_those_of_everything_last(tmp_path):
    files = {
        "replay/room/thing.py": "",
        "replay/room/user.py": "from replay.room.thing import x\n",
        "tests/room/test_thing.py": "",
        "tests/room/test_slow.py": "from replay.room import thing\n",
        "tests/room/test_quick.py": "def test():\n    import replay.room.thing\n",
        "tests/room/shared.py": "from replay.room.thing import x\n",
        "tests/room/test_user.py": "from replay.room.user import y\n",
        "tests/room/test_shared.py": "from tests.room.shared import x\n",
        "tests/test_wheel.py": "import replay.room.thing\n",
        "tests/room/test_other.py": "import json\n",
        "replay/room/__init__.py": "__getattr__ = submodules(x='lazy')",
        "replay/room/lazy.py": "",
    }
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    seconds = {f"tests/room/test_{name}.py": 1.0 for name in ("thing", "quick", "user", "shared", "other")}
    seconds |= {"tests/room/test_slow.py": 5.0, "tests/test_wheel.py": 0.1}
    assert "tests/room/test_slow.py" in Targets(tmp_path).of("replay/room/lazy.py", seconds, 100.0)
    every = Targets(tmp_path).of("replay/room/thing.py", seconds, 100.0)
    near = [Path(name).stem.removeprefix("test_") for name in every]
    assert near == ["thing", "quick", "slow", "shared", "user", "wheel"]
    assert Targets(tmp_path).of("replay/room/thing.py", seconds, 4.5) == [
        name for name, stem in zip(every, near, strict=True) if stem != "slow"
    ]
    assert Targets(tmp_path).of("replay/room/thing.py", {"tests/room/test_slow.py": 5.0}, 1.0) == [
        "tests/room/test_slow.py"
    ]


TREE = """
import sys
from pathlib import Path
from tests.mutants.trial import Tree
tree = Tree(Path(sys.argv[1]), Path(sys.argv[2]))
def ask(text):
    with tree.with_fault("replay/a.py", text):
        outcome = tree.run(["tests/test_a.py"], 5.0, compiled=False)
    print(outcome.verdict, "FAILED tests/test_a.py::test_a" in outcome.text)
for text in ("x = 1", "x = 2", "x = 1", "while True: pass", "1 / 0", "import os; os.abort()", "x = 1"):
    ask(text + "\\n")
"""


def test_a_fault_is_noticed_a_hang_is_ended_and_the_tree_is_as_before(tmp_path):
    checkout, work = tmp_path / "checkout", tmp_path / "work"
    for name, text in (
        ("replay/__init__.py", ""),
        ("replay/a.py", "x = 1\n"),
        ("tests/__init__.py", ""),
        ("tests/test_a.py", "import replay.a\n\n\ndef test_a():\n    assert replay.a.x == 1\n"),
    ):
        (checkout / name).parent.mkdir(parents=True, exist_ok=True)
        (checkout / name).write_text(text)
    work.mkdir()
    command = [sys.executable, "-c", TREE, str(checkout), str(work)]
    said = subprocess.run(command, cwd=CHECKOUT, capture_output=True, text=True, check=True).stdout.splitlines()
    assert said == [
        "passed False",
        "failed True",
        "passed False",
        "too long False",
        "failed False",
        "failed False",
        "passed False",
    ]
    assert (work / "tree" / "replay" / "a.py").read_text() == "x = 1\n"
    assert (checkout / "replay" / "a.py").read_text() == "x = 1\n"


@pytest.mark.parametrize("fault", planted_faults(), ids=lambda fault: fault.name)
def test_a_planted_fault_can_be_planted_and_its_tests_are_there(fault):
    source = (CHECKOUT / fault.file).read_text()
    assert is_python(fault.applied_to(source)) and fault.old != fault.new
    for test in fault.tests:
        file, _, name = test.partition("::")
        assert f"def {name}" in (CHECKOUT / file).read_text()


def test_what_is_known_to_change_nothing_still_stands_there():
    for file, old, new in equivalents():
        found = {(m.old.strip(), m.new.strip()) for m in mutations_of(file, (CHECKOUT / file).read_text())}
        assert (old, new) in found or (not new and old in {line for line, _ in found}), f"{file}: {old}"
