"""Exported tables read back: the same numbers, whatever they are."""

from __future__ import annotations

import csv
import dataclasses
import json
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pyarrow.parquet
import pytest
from mcap.writer import Writer

from replay.errors import InvalidValue, RecordingExistsError
from replay.logs.mcap_reader import McapLog
from replay.recording.export import export, tables
from replay.recording.reader import Recording, read
from tests.recording.test_round_trip import write

FRAMES = 300


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    return read(write(tmp_path_factory.mktemp("export") / "made_up.mcap", FRAMES))


def same(got: list[float], expected: np.ndarray) -> bool:
    """Equal bit by bit, except that one NaN is as good as another."""
    values = np.array(got, dtype=np.float64)
    both = np.isnan(values) & np.isnan(expected)
    return bool(((values.view(np.int64) == np.ascontiguousarray(expected).view(np.int64)) | both).all())


def test_every_topic_is_a_table_with_units(recording: Recording) -> None:
    found = tables(recording)
    assert sorted(found) == sorted(
        ["/joint_states", "/tf", "/collision", "/distance/left", "/distance/right ä", "/capacitive/guard", "/events"]
    )
    assert list(found["/joint_states"]) == [
        "time [ns]",
        "lift position [m]",
        "lift velocity [m/s]",
        "rotation position [rad]",
        "rotation velocity [rad/s]",
    ]
    for topic, table in found.items():
        lengths = {len(column) for column in table.values()}
        assert lengths == {len(recording.events) if topic == "/events" else FRAMES}


def test_what_is_detected_is_named_and_nothing_is_an_empty_text(recording: Recording) -> None:
    table, columns = tables(recording)["/distance/left"], recording.distance
    names = dict(enumerate(recording.layout.shapes)) | {-1: ""}
    assert set(columns.shape[:, 0].tolist()) == set(names)
    assert table["shape"].tolist() == [names[k] for k in columns.shape[:, 0].tolist()]
    words = ("nothing", "detected", "too_close")
    assert table["status"].tolist() == [words[k] for k in columns.status[:, 0].tolist()]
    levels = tables(recording)["/collision"]["arm/beam|patient/body level"]
    assert levels.tolist() == [("clear", "bounds", "contact")[k] for k in recording.collision.level[:, 0].tolist()]


def test_csv_reads_back(recording: Recording, tmp_path: Path) -> None:
    paths = export(recording, tmp_path, format="csv")
    assert len(paths) == 7 and len({path.name for path in paths}) == 7
    expected = tables(recording)["/capacitive/guard"]
    with (tmp_path / "made_up.capacitive_guard.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert list(rows[0]) == list(expected)
    for name, column in expected.items():
        if column.dtype == np.float64:
            assert same([float(row[name]) for row in rows], column)
    assert {row["saturated"] for row in rows} == {"true", "false"}


def test_parquet_reads_back_with_provenance(recording: Recording, tmp_path: Path) -> None:
    export(recording, tmp_path, format="parquet", topics=["/distance/*"])
    assert len(list(tmp_path.iterdir())) == 2
    table = pyarrow.parquet.read_table(tmp_path / "made_up.distance_left.parquet")
    expected = tables(recording)["/distance/left"]
    assert same(table["distance [m]"].to_pylist(), expected["distance [m]"])
    assert table["status"].to_pylist() == expected["status"].tolist()
    assert json.loads(table.schema.metadata[b"replay"])["scenario"] == '"made_up"'


def test_json_reads_back_and_is_strict(recording: Recording, tmp_path: Path) -> None:
    (path,) = export(recording, tmp_path, format="json")

    def refuse(word: str) -> None:
        raise AssertionError(f"{word} is not JSON")

    document = json.loads(path.read_text(encoding="utf-8"), parse_constant=refuse)
    assert document["provenance"]["scenario"] == "made_up"
    expected = tables(recording)
    assert set(document["topics"]) == set(expected)
    for name, column in expected["/collision"].items():
        got = document["topics"]["/collision"][name]
        if column.dtype == np.float64:
            assert same([float(value) for value in got], column)
            assert {value for value in got if isinstance(value, str)} <= {"NaN", "Infinity", "-Infinity"}


def test_what_cannot_be_exported_is_said(recording: Recording, tmp_path: Path) -> None:
    with pytest.raises(InvalidValue, match="/distance/right"):
        export(recording, tmp_path, format="csv", topics=["/lidar"])
    with pytest.raises(InvalidValue, match="csv, json, parquet"):
        export(recording, tmp_path, format="xls")  # type: ignore[arg-type]
    export(recording, tmp_path, format="json")
    with pytest.raises(RecordingExistsError):
        export(recording, tmp_path, format="json")
    export(recording, tmp_path, format="json", overwrite=True)


def test_a_topic_has_its_own_file_whichever_others_are_wanted(recording: Recording, tmp_path: Path) -> None:
    layout = dataclasses.replace(recording.layout, sensors={**recording.layout.sensors, "distance": ("Tip.1", "tip_1")})
    provenance = dataclasses.replace(recording.provenance, layout=layout)
    alike = dataclasses.replace(recording, provenance=provenance)
    paths = export(alike, tmp_path, format="csv", topics=["/distance/*"])
    assert [path.name for path in paths] == ["made_up.distance_Tip_1.csv", "made_up.distance_tip_1_2.csv"]
    (alone,) = export(alike, tmp_path, format="csv", topics=["/distance/tip_1"], overwrite=True)
    assert alone == paths[1]


def log_of(path: Path, topics: Iterable[str]) -> Path:
    """A log of others with a message a topic."""
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema("x", "jsonschema", b'{"type": "object"}')
        for k, topic in enumerate(topics):
            writer.add_message(writer.register_channel(topic, "json", schema), k, b'{"a": 1}', k)
        writer.finish()
    return path


def test_any_topic_has_a_file_that_stays_in_the_folder(tmp_path: Path) -> None:
    topics = ["../../evil", "/etc/passwd", "a" * 400, "a" * 401, "", "..", "/a/b", "/A/B", "/a_b_2", "\0", "\x1b[31m"]
    with McapLog(log_of(tmp_path / "log.mcap", topics)) as log:
        files = export(log, tmp_path / "out", format="csv")
    assert len({file.name.casefold() for file in files}) == len(topics)
    assert sorted(tmp_path.rglob("*.csv")) == sorted(files)


def test_very_many_topics_whose_files_would_have_one_name_are_named_soon(tmp_path: Path) -> None:
    topics = ["!" * (k % 100) + "?" * (k // 100) for k in range(9_000)]
    with McapLog(log_of(tmp_path / "log.mcap", topics)) as log:
        (file,) = export(log, tmp_path / "out", format="csv", topics=["!"])
    assert file.name == "log._2.csv"
