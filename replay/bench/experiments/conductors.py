"""Experiments V and VI: what the thesis's model has no words for, by electrostatics.

V: two sensors side by side, a hand over one of them, driven alone and together. VI: a person who floats, who is
connected to earth by 100 pF (the human body model of electrostatic discharge, IEC 61340-3-1), and who is grounded.
"""

from __future__ import annotations

import math
from importlib import resources
from pathlib import Path
from typing import Any

from replay.bench.experiments.measured import PICOFARAD
from replay.bench.experiments.tables import Cell, Table
from replay.numerics.arrays import Floats
from replay.scenario.curve_plot import Line, Panel
from replay.scenario.load import load
from replay.scenario.methods import Model
from replay.scenario.model import Scenario
from replay.sensing.capacitive.columns import CapacitiveColumns
from replay.sensing.capacitive.part import CapacitiveMethod
from replay.simulation import simulate

_EARTH = {"floating": 0.0, "100 pF": 100.0 * PICOFARAD, "grounded": math.inf}
_AT = "distance_cm"


def run_neighbours(_folder: Path) -> tuple[list[Table], list[Panel]]:
    """Return table and drawing of experiment V: by how much outputs fall for a hand that is 2 m away at first."""
    scenario = _shipped("neighbours")
    falls: dict[str, Floats] = {}
    for drive in ("alone", "together"):
        at, found = _read(scenario, CapacitiveMethod(method="field", drive=drive))
        for k, sensor in enumerate(("covered", "neighbour")):
            falls[f"{sensor}, {drive} [mV]"] = 1e3 * (found.output_voltage[0, k] - found.output_voltage[:, k])
    _, thesis = _read(scenario, CapacitiveMethod())
    for k, sensor in enumerate(("covered", "neighbour")):
        falls[f"{sensor}, thesis [mV]"] = 1e3 * (thesis.output_voltage[0, k] - thesis.output_voltage[:, k])
    last = {name: float(fall[-1]) for name, fall in falls.items()}
    alone, together = (100.0 * last[f"neighbour, {d} [mV]"] / last[f"covered, {d} [mV]"] for d in ("alone", "together"))
    remarks = [
        f"A hand at {at[-1]:g} cm over one sensor moves the one beside it by {alone:+.1f} %"
        f" of what the covered one falls when driven alone, and by {together:+.1f} % when driven together.",
        "The thesis's model, here with the vacuum's permittivity and nothing fitted, adds up what each plate has before"
        " it: no capacitances between plates, no shielding.",
    ]
    title = "V. Two neighbouring sensors, a hand over one of them: by how much output voltages fall"
    return _shown("experiment_5_neighbours", title, "fall of the output [mV]", at, falls, remarks)


def run_person(_folder: Path) -> tuple[list[Table], list[Panel]]:
    """Return table and drawing of experiment VI: what a person adds to a sensor's capacitance, by how he is earthed."""
    scenario = _shipped("person")
    adds: dict[str, Floats] = {}
    for name, earth in _EARTH.items():
        person = scenario.links["person"].model_copy(update={"earth": earth})
        changed = _copy(scenario, links={**scenario.links, "person": person})
        at, found = _read(changed, CapacitiveMethod(method="field"))
        assert found.increase is not None
        adds[f"{name} [pF]"] = found.increase[:, 0] / PICOFARAD
    adds["thesis [pF]"] = _read(scenario, CapacitiveMethod())[1].capacitance[:, 0] / PICOFARAD
    earthed, floating, grounded = (adds[f"{name} [pF]"] for name in ("100 pF", "floating", "grounded"))
    near, far = -1, 1
    remarks = [
        f"With 100 pF to earth he reads {100.0 * float((earthed / grounded).min() - 1.0):+.1f} % at the most beside a"
        f" grounded person; floating, {100.0 * float(floating[near] / grounded[near] - 1.0):+.0f} % at"
        f" {at[near]:g} cm and {100.0 * float(floating[far] / grounded[far] - 1.0):+.0f} % at"
        f" {at[far]:g} cm.",
        "The thesis's model, here with the vacuum's permittivity and nothing fitted, knows no earth.",
    ]
    title = "VI. A person before a plate with a grounded sheet behind it: what he adds to its capacitance"
    return _shown("experiment_6_person", title, "increase [pF]", at, adds, remarks)


def _shipped(name: str) -> Scenario:
    with resources.as_file(resources.files("replay.bench.experiments").joinpath(f"{name}.yaml")) as path:
        return load(path)


def _copy(scenario: Scenario, **changed: Any) -> Scenario:
    other = scenario.model_copy(update=changed)
    other._provenance = scenario.provenance
    return other


def _read(scenario: Scenario, method: CapacitiveMethod) -> tuple[list[float], CapacitiveColumns]:
    """Return the distances [cm] and the readings of all frames, each of them solved."""
    (block,) = simulate(scenario, model=Model(capacitive=method), savings=False)
    return (100.0 * block.joint_positions[:, 0]).round(6).tolist(), block.readings["capacitive"]


def _shown(
    name: str, title: str, y: str, at: list[float], columns: dict[str, Floats], remarks: list[str]
) -> tuple[list[Table], list[Panel]]:
    """Return the table over distances, and the drawing of all but the first, which is far away."""
    rows: list[dict[str, Cell]] = [
        {_AT: at[i], **{column: float(values[i]) for column, values in columns.items()}} for i in range(len(at))
    ]
    lines = [
        Line(column.rpartition(" [")[0], at[1:], values[1:], color=color)
        for color, (column, values) in enumerate(columns.items())
    ]
    return [Table(name, title, rows, remarks)], [Panel(title.partition(":")[0], _AT, y, lines, logarithmic=True)]
