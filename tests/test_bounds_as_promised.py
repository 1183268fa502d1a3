"""Every bound once more, as files that are read today rely on it: one that gets smaller refuses what worked."""

from __future__ import annotations

import inspect

import pytest

from replay import limits
from replay.limits import GIB, MIB

FILES = {"FILE": GIB, "UNPACKED_FILE": 512 * MIB, "TEXT_LOG": 256 * MIB, "TEXT_MESH": 256 * MIB}
YAML = {"YAML_BYTES": 2**20, "YAML_TOTAL": 2**21, "YAML_NODES": 10**5, "BAG_YAML": 65_536, "BAG_FILES": 1000}
YAML |= {"YAML_DEPTH": 40, "YAML_TAG": 1000, "NUMBER_DIGITS": 400, "PROBLEMS": 1000}
SWEEPS = {"SWEEP_CASES": 10_000, "SWEEP_PATHS": 1000, "SWEEP_VALUES": 2 * 10**7}
JSON = {"JSON_BYTES": 2**27, "JSON_GROUPS": 10**6, "RECORD_JSON": 2**24, "HISTORY": 2**28, "LOG_SHOWN": 2**16}
ROBOTS = {"ROBOT_XML": 2**25, "ROBOT_ELEMENTS": 2 * 10**5, "ROBOT_DEPTH": 100, "ROBOT_FOLDERS": 20_000}
ROBOTS |= {"ROBOT_PAIRS": 20_000, "ROBOT_SAMPLES": 10**5}
LOGS = {"RECORD": 2**30, "CHUNK": 2**28, "SUMMARY": 2**28, "DEFINITIONS": 2**26, "CHANNELS": 10_000}
LOGS |= {"SCHEMA_FIELDS": 10_000, "DEFINITION_TEXT": 2**17, "DEFINITION_STEPS": 300_000, "MESSAGE": 2**24}
LOGS |= {"MESSAGE_VALUES": 10**6, "JOINTS": 10_000, "NAMES": 200_000, "CELLS": 10**7, "COLUMNS": 10_000}
LOGS |= {"LONG_LOG": 512 * MIB, "LONG_CELLS": 4 * 10**7}
MESHES = {"TRIANGLES": 4 * 10**6, "OBJ_LINE": 2**20, "POLYGON": 10_000, "FOLDED_POLYGONS": 50_000}
MESHES |= {"GLB_JSON": 2**24, "GLB_ENTRIES": 20_000, "GLB_DEPTH": 100}
BOUNDS = {**FILES, **YAML, **SWEEPS, **JSON, **ROBOTS, **LOGS, **MESHES}

GROWING = {  # at least so much, and so much for each byte of the file
    "unpacked": (2**30, 64),
    "scene": (2**26, 8),
    "irregular": (2**25, 4),
    "columns": (2**29, 32),
    "visits": (10**7, 1),
    "records": (2 * 10**6, 1 / 16),
    "loose_records": (500_000, 1 / 32),
    "decoded": (200_000, 1 / 8),
    "reads": (2**26, 4),
    "database_steps": (10**8, 10),
    "passes": (2**34, 1024),
}


def test_every_bound_is_what_it_was() -> None:
    stated = {name: value for name, value in vars(limits).items() if name.isupper() and name not in ("MIB", "GIB")}
    assert stated == BOUNDS
    assert (MIB, GIB) == (1_048_576, 1_073_741_824)


@pytest.mark.parametrize("name", GROWING)
def test_bounds_that_follow_a_file_s_size_begin_where_they_did_and_grow_as_they_did(name: str) -> None:
    bound, (least, each) = getattr(limits, name), GROWING[name]
    turn = int(least / each)
    assert bound(0) == bound(turn - 1) == bound(turn) == least
    for size in (2 * turn, 2**40):
        assert bound(size) == int(size * each)


def test_no_bound_is_left_out() -> None:
    functions = {name for name, value in vars(limits).items() if inspect.isfunction(value)}
    assert functions == set(GROWING)
