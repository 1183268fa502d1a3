"""A third kind of sensor, written in this file alone: it goes through the whole house.

The touch switch is pressed while a shape of its own link is within its reach of another one. The one test runs the
checks below it in a process that gets the kind by the environment, as `sensing.kinds` reads it; workers inherit it.
"""

from __future__ import annotations

import csv
import json
import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import jsonschema
import numpy as np
import pytest
import yaml
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory
from numpy.typing import NDArray
from rerun.chunk import RrdReader

import replay
from replay.collision.gjk import distance
from replay.errors import ScenarioError
from replay.language.fields import Glob, Name, Part, When
from replay.language.units import Distance
from replay.numerics.columns import Columns, Field
from replay.sensing.kind import Drawing, Expected, Method, SensorKind

ROOT = Path(__file__).parents[2]


class TouchSwitch(Part):
    """Is pressed while a shape of its link is near another shape."""

    link: Name
    """The link whose shapes press it."""
    reach: Distance = 0.0
    """How near is near enough [m]."""
    ignore: tuple[Glob, ...] = ()
    """Patterns of the names of links that do not press it."""


class TouchMethod(Method):
    """How touch switches are computed."""

    method: Literal["hulls", "boxes"] = "hulls"
    """Convex hulls, or boxes along the axes of the world."""


class GapBounds(Part):
    """Bounds of the gap."""

    min: Distance | None = None
    """It is never smaller [m]."""
    max: Distance | None = None
    """It is never larger [m]."""


class TouchExpectation(Part):
    """What a touch switch does."""

    touch: Name
    """Name of the switch."""
    pressed: When | None = None
    """Whether it is pressed."""
    gap: GapBounds | None = None
    """How near the nearest shape comes."""


@dataclass(frozen=True, eq=False)
class TouchColumns(Columns):
    """Readings of T switches in n frames."""

    pressed: Annotated[NDArray[np.bool_], Field(events={"press": 4})]
    gap: Annotated[NDArray[np.float64], Field(unit="m", chart="Gap [m]")]
    witness: Annotated[NDArray[np.float64], Field(unit="m", letters="xyz", beam=True)]
    nearest: Annotated[NDArray[np.int32], Field(names="shapes")]
    gaps: Annotated[NDArray[np.float64], Field(unit="m", each="objects", label="gap")]


@dataclass(frozen=True)
class Switch:
    """A switch of a scene."""

    name: str
    link: int
    reach: float
    ignored: frozenset[int]


class TouchSuite:
    """All switches of a scene."""

    def __init__(self, sensors: Any, targets: Any, *, method: str, savings: bool) -> None:
        self.sensors, self.targets, self.boxes = sensors, targets, method == "boxes"

    def run(self, poses: Any) -> TouchColumns:
        """See `Suite`."""
        frames = len(poses.world)
        found = TouchColumns.nothing(frames, len(self.sensors), objects=len(self.targets))
        for s, switch in enumerate(self.sensors):
            own = [target for target in self.targets if target.link == switch.link]
            for t, target in enumerate(self.targets):
                if target.link == switch.link or target.link in switch.ignored:
                    continue
                for frame in range(frames):
                    near = [self._between(part, target, poses.world[frame]) for part in own]
                    gap, point = min(near, key=lambda pair: pair[0])
                    found.gaps[frame, s, t] = gap
                    if not gap >= found.gap[frame, s]:
                        found.gap[frame, s], found.nearest[frame, s], found.witness[frame, s] = gap, t, point
            found.pressed[:, s] = found.gap[:, s] <= switch.reach
        return found

    def _between(self, part: Any, target: Any, world: Any) -> tuple[float, Any]:
        a, b = (body.triangles.reshape(-1, 3) for body in (part, target))
        if self.boxes:
            a, b = a + world[part.link][:3, 3], b + world[target.link][:3, 3]
            apart = np.maximum(b.min(axis=0) - a.max(axis=0), a.min(axis=0) - b.max(axis=0))
            return float(np.linalg.norm(np.maximum(apart, 0.0))), b.mean(axis=0)
        found = distance(a, b, pose_a=world[part.link], pose_b=world[target.link])
        return found.distance, found.point_b

    def notes(self) -> tuple[str, ...]:
        """See `Suite`."""
        return (f"{len(self.sensors)} touch switches",)


SUITE = TouchSuite


def kernels(*, method: str, savings: bool) -> tuple[Any, ...]:
    """The package's own do."""
    return ()


class Touch(SensorKind):
    """A switch that touch presses."""

    name = "touch"
    part = TouchSwitch
    method = TouchMethod
    revisions: ClassVar = {"hulls": 7, "boxes": 1}
    models: ClassVar = {"thesis2015": TouchMethod(method="boxes")}
    expectation = TouchExpectation
    expected = (
        Expected("pressed", lambda columns: columns.pressed),
        Expected("gap", lambda columns: columns.gap, unit="m"),
    )
    columns = TouchColumns

    def module(self) -> Any:
        """See `SensorKind`."""
        return sys.modules[__name__]

    def sensor(self, name: str, part: TouchSwitch, link: int, ignored_links: frozenset[int]) -> Switch:
        """See `SensorKind`."""
        return Switch(name, link, part.reach, ignored_links)

    def drawing(self, sensor: Switch) -> Drawing:
        """See `SensorKind`: a stroke along the link's z."""
        stroke = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.1]])
        return Drawing((255, 0, 0, 255), 2.0, [stroke], stroke[:1], {})

    def cost(self, part: TouchSwitch, triangles: int) -> float:
        """See `SensorKind`."""
        return 100.0


KIND = Touch()

SCENARIO = """version: 1
name: press
rate: 10 Hz
duration: 2 s
links:
  arm:
    joint: {type: prismatic, axis: [1, 0, 0], lower: 0, upper: 1}
    shapes: {tip: {type: cube, size: 0.2}}
  wall: {pose: {xyz: [0.8, 0, 0]}, shapes: {slab: {type: cube, size: 0.2}}}
  roof: {pose: {xyz: [0, 0, 3]}, shapes: {slab: {type: cube, size: 0.2}}}
motion: {points: {arm: [{time: 0, position: 0}, {time: 1, position: 0.5}, {time: 2, position: 0}]}}
sensors:
  touch:
    bumper: {link: arm, reach: REACH}
    feeler: {link: arm, reach: REACH, ignore: [wall]}
expect:
  - {touch: bumper, pressed: sometimes, gap: {min: 9 cm}}
  - {touch: feeler, pressed: never}
"""
GAP = 0.1 + 0.05 * np.abs(np.arange(21) - 10)
"""The gap to the wall [m]: 0.6 m minus the arm's position."""


def test_a_kind_in_one_file_goes_through_the_house() -> None:
    inner = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-o", "python_functions=check_*", __file__]
    environment = {**os.environ, "REPLAY_SENSORS": __name__}
    done = subprocess.run(inner, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    from replay.sensing.kinds import KINDS

    assert KIND.name not in KINDS, "here nobody knows it"


def command(*arguments: object, code: int = 0) -> None:
    """Run a command in this process; its workers are others."""
    from replay.cli.main import run

    assert run([str(argument) for argument in arguments]) == code


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with the scenario, run into `one`, and with a longer reach into `other`."""
    folder = tmp_path_factory.mktemp("touch")
    (folder / "far").mkdir()
    (folder / "press.yaml").write_text(SCENARIO.replace("REACH", "17 cm"))
    (folder / "far" / "press.yaml").write_text(SCENARIO.replace("REACH", "22 cm"))
    command("run", folder / "press.yaml", "-o", folder / "one")
    command("run", folder / "far", "-o", folder / "other", "--no-rrd")
    return folder


@pytest.fixture
def recorded(folder: Path) -> Path:
    """Return the recording."""
    return folder / "one" / "press" / "press.mcap"


@pytest.mark.parametrize(
    ("written", "instead", "told"),
    [
        ("reach: 17 cm}", "reech: 17 cm}", "sensors.touch.bumper.reech: unknown key; did you mean 'reach'?"),
        ("reach: 17 cm}", "reach: 17 deg}", "is an angle where a length belongs"),
        ("link: arm, reach", "link: amr, reach", "sensors.touch.bumper.link = 'amr' is no link; did you mean 'arm'?"),
        ("touch: bumper", "touch: bamper", "is no touch sensor; did you mean 'bumper'?"),
        ("touch: bumper, pressed", "push: bumper, pressed", ", touch"),  # the last of the keys that an entry may have
        ("version: 1", "version: 1\nmodel: {touch: {method: hull}}", "model.touch.method = 'hull' must be 'hulls' or"),
    ],
)
def check_what_is_wrong_with_it_is_told(written: str, instead: str, told: str) -> None:
    from replay.scenario.load import load_sources

    text = SCENARIO.replace("REACH", "17 cm").replace(written, instead, 1)
    with pytest.raises(ScenarioError) as caught:
        load_sources("press.yaml", {"press.yaml": text.encode()})
    assert told in str(caught.value)


def check_it_is_part_of_the_language(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from replay.scenario.model import Scenario
    from replay.scenario.schema import schema_text

    command("validate", folder / "press.yaml", "--deep", "--format", "json")
    assert '"touch_sensors": 2' in capsys.readouterr().out
    schema, text = json.loads(schema_text(Scenario)), (folder / "press.yaml").read_text()
    jsonschema.validate(yaml.safe_load(text), schema)
    assert schema["$defs"]["Sensors"]["properties"]["touch"]["description"] == "Touch sensors."
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(yaml.safe_load(text.replace("reach", "reech")), schema)


def check_others_read_it(recorded: Path) -> None:
    with recorded.open("rb") as file:
        found = make_reader(file, decoder_factories=[DecoderFactory()]).iter_decoded_messages(["/touch/bumper"])
        messages = [(schema.name, message) for schema, _, _, message in found]
    assert {name for name, _ in messages} == {"replay.TouchReading"}
    readings = [message for _, message in messages]
    np.testing.assert_allclose([m.gap for m in readings], GAP, atol=1e-12)
    assert [m.pressed for m in readings] == (GAP < 0.17).tolist()
    np.testing.assert_allclose([m.witness.x for m in readings], 0.7, atol=1e-12)
    assert all(len(m.gaps) == 3 for m in readings)  # arm/tip, roof/slab, wall/slab


def check_it_is_read_back(folder: Path, recorded: Path) -> None:
    recording, blocks = replay.read(recorded), list(replay.simulate(replay.load(folder / "press.yaml")))
    for field in recording.touch.fields():
        whole = np.concatenate([getattr(block.touch, field.name) for block in blocks])
        assert getattr(recording.touch, field.name).tobytes() == whole.tobytes(), field.name
    assert recording.layout.touch_sensors == ("bumper", "feeler") and recording.distance is None
    assert recording.provenance.model["touch"] == "hulls@7"
    told = [(event.frame, event.begins, event.subject) for event in recording.events if event.kind == "press"]
    assert told == [(9, True, "bumper"), (12, False, "bumper")]
    some = replay.read(recorded, topics=["/touch/feeler"])
    assert some.layout.touch_sensors == ("feeler",) and not some.touch.pressed.any()


def check_what_is_expected_of_it(folder: Path) -> None:
    result = json.loads((folder / "one" / "press" / "result.json").read_text())
    assert [(line["expectation"], line["passed"], line["detail"]) for line in result["expectations"]] == [
        ("bumper: pressed sometimes", True, "pressed in 3 of 21 frames, first at 0.9 s"),
        ("bumper: gap >= 0.09 m", True, "smallest gap 0.1 m at 1 s"),
        ("feeler: pressed never", True, "pressed in 0 of 21 frames"),
    ]
    assert "2 touch switches" in result["notes"]


def check_it_is_drawn_and_charted(recorded: Path) -> None:
    paths = {str(chunk.entity_path) for chunk in RrdReader(str(recorded.with_suffix(".rrd"))).stream()}
    drawn = {"/scene/arm/touch_sensors/bumper", "/scene/closest_points/bumper"}
    assert drawn | {"/touch/bumper", "/touch/feeler"} <= paths


def check_it_is_exported(folder: Path, recorded: Path) -> None:
    command("export", recorded, "--format", "csv", "--topic", "/touch/bumper", "-o", folder / "tables")
    (file,) = (folder / "tables").iterdir()
    with file.open() as text:
        rows = list(csv.DictReader(text))
    place = [f"witness {letter} [m]" for letter in "xyz"]
    each = [f"{name} gap [m]" for name in ("arm/tip", "roof/slab", "wall/slab")]
    assert list(rows[0]) == ["time [ns]", "pressed", "gap [m]", *place, "nearest", *each]
    assert rows[10]["nearest"] == "wall/slab" and float(rows[10]["gap [m]"]) == pytest.approx(0.1, abs=1e-12)


def check_its_differences_are_told_by_rules(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    command("diff", folder / "one", folder / "other", "--html", folder / "difference.html", code=1)
    told = capsys.readouterr().out
    assert "changed: /touch/bumper/pressed" in told and "press begins 1 frame earlier" in told
    assert "/touch/bumper/gap" not in told
    assert "/touch/bumper/pressed" in (folder / "difference.html").read_text()
    rules = 'rules_version: 1\nrules: [{signal: "/touch/*/pressed", time: 1 frame, reason: "the reach was raised"}]\n'
    (folder / "rules.yaml").write_text(rules)
    command("diff", folder / "one", folder / "other", "--rules", folder / "rules.yaml")


def check_its_methods_are_versions_of_a_model(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    command("run", folder / "press.yaml", "-o", folder / "boxes", "--model", "thesis2015", "--no-rrd")
    command("diff", folder / "one", folder / "boxes", code=1)
    told = capsys.readouterr().out
    assert "model.touch: hulls@7 -> boxes@1" in told and "/touch/bumper/witness.x" in told
    command("run", folder / "one/press/press.mcap", "-o", folder / "again", "--no-rrd")
    assert (folder / "again/press/press.mcap").read_bytes() == (folder / "one/press/press.mcap").read_bytes()


def check_a_night_reports_it(folder: Path) -> None:
    night = ["regress", folder / "press.yaml", "--baseline", folder / "base", "--rrd", "none"]
    command(*night, "-o", folder / "first", "--missing-baseline", "create")
    command(*night, "-o", folder / "second")
    text = (folder / "press.yaml").read_text()
    (folder / "press.yaml").write_text(text.replace("17 cm", "22 cm").replace("pressed: never", "pressed: always"))
    command(*night, "-o", folder / "third", code=4)
    page = (folder / "third" / "index.html").read_text()
    assert "feeler: pressed always" in page
