"""The generated JSON Schemas: up to date, and of one mind with the models."""

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import jsonschema
import pytest

import replay
from replay.scenario.schema import FILES, schema_text
from replay.scenario.yaml_text import parse

ROOT = Path(replay.__file__).parents[1]
DATA = Path(__file__).parent / "data"
SHIPPED = sorted((ROOT / "scenarios").rglob("*.yaml"))
HEAD = {"version": 1, "name": "a", "rate": 60, "duration": "5 s"}


def text_of(path):
    return parse(path.read_bytes(), path.name, []).data()


def validator(name):
    schema = json.loads((ROOT / "schemas" / name).read_text(encoding="utf-8"))
    jsonschema.Draft202012Validator.check_schema(schema)
    return jsonschema.Draft202012Validator(schema)


@pytest.mark.parametrize("name", FILES)
def test_the_files_are_up_to_date(name):
    written = (ROOT / "schemas" / name).read_text(encoding="utf-8")
    assert written == schema_text(FILES[name]), "run `make schemas`"


def test_make_schemas_writes_what_stands_here(tmp_path):
    shutil.copytree(ROOT / "replay", tmp_path / "replay", ignore=shutil.ignore_patterns("__pycache__"))
    (tmp_path / "schemas").mkdir()
    kept = (ROOT / "schemas" / "README.md").read_text(encoding="utf-8")
    (tmp_path / "schemas" / "README.md").write_text(kept.partition("## Reference")[0], encoding="utf-8")
    target = (ROOT / "Makefile").read_text(encoding="utf-8").partition("\nschemas:")[2].partition("\n\n")[0]
    for module in re.findall(r"-m (replay\S+)", target):
        subprocess.run([sys.executable, "-m", module], cwd=tmp_path, env={**os.environ, "PYTHONPATH": ""}, check=True)
    written = sorted(path.name for path in (tmp_path / "schemas").iterdir())
    assert written == sorted(["README.md", *(path.name for path in (ROOT / "schemas").glob("*.schema.json"))])
    for name in written:
        assert (tmp_path / "schemas" / name).read_bytes() == (ROOT / "schemas" / name).read_bytes(), name


def test_a_models_file_is_what_the_command_line_reads():
    schema = validator("model.schema.json")
    assert schema.is_valid({"distance": {"method": "rays", "count": 61}, "capacitive": {"rtol": 1e-4}})
    assert not schema.is_valid({"model": {"distance": {"method": "rays"}}})
    assert not schema.is_valid({"collision": {"bounds": "box"}})


@pytest.mark.parametrize("path", [DATA / "full.yaml", DATA / "parts" / "sensors.yaml", *SHIPPED], ids=lambda p: p.name)
def test_scenarios_are_valid_and_name_their_schema(path):
    first = path.read_text(encoding="utf-8").split("\n", 1)[0]
    assert first.startswith("# yaml-language-server: $schema=")
    schema = (path.parent / first.partition("=")[2]).resolve()
    assert schema.parent == ROOT / "schemas"
    if schema.name in FILES:
        validator(schema.name).validate(text_of(path))


@pytest.mark.parametrize(
    "wrong",
    [
        {"link": {}},
        {"version": 2},
        {"rate": "60 m"},
        {"rate": 0},
        {"name": "a/b"},
        {"links": {"a/b": {}}},
        {"links": {"a": {"shapes": {"s": {"type": "cubee", "size": 1}}}}},
        {"links": {"a": {"shapes": {"s": {"type": "cube", "size": "30 deg"}}}}},
        {"links": {"a": {"shapes": {"s": {"type": "cuboid", "size": [1, 2]}}}}},
        {"links": {"a": {"joint": {"type": "revolute", "lower": "1 m"}}}},
        {"links": {"a": {"joint": {"type": "free", "axis": [1, 0, 0]}}}},
        {"sensors": {"distance": {"d": {"link": "a", "aperture": 7}}}},
        {"sensors": {"capacitive": {"d": {"link": "a", "plates": {}, "coupling": "1 pF"}}}},
        {"motion": {"moves": [{"to": {}}]}},
        {"model": "thesis2016"},
        {"model": {"distance": {"method": "ray"}}},
        {"expect": [{"contact": "never"}]},
        {"expect": [{"pair": ["a", "b"], "contact": {"between": [1]}}]},
    ],
    ids=str,
)
def test_editors_see_what_is_wrong(wrong):
    assert validator("scenario.schema.json").is_valid(HEAD)
    assert not validator("scenario.schema.json").is_valid(HEAD | wrong)


def test_every_key_is_described():
    schema = json.loads((ROOT / "schemas" / "scenario.schema.json").read_text(encoding="utf-8"))
    for name, part in [("scenario", schema), *schema["$defs"].items()]:
        for key, value in part.get("properties", {}).items():
            assert key == "type" or value.get("description"), f"{name}.{key}"
