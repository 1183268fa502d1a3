"""Recordings as the readers of other viewers see them: `@mcap/core`, which Foxglove is made with, and its layout."""

import json
import math
import shutil
import subprocess
from pathlib import Path

import pytest

import replay
from replay.recording import messages
from replay.sensing.kinds import KINDS
from tests.batch import scenes

ROOT = Path(replay.__file__).parents[1]
SCRIPT = Path(__file__).parent / "read_by_mcap_core.mjs"
PACKAGES = ("@mcap/core", "@mcap/nodejs", "@mcap/support", "protobufjs")
LAYOUT = ROOT / "schemas" / "foxglove_layout.json"
OF_ALL = {"collision": messages.COLLISION, "guards": messages.GUARDS}
"""Topics of all pairs and of all guards, and their types."""


@pytest.mark.soak
def test_mcap_core_reads_and_decodes_every_message(tmp_path):
    assert shutil.which("npm"), "this test needs npm"
    made = replay.record(scenes.with_meshes(), tmp_path / "run").mcap
    (tmp_path / "package.json").write_text('{"type": "module", "private": true}')
    subprocess.run(["npm", "install", "--no-audit", "--no-fund", *PACKAGES], cwd=tmp_path, check=True, timeout=300)
    shutil.copy(SCRIPT, tmp_path)
    done = subprocess.run(
        ["node", SCRIPT.name, str(made)], cwd=tmp_path, check=True, timeout=60, capture_output=True, text=True
    )
    found, ours = json.loads(done.stdout), replay.read(made)
    frames = len(ours.time)
    events = found["counts"].pop("/events")
    assert events == len(ours.events)
    assert found["counts"].pop("/scene") == found["counts"].pop("/layout") == 1
    assert set(found["counts"].values()) == {frames}
    examples = found["examples"]
    assert examples["/layout"]["pairs"] == list(ours.layout.pairs)
    assert examples["/layout"]["sensors"] == list(ours.layout.topics())
    read = [math.nan if value is None else value for value in examples["/collision"]["clearance"]]  # as JSON has it
    assert read == pytest.approx(ours.collision.clearance[0].tolist(), nan_ok=True)
    transform = examples["/tf"]["transforms"][1]
    link = ours.layout.links.index(transform["child_frame_id"])
    rotation = [transform["rotation"][letter] for letter in "xyzw"]
    assert rotation == ours.link_quaternions[0, link].tolist()
    assert math.hypot(*rotation) == pytest.approx(1.0)
    assert [transform["translation"][letter] for letter in "xyz"] == ours.link_poses[0, link, :3, 3].tolist()


def plots():
    layout = json.loads(LAYOUT.read_text())
    panels = layout["configById"]
    return [path["value"] for name, config in panels.items() if name.startswith("Plot!") for path in config["paths"]]


def test_the_layout_for_foxglove_shows_fields_that_there_are():
    layout = json.loads(LAYOUT.read_text())
    kinds = {name.partition("!")[0] for name in layout["configById"]}
    assert kinds == {"3D", "Plot", "Log", "RawMessages"}
    shown = json.dumps(layout["layout"])
    assert all(f'"{name}"' in shown for name in layout["configById"])
    assert layout["configById"]["Log!events"]["topicToRender"] == "/events"
    assert len(plots()) > 10
    for path in plots():
        topic, _, field = path.partition(".")
        kind = topic.split("/")[1]
        message = OF_ALL.get(kind) or KINDS[kind].message
        assert field.partition("[")[0] in messages.message_class(message).DESCRIPTOR.fields_by_name, path


def test_the_layout_for_foxglove_names_the_sensors_of_shipped_scenarios():
    known = {
        kind.topic(name)
        for file in (ROOT / "scenarios").glob("*.yaml")
        if file.name != "rules.yaml"
        for scenario in [replay.load(file)]
        for kind in KINDS.values()
        for name in scenario.sensors.of(kind.name)
    }
    assert {path.partition(".")[0] for path in plots()} - {f"/{topic}" for topic in OF_ALL} <= known
