"""Frozen readings of every version of every method: `make freeze` adds those of revisions that have none yet.

They are the signals of a scene, each with the method it depends on: the bounds say where volumes meet, the narrow
phase what convex shapes do, the pieces what concave shapes do. Numbers are kept of each fourth frame, states of all, as
the frames in which they change. What two readings may be apart is what scenarios/rules.yaml accepts.
"""

import functools
import json
import tempfile
from pathlib import Path

import numpy as np

from replay.collision.columns import Level
from replay.comparison.numbers import compare_numbers
from replay.comparison.rules_file import read_rules
from replay.comparison.signals import BETWEEN_FRAMES, groups
from replay.numerics.columns import Kind
from replay.recording.reader import read
from replay.recording.record import record
from replay.scenario.load import load
from replay.scenario.methods import METHOD_REVISIONS, Model
from replay.scenario.scene import build

FOLDER = Path(__file__).parent / "data" / "frozen"
READINGS = FOLDER / "readings.json"
RULES = Path(__file__).parents[1] / "scenarios" / "rules.yaml"
EVERY = 4
CONCAVE = ("arm/bow", "tool/bracket")
SCENE = "scene"
OWN_SCENES = {"capacitive.bem": "conductors", "capacitive.field": "conductors"}
"""Versions that are asked of a scene of their own."""


@functools.cache
def recording_of(method):
    """Its scene, recorded under a version of a method, such as "distance.rays"; defaults for all else."""
    kind, *option = method.split(".")
    choice = {option[0]: option[1]} if len(option) == 2 else {"method": "".join(option)}
    model = Model.model_validate({} if method == SCENE else {kind: choice})
    with tempfile.TemporaryDirectory() as folder:
        scenario = load(FOLDER / f"{OWN_SCENES.get(method, SCENE)}.yaml")
        return read(record(scenario, folder, model=model, rrd=False).mcap)


def signals_of(method):
    """All signals of the scene: full name, values (F,), and whether they are states."""
    for group in groups(recording_of(method)):
        for column, signal in enumerate(group.signals):
            values = group.values[:, column]
            if group.field.kind is Kind.ROTATION:
                yield from (
                    (f"{signal.full_name}.{axis}", part, False) for axis, part in zip("xyzw", values.T, strict=True)
                )
            else:
                yield signal.full_name, values, group.field.kind.is_state


def depends(method, name, values):
    """What of a signal depends on this version of a method and on as little else as can be; None for nothing."""
    _, kind, field, *pair = name.split("/", 3)
    if method == SCENE:
        return values if kind in ("joint_states", "tf") else None
    family = method.rpartition(".")[0]
    if not family.startswith("collision"):
        return values if kind == family else None
    if kind != "collision":
        return None
    if family == "collision.bounds":
        return values >= Level.BOUNDS if field == "level" else None
    if (family == "collision.between") != (field in BETWEEN_FRAMES):
        return None
    if family == "collision.between":
        return values
    if any(shape in pair[0] for shape in CONCAVE) != (family == "collision.pieces"):
        return None
    return values == Level.CONTACT if field == "level" else values


def kept(values, states):
    """A signal as it is kept: numbers of some frames, or [frame, state] of each change."""
    if states:
        values = values.astype(int)
        at = [0, *(np.flatnonzero(np.diff(values)) + 1).tolist()]
        return [[frame, int(values[frame])] for frame in at]
    return [float(f"{value:.12g}") if np.isfinite(value) else None for value in values[::EVERY].tolist()]


def readings(method):
    """What is frozen of a version of a method, or of the scene itself, by signal."""
    rules = read_rules(RULES)
    found = {}
    for name, values, states in signals_of(method):
        part = depends(method, name, values)
        if part is not None and not rules.tolerance(name).ignore:
            found[name] = kept(part, states)
    if method == SCENE:
        for shape in build(load(FOLDER / f"{SCENE}.yaml")).shapes:
            corners = shape.solid.triangles
            found[f"corners of {shape.name}"] = [len(corners), *corners.std(axis=(0, 1)).round(12).tolist()]
    return found


def changes(frozen, now):
    """One line for each signal that is not what was frozen, within the rules; what is new is no change."""
    rules = read_rules(RULES)
    found = []
    for name, before in frozen.items():
        after = now.get(name)
        if after is None or len(before) != len(after) or (before and isinstance(before[0], list)):
            if before != after:
                found.append(f"{name}: {after} was {before}")
            continue
        a, b = (np.array(values, dtype=float) for values in (before, after))
        outside = compare_numbers(a, b, rules.tolerance(name)).outside
        if outside.any():
            at = int(np.flatnonzero(outside)[0])
            found.append(f"{name}: from frame {EVERY * at} on, {b[at]:.12g} was {a[at]:.12g}")
    return found


def advice(method):
    """What to do when a version's readings are not what was frozen."""
    revision = METHOD_REVISIONS[method]
    kind, _, choice = method.partition(".")
    place = f"METHOD_REVISIONS[{method!r}] in replay/scenario/methods.py"
    if kind != "collision":
        place = f"revisions[{choice!r}] in replay/sensing/{kind}/kind.py"
    meant = f"raise {place} from {revision} to {revision + 1}, then `make freeze`"
    return f"if that is meant, {meant}; if not, it is a fault"


def key_of(method):
    """Return the name of a version's entry, with its revision."""
    return method if method == SCENE else f"{method}@{METHOD_REVISIONS[method]}"


def freeze(file, now):
    """Add the entries that a file lacks and drop those of revisions that are no more; an entry never changes."""
    before = json.loads(file.read_text()) if file.exists() else {}
    entries = {key_of(method): before.get(key_of(method)) or now(method) for method in (SCENE, *METHOD_REVISIONS)}
    lines = [
        f"{json.dumps(key)}: {{\n" + ",\n".join(f"  {json.dumps(n)}: {json.dumps(v)}" for n, v in entry.items()) + "\n}"
        for key, entry in entries.items()
    ]
    file.write_text("{\n" + ",\n".join(lines) + "\n}\n")
    return sorted(set(entries) - set(before))


if __name__ == "__main__":
    print("frozen:", ", ".join(freeze(READINGS, readings)) or "nothing; every revision has its readings")
