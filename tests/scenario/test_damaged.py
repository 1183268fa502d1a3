"""Scenarios damaged at random: refused with places or read, never a crash; and what is read, editors accept."""

import copy
import json
import math
import random
from pathlib import Path

import jsonschema
import pytest

import replay
from replay.errors import ScenarioError
from replay.scenario.load import load, load_sources
from replay.scenario.yaml_text import parse

FULL = Path(__file__).parent / "data" / "full.yaml"
SCHEMA = Path(replay.__file__).parents[1] / "schemas" / "scenario.schema.json"
WHOLE = parse(FULL.read_bytes(), "full.yaml", []).data()
STRAY = [
    *[None, True, 0, -1, 5, 1e300, 1e-300, 10**400, math.inf, math.nan, {}, [], {"a": 1}, [1, 2, 3], [0, 0, 0]],
    *["", "x", "30 deg", "5 cm", "1 s", "1/3 Hz", "never", "arc", "*", "[", "all", "fixed", "free", "revolute", "mesh"],
    *["thesis2015", "package://os/x", "a/b", "stand", {"type": "free"}, {"type": "prismatic"}, ["stand", "doctor"]],
]


def paths(value, path=()):
    yield path
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, below in items:
        yield from paths(below, (*path, key))


PATHS = [path for path in paths(WHOLE) if path]


def at(value, path):
    for key in path:
        value = value[key]
    return value


def flow(value):
    """Return a value as YAML in flow style, which is JSON but for infinity and NaN."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{json.dumps(key)}: {flow(below)}" for key, below in value.items()) + "}"
    if isinstance(value, list):
        return f"[{', '.join(map(flow, value))}]"
    if isinstance(value, float) and not math.isfinite(value):
        return {math.inf: ".inf", -math.inf: "-.inf"}.get(value, ".nan")
    return json.dumps(value)


def damaged(rng):
    """Return the whole scenario with one or two entries removed, replaced by strays, or by other entries."""
    scenario = copy.deepcopy(WHOLE)
    for _ in range(rng.randint(1, 2)):
        path = rng.choice(PATHS)
        try:
            owner = at(scenario, path[:-1])
            match rng.randrange(4):
                case 0:
                    del owner[path[-1]]
                case 1:
                    owner[path[-1]] = copy.deepcopy(at(WHOLE, rng.choice(PATHS)))
                case _:
                    owner[path[-1]] = rng.choice(STRAY)
        except (KeyError, IndexError, TypeError):
            continue  # the first damage took the place away
    return scenario


def check(seed, count):
    rng = random.Random(seed)
    sources = load(FULL).sources
    validator = jsonschema.Draft202012Validator(json.loads(SCHEMA.read_text(encoding="utf-8")))
    read = 0
    for _ in range(count):
        scenario = damaged(rng)
        try:
            load_sources("full.yaml", {**sources, "full.yaml": flow(scenario).encode()})
        except ScenarioError as error:
            assert error.problems and all(problem.file for problem in error.problems)
            continue
        read += 1
        assert validator.is_valid(scenario), flow(scenario)
    return read / count


def test_a_sample_of_damage():
    assert 0.02 < check(seed=1, count=80) < 0.5


@pytest.mark.soak
def test_much_damage():
    assert 0.02 < check(seed=2, count=20_000) < 0.5
