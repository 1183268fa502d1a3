"""At its bound a thing is read; with one more it is refused in one line that names the bound."""

from __future__ import annotations

import json
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path

import pyarrow
import pyarrow.parquet
import pytest
import zstandard

from replay import limits
from replay.batch.history import read_history
from replay.errors import ReplayError
from replay.geometry.mesh_file import read_faces
from replay.json_text import read_json, read_json_file
from replay.logs.csv_table import CsvTable, Format
from replay.logs.curve_csv import read_curve
from replay.logs.exported import as_csv
from replay.logs.joint_log import Choice, read_messages
from replay.logs.mcap_reader import McapLog
from replay.logs.message_log import open_bag_folder, open_message_log
from replay.logs.overview import overview
from replay.robots import xml_text
from replay.scenario import yaml_text
from replay.scenario.load import load_cases
from tests.geometry.test_mesh_file import WHOLE, glb
from tests.logs import made_logs
from tests.logs.made_logs import Said

SAID = [Said(10 * k, 10 * k, {"a": 1.0, "b": 2.0}) for k in range(1, 4)]
LOG = made_logs.mcap(SAID)
TIME = Format(None, None, {"s": Fraction(10**9)})
CSV = b"time,a\n1,2\n3,4\n"
CUBE = b"".join(b"v %d %d %d\n" % (k & 1, k >> 1 & 1, k >> 2) for k in range(8)) + b"f 1 3 4 2\nf 5 6 8 7\n"
THREE = b"v 0 0 0\nv 1 0 0\nv 0 1 0\n"
FOLDED = b"v 0 0 0\nv 2 0 0\nv 2 2 0\nv 1 0.5 0\nv 0 2 0\nf 1 2 3 4 5\nf 1 2 3 4 5\n"
TEXT_PLY = b"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
TEXT_PLY += b"element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"
TRIANGLE = b"facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n"
YAML = b"version: 1\nname: a\nrate: 10 Hz\nduration: 1 s\nlinks: {a: {}}\n"
SWEPT = YAML + b"sweep: {grid: {rate: [10 Hz, 20 Hz], duration: [1 s, 2 s]}}\n"
BAG = b"rosbag2_bagfile_information: {relative_file_paths: [a.db3, b.db3]}"
XML = b"<robot><link><visual/></link></robot>"


def nodes(scene) -> None:
    scene["nodes"] = [{"children": [1]}, {"children": [2]}, {"mesh": 0}]
    scene["scenes"] = [{"nodes": [0]}]


def log(data: bytes) -> McapLog:
    return McapLog("a.mcap", data=data)


def table(data: bytes) -> CsvTable:
    return CsvTable("a.csv", data, TIME)


def parquet(folder: Path) -> bytes:
    out = pyarrow.BufferOutputStream()
    pyarrow.parquet.write_table(pyarrow.table({"time [ns]": [1, 2, 3], "a": [1.0, 2.0, 3.0], "t": ["", "", ""]}), out)
    return as_csv("a.parquet", out.getvalue().to_pybytes())


def exported(folder: Path) -> bytes:
    columns = {"time [ns]": [1, 2, 3], "a": [1.0, 2.0, 3.0]}
    return as_csv("a.json", json.dumps({"topics": {"/joint_states": columns}}).encode())


def written(folder: Path, name: str, data: bytes) -> Path:
    (folder / name).write_bytes(data)
    return folder / name


def bag(folder: Path) -> object:
    files = {"a.db3": made_logs.db3(SAID[:2]), "b.db3": made_logs.db3(SAID[2:])}
    files["metadata.yaml"] = BAG
    return open_bag_folder("bag", files.__getitem__)


def included(folder: Path) -> object:
    part = written(folder, "part.yaml", b"links: {a: {}}\n")
    assert part.stat().st_size == 15
    return load_cases(written(folder, "a.yaml", YAML.replace(b"links: {a: {}}\n", b"include: [part.yaml]\n")))


CASES: list[tuple[str, int, Callable[[Path], object]]] = [
    ("JSON_GROUPS", 3, lambda folder: read_json(b'[[], {"a": 1}]')),
    ("RECORD_JSON", 9, lambda folder: read_json_file(written(folder, "a.json", b'{"a": 12}'))),
    ("HISTORY", 3, lambda folder: read_history(written(folder, "history.jsonl", b"{}\n"))),
    ("FILE", len(WHOLE["binary.stl"]), lambda folder: read_faces("a.stl", WHOLE["binary.stl"])),
    ("TEXT_MESH", len(CUBE), lambda folder: read_faces("a.obj", CUBE)),
    ("TRIANGLES", 8, lambda folder: read_faces("a.obj", CUBE)),  # vertices
    (
        "TRIANGLES",
        4,
        lambda folder: read_faces("a.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\n" + b"f 1 2 3\n" * 4),
    ),  # triangles
    ("TRIANGLES", 12, lambda folder: read_faces("a.stl", WHOLE["binary.stl"])),
    ("TRIANGLES", 2, lambda folder: read_faces("a.stl", b"solid\n" + 2 * TRIANGLE + b"endsolid\n")),
    ("TRIANGLES", 3, lambda folder: read_faces("a.ply", TEXT_PLY)),
    ("TRIANGLES", 12, lambda folder: read_faces("a.glb", WHOLE["box.glb"])),
    ("OBJ_LINE", 6, lambda folder: read_faces("a.obj", b"v 0 0\\\n0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")),
    ("POLYGON", 4, lambda folder: read_faces("a.obj", CUBE)),
    ("FOLDED_POLYGONS", 3, lambda folder: read_faces("a.obj", FOLDED)),
    ("GLB_DEPTH", 3, lambda folder: read_faces("a.glb", glb(nodes))),
    ("GLB_ENTRIES", 3, lambda folder: read_faces("a.glb", glb(nodes))),
    ("YAML_BYTES", len(YAML), lambda folder: load_cases(written(folder, "a.yaml", YAML))),
    ("YAML_TOTAL", len(YAML) - 15 + 21 + 15, included),
    ("NUMBER_DIGITS", 5, lambda folder: load_cases(written(folder, "a.yaml", YAML.replace(b"10 Hz", b"10.00")))),
    ("SWEEP_PATHS", 2, lambda folder: load_cases(written(folder, "a.yaml", SWEPT))),
    ("TEXT_LOG", len(CSV), lambda folder: table(CSV)),
    ("TEXT_LOG", 16, lambda folder: read_curve(written(folder, "a.csv", b"x_m,y_F\n1,2\n3,4\n"))),
    ("CELLS", 6, lambda folder: table(CSV)),
    ("COLUMNS", 2, lambda folder: table(CSV)),
    ("CELLS", 6, parquet),
    ("COLUMNS", 2, parquet),
    ("CELLS", 6, exported),
    ("COLUMNS", 2, exported),
    ("CHANNELS", 1, lambda folder: log(LOG)),
    ("DEFINITION_TEXT", len(made_logs.definition("ros2msg")), lambda folder: joints_of(LOG)),
    ("MESSAGE", len(made_logs.cdr(SAID[0])), lambda folder: joints_of(LOG)),
    ("BAG_FILES", 2, bag),
    ("BAG_YAML", len(BAG), bag),
    ("UNPACKED_FILE", len(LOG), lambda folder: open_message_log("a", zstandard.compress(LOG))),
    ("ROBOT_XML", len(XML), lambda folder: xml_text.parse("a.urdf", XML, root="robot")),
    ("ROBOT_DEPTH", 3, lambda folder: xml_text.parse("a.urdf", XML, root="robot")),
    ("TEXT_MESH", len(XML), lambda folder: xml_text.check("a.dae", XML)),
    ("TRIANGLES", 3, lambda folder: xml_text.check("a.dae", XML)),
]


def joints_of(data: bytes) -> object:
    return read_messages("a.mcap", open_message_log("a.mcap", data), Choice())


@pytest.mark.parametrize(("name", "most", "read"), CASES, ids=[f"{name} {k}" for k, (name, _, _) in enumerate(CASES)])
def test_so_much_is_read_and_no_more(tmp_path, monkeypatch, name, most, read) -> None:
    monkeypatch.setattr(limits, name, most)
    yaml_text._kept.cache_clear()
    read(tmp_path)
    yaml_text._kept.cache_clear()
    monkeypatch.setattr(limits, name, most - 1)
    with pytest.raises((ReplayError, ValueError)) as caught:
        read(tmp_path)
    assert "\n" not in str(caught.value)
    assert str(most - 1) in str(caught.value) or str(most) in str(caught.value)


def test_of_a_topic_that_names_more_joints_than_a_machine_has_none_are_told(monkeypatch) -> None:
    for most, told in ((2, ["a", "b"]), (1, [])):
        monkeypatch.setattr(limits, "JOINTS", most)
        with log(LOG) as opened:
            assert [joint.joint for joint in overview(opened).joints] == told
