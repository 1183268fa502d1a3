"""Kernels compiled by the way into numba and by its public decorator: the same results, and each where it belongs."""

import gc
import os
import re
import subprocess
import sys
from pathlib import Path

import numba
import numpy as np
import pytest
from numba import float64, njit
from numba.core.targetconfig import TargetConfig

from replay.geometry.surface_boxes import BOX
from replay.geometry.wide_tree import LANES
from replay.numerics.jit import compiler, kernel, leaf_kernel
from replay.sensing.distance.bounds import box_bounds
from replay.sensing.distance.cone import Cone

ROOT = Path(__file__).parents[3]
FAKED = "import numba\nnumba.__version__ = '0.99.0'\n"


def test_the_numba_of_the_tests_is_one_that_was_tried():
    assert compiler.AVAILABLE, (
        f"numba {numba.__version__} is not tried: see the text of replay/numerics/jit/compiler.py"
    )


@pytest.mark.parametrize(
    "another",
    [FAKED, "from numba.core.registry import CPUDispatcher\nimport numba.core.codegen as c\ndel c.JITCodeLibrary\n"],
    ids=["another version", "a name is gone"],
)
def test_with_another_numba_kernels_are_compiled_by_its_public_decorator(package, another):
    package.write("collision/caller.py", another + (package.root / "collision" / "caller.py").read_text())
    code = "import numba.core.registry as r; print(outer(1.0), alone(1.0), type(outer) is r.CPUDispatcher)"
    assert package.run(code) == "20.0 0.0 True"
    assert not package.files()
    assert list(package.cache.rglob("*.nbc"))  # numba's own cache, in a folder named by all sources
    hits = "print(outer(1.0), sum(outer.stats.cache_hits.values()))"
    assert package.run(hits) == "20.0 1"
    ahead = "import numba; from replay.numerics.jit import compile_entries\n"
    ahead += "for each in (outer, alone): each.declared = (numba.float64,)\n"
    ahead += "compile_entries([outer, alone], share=lambda: print('shared')); print(len(outer.overloads))"
    assert package.run(ahead) == "1"
    callee = (package.root / "geometry" / "callee.py").read_text()
    package.write("geometry/callee.py", callee.replace("1.0", "2.0"))
    assert package.run(hits) == "30.0 0"


INTEGRALS = """
import numpy as np
from replay.numerics.inverse_distance import mean_over_triangle
corners = np.random.default_rng(5).normal(size=(200, 3, 3)) * np.logspace(-9, 3, 200)[:, None, None]
print([float(mean_over_triangle(*(tuple(corner) for corner in triangle))).hex() for triangle in corners.tolist()])
"""

RECORDING = """
import sys
from pathlib import Path
from replay.recording.record import record
from replay.scenario.load import load
record(load(Path("tests/data/frozen/scene.yaml")), sys.argv[1], rrd=False)
"""


def said(code, cache, *arguments):
    command = [sys.executable, "-c", code, *arguments]
    done = subprocess.run(command, env={**os.environ, **cache}, capture_output=True, text=True, check=True, cwd=ROOT)
    return done.stdout, [line for line in done.stderr.splitlines() if "compil" not in line or "slower" in line]


@pytest.mark.compiled
def test_kernels_by_the_public_decorator_say_the_same_to_the_last_digit(tmp_path):
    fast, _ = said(INTEGRALS, {})
    slow, _ = said(FAKED + INTEGRALS, {"NUMBA_CACHE_DIR": str(tmp_path)})
    assert list(tmp_path.rglob("*.nbc")), "numba has kept them itself"
    assert slow == fast
    assert fast.count("0x") == 200


@pytest.mark.soak
def test_a_recording_by_the_public_decorator_is_the_same_and_it_is_said(tmp_path):
    """It takes minutes: everything is compiled for every caller anew."""
    said(RECORDING, {}, str(tmp_path / "fast"))
    prepared = "from replay.numerics.jit import compile_entries; compile_entries([])\n"
    _, remarks = said(FAKED + prepared + RECORDING, {"NUMBA_CACHE_DIR": str(tmp_path)}, str(tmp_path / "slow"))
    assert remarks == [
        "replay: numba 0.99.0 is not known from within (0.68.x is): kernels are the same, compiled slower"
    ]
    fast, slow = ((tmp_path / name / "frozen.mcap").read_bytes() for name in ("fast", "slow"))
    assert slow == fast


def test_another_numba_is_said_before_anything_is_compiled(package):
    package.write("collision/caller.py", FAKED + (package.root / "collision" / "caller.py").read_text())
    process = package.start("from replay.numerics.jit import compile_entries; compile_entries([]); compile_entries([])")
    _, errors = process.communicate()
    assert errors.splitlines() == [
        "replay: numba 0.99.0 is not known from within (0.68.x is): kernels are the same, compiled slower"
    ]


@leaf_kernel
def _square(x):
    return x * x


@kernel
def _lengths(rows):
    result = np.empty(len(rows))
    for k in range(len(rows)):
        result[k] = np.sqrt(_square(rows[k, 0]) + _square(rows[k, 1]))
    return result


@pytest.mark.compiled
def test_what_a_kernel_calls_is_lowered_and_only_what_python_calls_is_compiled():
    rows = np.array([[3.0, 4.0], [5.0, 12.0]])
    assert _lengths(rows).tolist() == [5.0, 13.0]
    assert not _square.overloads
    assert len(_lengths.overloads) == 1
    assert _square(3.0) == 9.0  # called from here too, it gets a wrapper of its own
    assert list(_square.overloads) == [(float64,)]


@pytest.mark.compiled
def test_constants_among_arguments_make_no_specialisations(tmp_path, monkeypatch):
    monkeypatch.setattr("replay.numerics.jit.store.directory", lambda: tmp_path)  # nothing is there already

    @leaf_kernel
    def power(x, n):
        result = 1.0
        for _ in range(n):
            result *= x
        return result

    @kernel
    def powers(x):
        return power(x, 1) + power(x, 2) + power(x, 3)

    assert powers(2.0) == 14.0
    assert len(power._lowered) == 1


@pytest.mark.compiled
def test_loops_of_what_a_kernel_calls_become_vectors(tmp_path, monkeypatch):
    monkeypatch.setattr("replay.numerics.jit.store.directory", lambda: tmp_path)  # from a file it would have no code

    @kernel
    def bounded(boxes, cone, bounds):
        box_bounds(boxes, (0.0, 0.0, 0.0), cone, 0.0, bounds)

    bounds = np.empty(LANES)
    bounded(np.ones(BOX * LANES, dtype=np.float32), Cone(0.0, 0.0, 1.0, 0.8, 0.6, 0.0), bounds)
    (compiled,) = bounded.overloads.values()
    code = str(compiled.library._final_module)
    assert re.search(r"fmul <\d+ x (float|double)>", code), "a walk of the distance sensor's tree takes twice as long"


def test_functions_that_are_no_kernels_can_call_kernels():
    @njit
    def outside(rows):
        return _lengths(rows).sum() + _square(2.0)

    assert outside(np.array([[3.0, 4.0]])) == 9.0


def test_numbas_own_functions_stay_usable_outside_kernels():
    @kernel
    def ours(n):
        return max(np.zeros(n)[0], 1.0)

    @njit
    def theirs(n):
        return max(np.zeros(n)[0], 1.0)

    assert ours(3) == theirs(3) == 1.0


@pytest.mark.compiled
def test_wrong_code_is_a_typing_error_and_leaves_nothing_behind():
    @kernel
    def wrong(x):
        return x.nothing

    for _ in range(2):
        with pytest.raises(numba.core.errors.TypingError, match="nothing"):
            wrong(1.0)
    assert gc.isenabled()
    assert _square(4.0) == 16.0


def test_option_sets_compare_as_numbas_do():
    from numba.core.compiler import Flags

    plain, stated, other = Flags(), Flags(), Flags()
    stated.nrt = Flags.options["nrt"].default
    other.nrt = not Flags.options["nrt"].default
    assert plain == stated
    assert hash(plain) == hash(stated)
    assert plain != other
    assert plain != "something else"
    assert TargetConfig.values(plain) == TargetConfig.values(stated)


LLVM = """
from collections import Counter
import re
import sys
from replay.numerics.jit import front_end, linking
if sys.argv[1] == "all passes":
    front_end._LEFT_OUT = ()
    front_end._known = type("Forgets", (dict,), {"get": lambda self, key: None})()
emit = linking.KernelLibrary.emit
def shown(library):
    emit(library)
    operations = re.findall(r"^  (?:%\\S+ = )?([a-z]+ \\w+)", str(library._final_module), re.M)
    print(library.name, sorted(Counter(operations).items()))
linking.KernelLibrary.emit = shown
from replay.geometry import calipers, convexity
from replay.numerics.jit import entries_of
for each in (*entries_of(calipers), convexity._winds_once):
    each.compile(each.declared)
"""


@pytest.mark.compiled
def test_what_is_left_out_before_llvm_changes_no_code(tmp_path):
    """Kernels that allocate, sort and gather: operations as often as by all of numba's passes."""
    found = []
    for index, passes in enumerate(("all passes", "ours")):
        cache = tmp_path / str(index)
        cache.mkdir(mode=0o700)
        environment = {**os.environ, "NUMBA_CACHE_DIR": str(cache)}
        command = [sys.executable, "-c", LLVM, passes]
        done = subprocess.run(command, env=environment, cwd=ROOT, capture_output=True, text=True, check=True)
        found.append(done.stdout)
    assert found[0] == found[1]
    assert found[0].count("\n") == 2
