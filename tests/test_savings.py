"""With every saving switched off the results are the same: what "only what a scene needs" leaves out, changes nothing."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from replay.errors import InvalidValue
from replay.recording.reader import read
from replay.recording.record import record
from replay.scenario.load import load, load_cases
from replay.scenario.methods import CapacitiveMethod, CollisionMethod, DistanceMethod, Model
from replay.scenario.scene import build
from replay.simulation import Simulation, simulate

SHIPPED = sorted(path for path in Path("scenarios").glob("*.yaml") if path.name != "rules.yaml")

CLEARANCE = {"rtol": 1e-11, "atol": 1e-13}
"""A clearance is right to 1e-12 of itself plus 1e-14 of the bodies' reach, from whatever simplex GJK starts."""


def thinned(scenario, frames):
    """The same motion with so many frames."""
    return scenario.model_copy(update={"rate": (frames - 1) / scenario.duration})


def both(scenario, model=None):
    """All columns of a run with savings and of one without."""
    found = []
    for savings in (True, False):
        simulation = Simulation(build(scenario, model=model, savings=savings))
        blocks = list(simulation.blocks())
        columns = {}
        for group in ("collision", "distance", "capacitive"):
            if getattr(blocks[0], group) is not None:
                names = [field.name for field in dataclasses.fields(getattr(blocks[0], group))]
                for name in names:
                    columns[f"{group}.{name}"] = np.concatenate([getattr(getattr(b, group), name) for b in blocks])
        found.append((simulation, columns))
    return found


def compare(columns, others, rtol=0.0):
    """Bit for bit, but for clearances, and for what a tree summed."""
    assert columns.keys() == others.keys()
    for name, values in columns.items():
        if name == "collision.clearance":
            np.testing.assert_allclose(values, others[name], **CLEARANCE, err_msg=name)
        elif rtol and name.startswith("capacitive.") and values.dtype == np.float64:
            # a voltage is smoother than its capacitance; the delta output is at most as sensitive as it, relative to it
            np.testing.assert_allclose(values, others[name], rtol=rtol, atol=0.0, err_msg=name)
        else:
            np.testing.assert_array_equal(values, others[name], err_msg=name)


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_shipped_scenarios_read_the_same(path):
    for scenario in load_cases(path):
        frames = 4 if scenario.name == "doctor_walks_in" else 13
        (saving, columns), (full, others) = both(thinned(scenario, frames))
        compare(columns, others, saving.scene.model.rtol)
        assert (full.collision.counters.narrow, full.collision.counters.repeated) == (columns["collision.level"].size, 0)
        assert saving.collision.counters.narrow < 0.5 * full.collision.counters.narrow
