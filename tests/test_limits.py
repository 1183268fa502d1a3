"""The bounds are those that the README states, and what is beyond each is refused in a line, soon, in little memory."""

from __future__ import annotations

import contextlib
import json
import re
import sqlite3
import struct
import subprocess
import sys
import time
from pathlib import Path

import pyarrow
import pyarrow.parquet
import pytest
import zstandard
from google.protobuf import descriptor_pb2

import replay
from replay import limits
from replay.cli.exit_codes import ExitCode
from replay.cli.main import run
from replay.errors import LimitError, MeshError, RecordingError, ScenarioError
from replay.geometry.mesh_file import read_faces
from replay.logs.mcap_reader import McapLog
from replay.logs.message_log import open_bag_folder, open_message_log
from replay.logs.protobuf import fields_of, message_type
from replay.logs.ros_schema import types_of
from replay.scenario.load import load_cases, load_sources
from tests.fuzz.damage import build, metadata, record, text
from tests.fuzz.doors import RECORDED, SCENARIO
from tests.geometry.test_mesh_file import glb

README = (Path(replay.__file__).parents[1] / "schemas" / "README.md").read_text(encoding="utf-8")
HEAD = (1, text("") + text("x"))
MESSAGE = record(5, struct.pack("<HIQQ", 1, 0, 5, 5))


def channel(number: int, topic: str = "/a", encoding: str = "json", schema: int = 0) -> tuple[int, bytes]:
    return 4, struct.pack("<HH", number, schema) + text(topic) + text(encoding) + struct.pack("<I", 0)


def schema(name: str, encoding: str, data: bytes) -> tuple[int, bytes]:
    return 3, struct.pack("<H", 1) + text(name) + text(encoding) + struct.pack("<I", len(data)) + data


def chunk(data: bytes) -> tuple[int, bytes]:
    packed = zstandard.compress(data, 1)
    head = struct.pack("<QQQI", 0, 0, len(data), 0) + text("zstd")
    return 6, head + struct.pack("<Q", len(packed)) + packed


def test_the_readme_states_the_bounds_as_they_are() -> None:
    table = README.partition("| what | at most | bound |")[2].partition("\n\n")[0]
    stated = {}
    for row in re.findall(r"^\| .* \| (.*) \| (.*) \|$", table, re.MULTILINE):
        names = re.findall(r"`(\w+)`", row[1])
        values = row[0].split("; ") if len(names) > 1 else [row[0]]
        stated |= dict(zip(names, values * len(names) if len(values) == 1 else values, strict=True))
    units = {"": 1, "MiB": limits.MIB, "GiB": limits.GIB}
    for name, shown in stated.items():
        bound = getattr(limits, name)
        number, unit = re.match(r"([0-9 ]+?) ?(MiB|GiB|)(?:,|$)", shown).groups()
        least = bound if isinstance(bound, int) else bound(0)
        assert int(number.replace(" ", "")) * units[unit] == least, name
        if not isinstance(bound, int):
            times, each = re.search(r"(\d+) times the file", shown), re.search(r"one for each (\d+) bytes", shown)
            size = 1 << 40
            assert bound(size) == (size * int(times[1]) if times else size // int(each[1])), name
    assert len(stated) > 15


def refused(path: Path) -> str:
    """Read a log to its end; return why it is refused, and that no part of it is salvaged."""
    for salvage in (False, True):
        with pytest.raises(LimitError) as caught, McapLog(path, salvage=salvage) as log:
            for part in log.chunks:
                list(log.runs(part))
    assert "\n" not in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize(
    ("records", "words"),
    [
        (lambda: [HEAD, channel(1), chunk(MESSAGE * 2_100_000)], "holds more than 2000000 records"),
        (lambda: [HEAD, channel(1), chunk((MESSAGE + record(0x81, b"")) * 1_100_000)], "holds more records than"),
        (
            lambda: [HEAD, channel(1), *[chunk(MESSAGE + record(0x81, bytes(200 << 20)))] * 6],
            "unpacks to more than 1073741824",
        ),
        (lambda: [HEAD, *[(0x81, b"")] * 505_000], "holds more than 500000 records outside chunks"),
        (lambda: [HEAD, *(channel(number) for number in range(1, 10_100))], "has more than 10000 channels"),
        (lambda: [HEAD, *[(12, metadata("x", {"a": "b" * (1 << 20)}))] * 65], "metadata of more than"),
    ],
)
def test_logs_that_ask_for_more_than_their_size_are_refused(tmp_path, records, words) -> None:
    path = tmp_path / "a.mcap"
    path.write_bytes(build(records(), []))
    assert words in refused(path)


def test_statistics_that_promise_much_are_damage(tmp_path) -> None:
    counts = struct.pack("<QHIIIIQQ", 10**12, 0, 0, 0, 0, 0, 0, 0) + struct.pack("<IHQ", 10, 1, 10**12)
    path = tmp_path / "a.mcap"
    path.write_bytes(build([HEAD, channel(1), chunk(MESSAGE * 9)], [(0x0B, counts)]))
    with McapLog(path) as log, pytest.raises(RecordingError, match="claim 1000000000000 messages"):
        log.count_of(1)


def branching(levels: int, *, recursive: bool) -> bytes:
    """A schema of messages of two fields, each of the next type; or of one type within itself."""
    file = descriptor_pb2.FileDescriptorProto(name="a.proto", syntax="proto3")
    for level in range(levels):
        type_ = file.message_type.add(name=f"T{level}")
        for number in (1, 2):
            inner = 0 if recursive else level + 1
            if inner < levels:
                type_.field.add(name=f"f{number}", number=number, label=1, type=11, type_name=f".T{inner}")
    return descriptor_pb2.FileDescriptorSet(file=[file]).SerializeToString()


def test_a_message_type_has_as_many_fields_as_are_read_and_not_one_more(monkeypatch) -> None:
    descriptor = message_type("a", "T0", branching(3, recursive=False)).DESCRIPTOR  # 2 fields, 2 x 2, and none in these
    monkeypatch.setattr(limits, "SCHEMA_FIELDS", 6)
    assert len(list(fields_of("a", descriptor))) == 6
    monkeypatch.setattr(limits, "SCHEMA_FIELDS", 5)
    with pytest.raises(LimitError, match="more than 5 fields"):
        list(fields_of("a", descriptor))


def test_fields_within_fields_are_counted() -> None:
    inside = message_type("a", "T0", branching(1, recursive=True)).DESCRIPTOR
    assert [path for path, _ in fields_of("a", inside)] == ["f1", "f2"]
    with pytest.raises(LimitError, match="more than 10000 fields"):
        list(fields_of("a", message_type("a", "T0", branching(30, recursive=False)).DESCRIPTOR))


def test_a_joint_log_is_not_taken_apart_without_end(tmp_path, capsys) -> None:
    one = record(5, struct.pack("<HIQQ", 1, 0, 5, 5) + b'{"name":["a"],"position":[1]}')
    path = tmp_path / "a.mcap"
    path.write_bytes(build([HEAD, channel(1, "/joint_states"), chunk(one * 210_000)], []))
    assert run(["info", str(path)]) is ExitCode.INVALID
    assert "messages to be taken apart" in capsys.readouterr().err


def test_a_table_of_new_columns_in_each_message_stays_bytes(tmp_path, capsys) -> None:
    many = b"".join(record(5, struct.pack("<HIQQ", 1, 0, 5, 5) + b'{"k%d":1}' % k) for k in range(20_000))
    path = tmp_path / "a.mcap"
    path.write_bytes(build([HEAD, channel(1), chunk(many)], []))
    assert run(["export", str(path), "--format", "csv", "-o", str(tmp_path)]) is ExitCode.FINE
    assert "more than 10000 columns" in capsys.readouterr().err


@pytest.mark.parametrize(
    "definition",
    [
        "\n" * 100_000,
        "module a {\n" + " \n" * 50_000,
        "# \n" * 40_000,
        f"module a {{ module msg {{ struct B {{ {'sequence<' * 60}long{'>' * 60} a; }}; }}; }};",
    ],
)
def test_definitions_are_read_soon(definition) -> None:
    begin = time.monotonic()
    with contextlib.suppress(ValueError):
        types_of("sensor_msgs/msg/JointState", definition)
    assert time.monotonic() - begin < 30.0


def database(*statements: str) -> bytes:
    with contextlib.closing(sqlite3.connect(":memory:")) as base:
        for statement in statements:
            base.execute(statement)
        base.commit()
        return base.serialize()


TOPICS = "CREATE TABLE topics (id INTEGER, name TEXT, type TEXT, serialization_format TEXT)"
MESSAGES = "CREATE TABLE messages (id INTEGER, topic_id INTEGER, timestamp INTEGER, data BLOB)"
ENDLESS = "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n) SELECT i id, 'a' name, 'b' type, 'c'"


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (database(f"CREATE VIEW topics AS {ENDLESS} serialization_format FROM n", MESSAGES), "more than tables"),
        (database(TOPICS.replace("name TEXT", "name AS (zeroblob(1000000000))"), MESSAGES), "is computed"),
        (database(TOPICS, MESSAGES, "INSERT INTO topics VALUES (1, NULL, 'a/b', 'cdr')"), "of other types"),
        (database(TOPICS, MESSAGES, "INSERT INTO topics VALUES ('x', 'a', 'a/b', 'cdr')"), "of other types"),
    ],
)
def test_a_bag_is_tables_of_the_types_that_bags_have(data, words) -> None:
    with pytest.raises(RecordingError, match=words):
        open_message_log("a.db3", data)


def test_a_bag_folder_does_not_unfold() -> None:
    levels = "".join(f"b{k}: &b{k} [{', '.join([f'*b{k - 1}' if k else 'x'] * 9)}]\n" for k in range(12))
    bomb = f"{levels}rosbag2_bagfile_information: {{relative_file_paths: [*b11]}}\n".encode()
    with pytest.raises(RecordingError, match="is not that of a ROS 2 bag"):
        open_bag_folder("drive", lambda name: bomb)


def motion(name: str, data: bytes) -> str:
    with pytest.raises(ScenarioError) as caught:
        load_sources("a.yaml", {"a.yaml": RECORDED.replace(b"FILE", name.encode()), name: data})
    assert len(str(caught.value)) < 1000
    return str(caught.value)


def test_tables_are_bounded_by_their_cells() -> None:
    wide = ",".join(["time", *(f"j{k}" for k in range(20_000))]).encode()
    assert "20001 columns" in motion("a.csv", wide + b"\n0\n")
    assert "at most 10000000 cells" in motion("a.csv", wide[:50_000].rpartition(b",")[0] + b"\n" * 2_000)
    assert "field larger than field limit" in motion("a.csv", b"time," + b"x" * 200_000 + b"\n0,1\n")
    unnamed = b"time,swing" + b"," * 30_000 + b"\n" + b"0,1\n0.1,1\n0.3,1\n" * 1_000  # each row would be filled up
    assert "swing" not in motion("b.csv", b"time" + unnamed[10:])
    sink = pyarrow.BufferOutputStream()
    zeros = pyarrow.array([0] * 6_000_000)
    pyarrow.parquet.write_table(pyarrow.table({"time [ns]": zeros, "swing": zeros}), sink)
    assert "6000000 rows of 2 numbers" in motion("a.parquet", sink.getvalue().to_pybytes())


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"a: 1\n" + b"#" * (1 << 20), "at most 1048576 are read"),
        (b"a: !" + b"x" * 100_000 + b" 1", "a tag of more than 1000 characters"),
        (b"- &a [1, 1, 1]\n" + b"- *a\n" * 30_000, "more than 100000 values"),
        (b"a: 1\n" * 1_100, "more is wrong than the 1000 that are told"),
    ],
)
def test_yaml_is_bounded(tmp_path, data, words) -> None:
    path = tmp_path / "a.yaml"
    path.write_bytes(data)
    with pytest.raises(ScenarioError) as caught:
        load_cases(path)
    assert words in str(caught.value) and max(map(len, str(caught.value).splitlines())) < 1000


def test_a_sweep_of_very_many_paths_is_refused_soon(tmp_path) -> None:
    cases = "".join(f"    - {{links.l{k}.shapes.s{k}.radius: 1}}\n" for k in range(5_000))
    path = tmp_path / "a.yaml"
    path.write_bytes(SCENARIO + f"sweep:\n  list:\n{cases}".encode())
    with pytest.raises(ScenarioError, match="names 5000 different paths"):
        load_cases(path)


def instances(scene) -> None:
    scene["nodes"] = [{"mesh": 0}] * 10_000
    scene["meshes"][0]["primitives"] *= 100
    scene["scenes"] = [{"nodes": list(range(10_000))}]


def chain(scene) -> None:
    scene["nodes"] = [{"children": [k + 1]} for k in range(5_000)] + [{"mesh": 0}]
    scene["scenes"] = [{"nodes": [0]}]


def entries(scene) -> None:
    scene["nodes"] = [{}] * 30_000


def deep(scene) -> None:
    scene["extras"] = json.loads("[" * 900 + "]" * 900)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (instances, "12000000 triangles; at most 4000000"),
        (chain, "more than 100 deep"),
        (entries, "30000 nodes; at most 20000"),
    ],
)
def test_glb_scenes_are_bounded(change, words) -> None:
    with pytest.raises(MeshError, match=words):
        read_faces("a.glb", glb(change))


PLY = (
    "ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
    "element face {}\nproperty list {} int vertex_indices\nend_header\n"
)


@pytest.mark.parametrize(
    ("name", "data", "words"),
    [
        (
            "a.ply",
            lambda: PLY.format(1, "uint").encode() + bytes(36) + struct.pack("<I3i", 2**32 - 1, 0, 1, 2),
            "announces",
        ),
        (
            "a.ply",
            lambda: PLY.format(1, "int").encode() + bytes(36) + struct.pack("<i3i", 2**31 - 1, 0, 1, 2),
            "ends before",
        ),
        ("a.ply", lambda: PLY.format(10**17, "uchar").encode() + bytes(36), "announces"),
        (
            "a.ply",
            lambda: b"ply\nformat ascii 1.0\nelement x 5000000\nend_header\n" + b"1\n" * 5_000_000,
            "at most 4000000",
        ),
        ("a.obj", lambda: b"v 0 0 0\n" * 3 + b"f " + b"1 2 3 " * 5_000 + b"\n", "polygon of 15000 corners"),
        ("a.obj", lambda: b"v 0 0 0\\\n" * 140_000, "characters"),
        ("a.stl", lambda: b"solid\n" + b"facet\n" * 8_100_000, "at most 4000000 are read"),
    ],
)
def test_meshes_are_bounded(name, data, words) -> None:
    with pytest.raises(MeshError, match=words):
        read_faces(name, data())


def test_a_refusal_stays_within_two_gib(tmp_path) -> None:
    """A chunk of 200 MiB, five times: as much as is read, by the command itself."""
    path = tmp_path / "a.mcap"
    path.write_bytes(
        build([HEAD, channel(1), *[chunk(record(5, struct.pack("<HIQQ", 1, 0, 5, 5) + bytes(200 << 20)))] * 5], [])
    )
    code = (
        "import resource, sys; from replay.cli.main import run; code = run(['info', sys.argv[1]]); "
        "print(int(code), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss >> 10)"
    )
    done = subprocess.run([sys.executable, "-c", code, str(path)], capture_output=True, text=True, check=True)
    exit_code, peak = map(int, done.stdout.split()[-2:])
    assert exit_code in (0, 2) and peak < 2048
