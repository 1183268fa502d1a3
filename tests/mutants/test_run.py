"""The tool that asks whether tests notice: what it plants, whom it asks, and how it tells."""

import subprocess
import sys
from pathlib import Path

import pytest

from tests.mutants.mutations import Mutation, is_python, mutations_of
from tests.mutants.run import CHECKOUT, equivalents, planted_faults, standing_at
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


def test_all_mutants_of_a_line_can_be_asked_for():
    place = "replay/__init__.py:71"
    found = standing_at(CHECKOUT, [place])
    assert {(m.file, m.line) for m in found} == {("replay/__init__.py", 71)}
    assert {m.kind for m in found} >= {"and/or", "not"}


def test_alike_places_of_a_file_have_different_names():
    first, second = (
        m for m in mutations_of("replay/a.py", "def f(x):\n    x[1]()\n    x[1]()\n") if m.kind == "constant"
    )
    assert (first.number, second.number) == (0, 1) and first.id != second.id
    assert isinstance(first, Mutation)


def written(root, files):
    for name, text in files.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text)


def test_the_nearest_tests_are_asked_and_those_of_everything_last(tmp_path):
    written(
        tmp_path,
        {
            "replay/room/thing.py": "",
            "replay/room/user.py": "from replay.room.thing import x\n",
            "tests/room/test_thing.py": "",
            "tests/room/test_first.py": "def test():\n    import replay.room.thing\n",
            "tests/test_other_room.py": "from replay.room import thing\n",
            "tests/room/shared.py": "from replay.room.thing import x\n",
            "tests/room/test_user.py": "from replay.room.user import y\n",
            "tests/room/test_shared.py": "from tests.room.shared import x\n",
            "tests/test_wheel.py": "import replay.room.thing\n",
            "tests/room/test_other.py": "import json\n",
            "replay/room/__init__.py": "__getattr__ = submodules(x='lazy')",
            "replay/room/lazy.py": "",
        },
    )
    targets = Targets(tmp_path)
    assert "tests/test_other_room.py" in targets.of("replay/room/lazy.py")
    near = [Path(name).stem.removeprefix("test_") for name in targets.of("replay/room/thing.py")]
    assert near == ["thing", "first", "other_room", "shared", "user", "wheel"]
    assert targets.importers("replay/room/thing.py") == {
        "replay/room/user.py",
        "tests/room/test_first.py",
        "tests/test_other_room.py",
        "tests/room/shared.py",
        "tests/test_wheel.py",
    }


TREE = """
import sys
from pathlib import Path
from tests.mutants.trial import Tree
tree = Tree(Path(sys.argv[1]), Path(sys.argv[2]))
"""

TRIALS = """
def ask(text):
    with tree.with_fault("replay/a.py", text):
        outcome = tree.run(["tests/test_a.py"], 5.0, compiled=False)
    print(outcome.verdict, outcome.failed_test == "tests/test_a.py::test_a")
for text in ("x = 1", "x = 2", "x = 1", "while True: pass", "1 / 0", "import os; os.abort()", "x = 1"):
    ask(text + "\\n")
"""


def told(tmp_path, files, script):
    """Lines that a script prints which has the tree of a package of some files."""
    checkout, work = tmp_path / "checkout", tmp_path / "work"
    written(checkout, {"replay/__init__.py": "", "tests/__init__.py": "", **files})
    work.mkdir()
    command = [sys.executable, "-c", TREE + script, str(checkout), str(work)]
    return subprocess.run(command, cwd=CHECKOUT, capture_output=True, text=True, check=True).stdout.splitlines()


def test_a_fault_is_noticed_a_hang_is_ended_and_the_tree_is_as_before(tmp_path):
    test = "import replay.a\n\n\ndef test_a():\n    assert replay.a.x == 1\n"
    assert told(tmp_path, {"replay/a.py": "x = 1\n", "tests/test_a.py": test}, TRIALS) == [
        "passed False",
        "failed True",
        "passed False",
        "too long False",
        "failed False",
        "failed False",
        "passed False",
    ]
    assert (tmp_path / "work" / "tree" / "replay" / "a.py").read_text() == "x = 1\n"
    assert (tmp_path / "checkout" / "replay" / "a.py").read_text() == "x = 1\n"


LEFT = """
outcome = tree.run(["tests/test_a.py"], 60.0, compiled=True, each=0.2)
print(outcome.verdict, list(outcome.by_test))
"""


def test_a_test_that_takes_too_long_is_left_and_no_fault(tmp_path):
    test = "def test_long():\n    while True:\n        pass\n\n\ndef test_short():\n    pass\n"
    assert told(tmp_path, {"tests/test_a.py": test}, LEFT) == ["passed ['tests/test_a.py::test_short']"]


SCHEDULED = """
from tests.mutants import trial
trial._AUTOGROUP = Path(sys.argv[1]) / "autogroup"
print(tree.run(["tests/test_a.py"], 60.0, compiled=False).verdict, trial._AUTOGROUP.read_text().strip())
"""


@pytest.mark.parametrize(("before", "after"), [("", ""), ("/autogroup-7 nice -3\n", "-3")])
def test_a_session_is_as_urgent_as_the_one_before_where_sessions_are_scheduled(tmp_path, before, after):
    """In a container the file may be there and empty."""
    files = {"autogroup": before, "tests/test_a.py": "def test(): pass\n"}
    assert told(tmp_path, files, SCHEDULED) == [f"passed {after}"]


REACH = """
from tests.mutants.mutations import mutations_of
from tests.mutants.reach import Reach
from tests.mutants.targets import Targets
reach = Reach(tree, Targets(tree.root), Path(sys.argv[2]) / "reach")
for mutation in mutations_of("replay/a.py", (tree.root / "replay/a.py").read_text()):
    print(mutation.line, *(test.partition("::")[2] for test in reach.tests(mutation)))
"""

REACHED = """
import numba
LIMIT = 3
def quick(x):
    return x + 1
@numba.njit
def compiled(x):
    return x * 2
def slow(x):
    return compiled(x)
def bounded(x):
    return min(x, LIMIT)
"""

REACHING = """
from replay.a import *
def test_quick(): assert quick(1) == 2
def test_slow(): assert slow(1) == 2
def test_bounded(): assert bounded(1) == 1
def test_failing(): assert bounded(1) == 2
def test_nothing(): pass
"""


def test_the_tests_that_execute_a_line_are_asked_first_or_else_those_that_execute_what_names_it(tmp_path):
    """Compiled lines and constants are executed by no test; their users are. A test that fails anyway is not asked."""
    lines = told(tmp_path, {"replay/a.py": REACHED, "tests/test_a.py": REACHING}, REACH)
    first = {int(line): (test, set(others)) for line, test, *others in map(str.split, lines)}
    all_of_them = {"test_quick", "test_slow", "test_bounded", "test_nothing"}
    assert first == {
        line: (test, all_of_them - {test})
        for line, test in ((3, "test_bounded"), (5, "test_quick"), (8, "test_slow"), (12, "test_bounded"))
    }


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
