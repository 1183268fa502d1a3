"""How much is read of what files hold and claim: every bound in one place, so that none hangs or fills a machine.

A bound is on work and not only on bytes: a file of a few kilobytes can stand for terabytes, for 10^12 messages or for
fields within fields without end. What is beyond a bound is refused in one line that names it (exit code 2), within
seconds and 2 GiB of memory. What grows in step with the file itself is allowed: a bound that follows the file's size
says so. `README.md` shows the main ones, and a test keeps the two the same.
"""

from __future__ import annotations

from typing import Final

MIB: Final = 1 << 20
GIB: Final = 1 << 30

# Files

FILE: Final = GIB
"""Bytes of a file that a scenario names: a mesh, a log, a part of a bag."""
UNPACKED_FILE: Final = 512 * MIB
"""Bytes that a packed part of a bag, or a message in it, unpacks to."""

# YAML: scenarios, models, rules, metadata.yaml of bags

YAML_BYTES: Final = MIB
"""Bytes of one YAML file; people write some kilobytes."""
YAML_TOTAL: Final = 2 * MIB
"""Bytes of a scenario's YAML files together."""
YAML_NODES: Final = 100_000
"""Keys and values of one YAML file, with every alias written out."""
BAG_YAML: Final = 64 << 10
"""Bytes of the metadata.yaml of a bag's folder."""
BAG_FILES: Final = 1_000
"""Files of a bag's folder."""
YAML_DEPTH: Final = 40
"""Collections within collections; the language itself needs 8."""
YAML_TAG: Final = 1_000
"""Characters of one tag of YAML."""
NUMBER_DIGITS: Final = 400
"""Characters of one number in YAML."""
SWEEP_CASES: Final = 10_000
"""Cases of a sweep."""
SWEEP_PATHS: Final = 1_000
"""Different paths of a sweep."""
SWEEP_VALUES: Final = 20_000_000
"""Values of all cases of a sweep together: cases times values of the scenario."""
PROBLEMS: Final = 1_000
"""Problems of one file that are told one by one."""

# JSON: metadata, run.json, result.json, lines of history.jsonl, descriptions of GLB scenes, exported tables

JSON_BYTES: Final = 128 * MIB
"""Bytes of one JSON text."""
JSON_GROUPS: Final = 1_000_000
"""Lists and objects of one JSON text."""
RECORD_JSON: Final = 16 * MIB
"""Bytes of run.json, of result.json, and of the metadata of a recording."""
HISTORY: Final = 256 * MIB
"""Bytes of a history of nights."""
LOG_SHOWN: Final = 64 << 10
"""Bytes at the end of a scenario's log that reports show lines of."""

# Descriptions of robots: URDF, SRDF, COLLADA

ROBOT_XML: Final = 32 * MIB
"""Bytes of a description."""
ROBOT_ELEMENTS: Final = 200_000
"""Elements of a description; a humanoid with hands has 5 000."""
ROBOT_DEPTH: Final = 100
"""Elements within elements of a description or a COLLADA file, and joints of which each follows the next."""
ROBOT_FOLDERS: Final = 20_000
"""Folders that are looked into for the packages of a description."""
ROBOT_PAIRS: Final = 20_000
"""Pairs of links of a description that are rigid to each other, which a part disables one by one."""
ROBOT_SAMPLES: Final = 100_000
"""Random poses that an import checks for collisions."""

# Logs: MCAP and bags

RECORD: Final = GIB
"""Bytes of one record of an MCAP file."""
CHUNK: Final = 256 * MIB
"""Bytes that one chunk unpacks to."""
SUMMARY: Final = 256 * MIB
"""Bytes of the summary of an MCAP file."""
DEFINITIONS: Final = 64 * MIB
"""Bytes of all different schemas and channels of a log, and of all its metadata."""
CHANNELS: Final = 10_000
"""Channels of a log."""
SCHEMA_FIELDS: Final = 10_000
"""Fields of a message type, with those of the messages in it."""
DEFINITION_TEXT: Final = 128 << 10
"""Bytes of a ROS message definition."""
DEFINITION_STEPS: Final = 300_000
"""Steps of parsing an IDL definition, whose number may double with each type within a type."""
MESSAGE: Final = 16 * MIB
"""Bytes of a message that is taken apart into values; a larger one is exported as bytes."""
MESSAGE_VALUES: Final = 1_000_000
"""Values of one message that is taken apart."""
JOINTS: Final = 10_000
"""Joints, or pairs of frames, of a log."""
NAMES: Final = 200_000
"""Names of links, joints, pairs and sensors in a recording's metadata."""
CELLS: Final = 10_000_000
"""Cells of a table: of a CSV, JSON or Parquet log, or of an exported topic."""
TEXT_LOG: Final = 256 * MIB
"""Bytes of a log in CSV, or of a measured curve."""
LONG_LOG: Final = 512 * MIB
"""Bytes of a log in CSV that measures readings and is a plain table of numbers."""
LONG_CELLS: Final = 40_000_000
"""Cells of such a log in the columns that are needed, and eight for each time, which is exact."""
COLUMNS: Final = 10_000
"""Columns of a table."""

# Meshes

TRIANGLES: Final = 4_000_000
"""Triangles of a mesh file, a GLB's instances counted each; and as many corners."""
TEXT_MESH: Final = 256 * MIB
"""Bytes of a mesh file that is text."""
OBJ_LINE: Final = MIB
"""Characters of a line of an OBJ file with those that it goes on in."""
POLYGON: Final = 10_000
"""Corners of one polygon."""
FOLDED_POLYGONS: Final = 50_000
"""Polygons of a mesh file that are not convex or are there twice: these are split one by one."""
GLB_JSON: Final = 16 * MIB
"""Bytes of the description of a GLB scene."""
GLB_ENTRIES: Final = 20_000
"""Nodes, meshes, accessors and views of a GLB scene, each."""
GLB_DEPTH: Final = 100
"""Nodes within nodes of a GLB scene."""


def unpacked(size: int) -> int:
    """Return how many bytes the chunks of a log of `size` bytes may unpack to: 1 GiB, or 64 times the file."""
    return max(GIB, 64 * size)


def scene(size: int) -> int:
    """Return how many bytes the scene of a recording of `size` bytes may have: 64 MiB, or 8 times the file."""
    return max(64 * MIB, 8 * size)


def irregular(size: int) -> int:
    """Return how many bytes of a topic of a recording of `size` bytes are taken apart one by one, where messages have
    no common layout: 32 MiB, or 4 times the file."""
    return max(32 * MIB, 4 * size)


def columns(size: int) -> int:
    """Return how many bytes the columns of a recording of `size` bytes may take: 512 MiB, or 32 times the file."""
    return max(512 * MIB, 32 * size)


def visits(size: int) -> int:
    """Return how many fields are taken out of the chunks of a recording of `size` bytes, one at a time: 10 million, or
    one for each byte of the file."""
    return max(10_000_000, size)


def records(size: int) -> int:
    """Return how many records a log of `size` bytes may have in its chunks: 2 million, or one for each 16 bytes."""
    return max(2_000_000, size // 16)


def loose_records(size: int) -> int:
    """Return how many records a log of `size` bytes may have outside chunks: 500 000, or one for each 32 bytes."""
    return max(500_000, size // 32)


def decoded(size: int) -> int:
    """Return how many messages of a log of `size` bytes are taken apart: 200 000, or one for each 8 bytes."""
    return max(200_000, size // 8)


def reads(size: int) -> int:
    """Return how many bytes of a bag of `size` bytes are read, those that are read again too: 64 MiB, or 4 times it."""
    return max(64 * MIB, 4 * size)


def database_steps(size: int) -> int:
    """Return how many steps SQLite may take with a bag of `size` bytes: 100 million, or 10 a byte."""
    return max(100_000_000, 10 * size)


def passes(size: int) -> int:
    """Return how many bytes an export may unpack, a chunk counted for each of its topics: 16 GiB, or 1024 files."""
    return max(16 * GIB, 1024 * size)
