"""Kernels are compiled before the first scenario, and those that a batch needs alone."""

import pickle
import subprocess
import sys

import pytest

from replay.batch.prepare import needs_of
from replay.scenario.methods import BUILTIN_MODELS, Model
from tests.batch import scenes

MODELS = {
    "its own": None,
    "the thesis's": BUILTIN_MODELS["thesis2015"],
    "convex pieces by FCL, rays": Model.model_validate(
        {
            "collision": {"bounds": "aabb", "narrowphase": "fcl", "pieces": "convex", "clearance": "always"},
            "distance": {"method": "rays"},
            "capacitive": {"method": "exact"},
        }
    ),
    "triangles by FCL": Model.model_validate({"collision": {"bounds": "sphere", "narrowphase": "fcl"}}),
}


CALLED = """
import gc, pickle, sys, replay
from replay.batch.prepare import PrepareKernels, needs_of
from replay.batch.worker import Messages
scenario, model, savings = pickle.load(sys.stdin.buffer)
PrepareKernels(needs_of([scenario], model), savings=savings)(Messages(lambda message: None))
from replay.numerics.jit.compiler import KernelDispatcher
kernels = [kernel for kernel in gc.get_objects() if isinstance(kernel, KernelDispatcher)]
ready = {(kernel.py_func.__qualname__, types) for kernel in kernels for types in kernel.overloads}
for block in replay.simulate(scenario, model=model, savings=savings): pass
kernels = [kernel for kernel in gc.get_objects() if isinstance(kernel, KernelDispatcher)]
called = {(kernel.py_func.__qualname__, types) for kernel in kernels for types in kernel.overloads}
rare = {kernel.py_func.__qualname__ for kernel in kernels if hasattr(kernel, "rare")}
print(len(ready), sorted(str(each) for each in called - ready if each[0] not in rare))
"""


@pytest.mark.compiled
@pytest.mark.parametrize("savings", [True, False])
@pytest.mark.parametrize("model", MODELS.values(), ids=MODELS)
def test_kernels_are_all_compiled_before_the_first_scenario_but_for_rare_ones(model, savings):
    given = pickle.dumps((scenes.with_meshes(), model, savings))
    done = subprocess.run([sys.executable, "-c", CALLED], check=True, capture_output=True, input=given)
    count, missed = done.stdout.decode().split(maxsplit=1)
    assert missed.strip() == "[]"
    assert int(count) > 5


def test_a_sweep_of_numbers_needs_its_kernels_once():
    models = [Model.model_validate({"capacitive": {"rtol": rtol}}) for rtol in (1e-3, 1e-6)]
    models += [Model.model_validate({"distance": {"method": "rays", "count": count}}) for count in (10, 20)]
    scene, meshes = scenes.scene("a"), scenes.with_meshes()
    found = {need for model in models for need in needs_of([scene, scene, meshes], model)}
    assert len(found) == 4  # two methods, with and without meshes
    assert sum(need.meshes for need in found) == 2
