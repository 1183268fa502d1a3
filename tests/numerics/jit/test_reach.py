"""A kernel's key changes with all that it is made of, and with nothing else: an edit is never served stale."""

import importlib
import pkgutil
import sys
import types
from typing import NamedTuple

import numba
import numpy as np
import pytest
from numba import float64, int64

import replay
from replay.collision.broad import sieve
from replay.collision.narrow import decide
from replay.numerics.jit import entries_of, kernel
from replay.numerics.jit.reach import key_of, name_of, reached, type_text
from replay.sensing.distance.exact import sweep_exact
from tests.numerics.jit.conftest import CALLEE, CALLER

HEAD = "from replay.numerics.jit import kernel\n"


def test_an_edited_callee_in_another_module_is_never_served_stale(package):
    assert package.run("print(outer(1.0))") == "20.0"
    package.write("geometry/callee.py", CALLEE.format("2.0"))
    assert package.run("print(outer(1.0))") == "30.0"


def test_an_edited_kernel_that_is_not_reached_compiles_nothing_again(package):
    assert package.run("print(outer(1.0), alone(1.0))") == "20.0 0.0"
    package.write("collision/caller.py", CALLER.replace("x - 1.0", "x - 3.0"))
    hits = "print(outer(1.0), alone(1.0), len(outer.stats.cache_hits), len(alone.stats.cache_hits))"
    assert package.run(hits) == "20.0 -2.0 1 0"


def made(text, monkeypatch, constants="STEP = 1.0\n\n\n@kernel\ndef step(y):\n    return y + 1.0\n"):
    """The kernel `inner` of a module with this text, which can import `edited.constants`."""
    for name, source in (("edited", ""), ("edited.constants", HEAD + constants), ("edited.callee", HEAD + text)):
        module = types.ModuleType(name)
        vars(module)["__path__"] = []
        monkeypatch.setitem(sys.modules, name, module)
        monkeypatch.setattr("replay.numerics.jit.reach._file_hash", lambda name, text=text: text)
        if name == "edited.callee":
            sys.modules["edited"].constants = sys.modules["edited.constants"]
        exec(source, vars(module))
    return module.inner


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ("STEP = 1.0\n@kernel\ndef inner(x):\n    return x + STEP\n", "1.0 -> 2.0"),
        ("STEPS = (1.0, 5.0)\n@kernel\ndef inner(x):\n    return x + STEPS[0]\n", "(1.0 -> (2.0"),
        ("import numpy as np\nS = np.array([1.0])\n@kernel\ndef inner(x):\n    return x + S[0]\n", "[1.0 -> [2.0"),
        (
            "from edited import constants as c\n@kernel\ndef inner(x):\n    return x + c.STEP\n",
            "STEP = 1.0 -> STEP = 2.0",
        ),
        (
            "from edited import constants as c\n@kernel\ndef inner(x):\n    return x + c.step(0.0)\n",
            "y + 1.0 -> y + 2.0",
        ),
        ("from edited.constants import step as s\n@kernel\ndef inner(x):\n    return x + s(0.0)\n", "y + 1 -> y + 2"),
        ("@kernel\ndef inner(x, step=1.0):\n    return x + step\n", "=1.0 -> =2.0"),
        (
            "def make(step):\n    @kernel\n    def inner(x):\n        return x + step\n    return inner\n"
            "inner = make(1.0)\n",
            "make(1.0 -> make(2.0",
        ),
        (
            "from numba.extending import overload\ndef step():\n    pass\n@overload(step)\ndef _step():\n"
            "    return lambda: 1.0\n@kernel\ndef inner(x):\n    return x + step()\n",
            ": 1.0 -> : 2.0",
        ),
        (
            "import enum\nclass Step(enum.IntEnum):\n    ONE = 1\n@kernel\ndef inner(x):\n    return Step.ONE == 1\n",
            "ONE = 1 -> ONE = 2",
        ),
        (
            "from typing import NamedTuple\nclass Box(NamedTuple):\n    low: float\n    high: float\n"
            "@kernel\ndef inner(x):\n    return Box(x, 2.0).low\n",
            "    low: float\n    high: float -> high: float\n    low: float",
        ),
        ("@kernel\ndef inner(x):\n    return [y + 1.0 for y in x]\n", "1.0 -> 2.0"),
    ],
)
@pytest.mark.compiled
def test_whatever_a_kernel_takes_from_elsewhere_is_in_its_key(before, after, monkeypatch):
    old, new = after.split(" -> ")
    if old.startswith(" "):
        new = "    " + new
    constants = "STEP = 1.0\n\n\n@kernel\ndef step(y):\n    return y + 1.0\n"
    key = key_of(made(before, monkeypatch, constants), [float64])
    assert key_of(made(before, monkeypatch, constants), [float64]) == key
    edited = made(before.replace(old, new), monkeypatch, constants.replace(old, new))
    assert (before + constants).count(old) > 0
    assert key_of(edited, [float64]) != key


def test_a_constant_and_a_function_of_another_module_are_never_served_stale(package):
    package.write("geometry/constants.py", HEAD + "STEP = 1.0\n\n\n@kernel\ndef step(y):\n    return y + 1.0\n")
    by_module = "import replay.geometry.constants as c\n\n\n@kernel\ndef inner(x):\n    return c.step(x) * c.STEP\n"
    package.write("geometry/callee.py", HEAD + by_module)
    assert package.run("print(outer(1.0))") == "20.0"
    package.write("geometry/constants.py", HEAD + "STEP = 2.0\n\n\n@kernel\ndef step(y):\n    return y + 2.0\n")
    assert package.run("print(outer(1.0))") == "60.0"


def test_named_tuples_whose_fields_change_places_are_other_arguments():
    first, second = (NamedTuple("Box", [(a, float), (b, float)]) for a, b in (("low", "high"), ("high", "low")))
    texts = [type_text(numba.typeof(kind(1.0, 2.0))) for kind in (first, second)]
    assert texts[0] != texts[1]


def test_comments_docstrings_and_places_in_a_file_compile_nothing_again(monkeypatch):
    plain = "@kernel\ndef inner(x):\n    return x + 1.0\n"
    said = '\n\n# further down\n@kernel\ndef inner(x):\n    """Say more."""\n    # and why\n    return x + 1.0\n'
    assert key_of(made(plain, monkeypatch), [float64]) == key_of(made(said, monkeypatch), [float64])


@pytest.mark.compiled
def test_an_edit_of_the_cone_sensor_leaves_collision_alone():
    assert not {name for name in (*reached(decide), *reached(sieve)) if name.startswith("replay.sensing.")}
    assert len(reached(decide)) > 30
    assert not {name for name in reached(sweep_exact) if name.startswith("replay.collision.")}


class Old(NamedTuple):
    a: float
    b: int


def test_types_are_told_apart_by_layout_dimensions_and_fields():
    texts = [
        type_text(kind)
        for kind in (
            float64,
            int64,
            float64[::1],
            float64[:],
            float64[:, ::1],
            numba.types.Array(float64, 1, "C", readonly=True),
            numba.types.NamedTuple((float64, int64), Old),
            numba.types.UniTuple(float64, 2),
            numba.types.Tuple((float64, int64)),
        )
    ]
    assert len({*texts}) == len(texts)
    assert "Old(a: float64, b: int64)" in texts[6]


def test_keys_are_the_same_in_every_process(package):
    code = "from numba import float64\nfrom replay.numerics.jit.reach import key_of\nprint(key_of(outer, [float64]))"
    assert len({package.run(code, PYTHONHASHSEED=seed) for seed in ("1", "2", "3")}) == 1
    assert package.run(code) != package.run(code, NUMBA_OPT="1")


def test_every_entry_has_a_name_of_its_own_and_a_key():
    found = []
    for module in pkgutil.walk_packages(replay.__path__, "replay."):
        if module.name.split(".")[1] in ("collision", "geometry", "sensing", "numerics"):
            found += entries_of(importlib.import_module(module.name))
    assert len(found) > 20
    assert len({name_of(each, each.declared) for each in found}) == len(found)
    assert len({key_of(each, each.declared) for each in found}) == len(found)


def test_kernels_typed_in_at_a_prompt_have_a_key():
    made = {}
    exec("def typed(x):\n    return x + step\n", made | {"__name__": "__main__", "step": np.float64(1.0)}, made)
    assert key_of(kernel(made["typed"]), [float64]) != key_of(kernel(made["typed"]), [int64])
