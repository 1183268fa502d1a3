"""The doors that something comes in by: how to make damaged input for each, and how to bring it in."""

from __future__ import annotations

import datetime
import io
import json
import random
import shutil
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

import pyarrow
import pyarrow.parquet
import trimesh

from replay.batch.accept import plan_acceptance
from replay.batch.case import CaseResult
from replay.batch.history import failing_since, read_history
from replay.batch.written import read_result
from replay.cli.exit_codes import ExitCode
from replay.comparison.rules_file import read_rules
from replay.errors import ReplayError
from replay.geometry.mesh import load_mesh
from replay.logs.curve_csv import read_curve
from replay.logs.mcap_reader import McapLog
from replay.recording.provenance import RECORD, Provenance
from replay.recording.reader import read
from replay.recording.recorded_paths import RecordedPaths
from replay.scenario.load import load_cases, load_model, load_sources
from tests.fuzz import damage
from tests.fuzz.compare_doors import CompareDoors
from tests.fuzz.door import Door, command
from tests.fuzz.night_doors import NightDoors
from tests.fuzz.robot_doors import robot_doors
from tests.fuzz.run_doors import RunDoors
from tests.logs import made_logs
from tests.recording.test_round_trip import write

FRAMES = 5
SCENARIO = b"""version: 1
name: small
rate: 60 Hz
duration: 1 s
tags: [a, b]
links:
  table: {shapes: {top: {type: cuboid, size: [2.0, 0.6, 5 cm], pose: {xyz: [0, 0, 0.9], rpy: [0, 0, 1 deg]}}}}
  arm:
    joint: {type: revolute, axis: [0, 1, 0], lower: -90 deg, upper: 90 deg, velocity: 60 deg/s, acceleration: 2}
    shapes: {rod: {type: cylinder, radius: 4 cm, height: 0.8}}
motion:
  moves: [{to: {arm: 20 deg}}]
collision: {margin: 5 cm, disable: [{pair: [arm, table], reason: "why: not"}]}
sensors:
  distance: {tip: {link: arm, aperture: 30 deg, range: 1.5}}
  capacitive: {guard: {link: arm, plates: {a: {size: [0.1, 0.1]}}, coupling: 10 pF}}
expect: [{distance: tip, detected: sometimes}]
"""
SWEEP = SCENARIO.replace(b"tags: [a, b]\n", b"") + (
    b"sweep:\n  grid:\n    sensors.distance.tip.aperture: [10 deg, 20 deg]\n"
    b'    "motion.moves[0].to.arm": [1 deg, 2 deg]\n'
)
PART = SCENARIO.partition(b"links:")[2]
INCLUDING = SCENARIO.partition(b"links:")[0] + b"include: [part.yaml]\n"
MODEL = b"""collision: {bounds: obb, narrowphase: gjk, pieces: exact, clearance: near, between: proven}
distance: {method: rays, count: 100}
capacitive: {method: tree, rtol: 1e-6}
"""
LISTED = SWEEP.partition(b"sweep:")[0] + b"sweep:\n  list:\n    - {rate: 10 Hz}\n    - {rate: 20 Hz, duration: 2 s}\n"
RULES = b"""rules_version: 1
rules:
  - {signal: "/tf/*", abs: 1e-9, rel: 1e-6, reason: why}
  - {signal: ["/collision/level/*", "/distance/*"], time: 1 frame, nan: equal, reason: why, expires: 2030-01-01}
  - {signal: "*", ignore: true, reason: why, link: "http://x"}
"""
RECORDED = b"""version: 1
name: again
rate: 50 Hz
duration: 0.2 s
links:
  base: {}
  arm: {parent: base, joint: {name: swing, type: revolute, axis: [0, 1, 0]}}
motion: {recorded: {file: FILE}}
"""
MEASURED = (
    RECORDED.partition(b"motion:")[0]
    + b"""measured:
  file: FILE
  signals: {/joint_states/position/swing: PLACE}
"""
)
PLACES = {"log.csv": b"{column: swing, nothing: -1}", "log.mcap": b"{topic: /joint_states, field: 'position[swing]'}"}
NIGHT = {"time": "2024-01-01T00:00:00+00:00", "version": "0.1", "failing": ["b"], "verdicts": {"a": "same", "b": "x"}}
RUN = {
    "replay": "0.1.0",
    "interrupted": False,
    "planned": 1,
    "scenarios": {"made_up": {"status": "passed", "seconds": 0.1, "memory": 1}},
}


class House:
    """All doors, with what is whole made once in a folder."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._recording = write(folder / "made_up.mcap", FRAMES).read_bytes()
        self._parsed = damage.parse(self._recording)
        self._baseline = folder / "made_up.mcap"
        with McapLog(self._baseline) as log:
            self._metadata = dict(log.metadata)[RECORD]
        box = trimesh.creation.box()
        self._meshes = {
            kind: box.export(file_type=kind, **options)
            for kind, options in (("stl", {}), ("stl_ascii", {}), ("ply", {}), ("obj", {}), ("glb", {}))
        }
        said = [made_logs.Said(k * 20_000_000, k * 20_000_000, {"swing": 0.01 * k}) for k in range(12)]
        self._logs = {kind: made_logs.mcap(said, kind) for kind in made_logs.MESSAGES}
        self._csv = made_logs.csv(said)
        self._bags = {"log.db3": made_logs.db3(said), "log.bag": made_logs.bag(folder, said, None)}
        self._bags["packed.bag"] = made_logs.bag(folder, said, "BZ2")
        self._folders = [made_logs.bag_folder(said, kind) for kind in ("db3", "mcap", "db3, packed by file")]
        table = {"time [ns]": [0, 20_000_000, 40_000_000], "swing position [rad]": [0.0, 0.1, 0.2]}
        self._document = json.dumps({"topics": {"/joint_states": table}}).encode()
        sink = io.BytesIO()
        pyarrow.parquet.write_table(pyarrow.table(table), sink)
        self._parquet = sink.getvalue()
        result = CaseResult("made_up", frames=FRAMES, counters={"tested": 3}, notes=("x",))
        self._result = result.as_json() | {"expectations": [{"expectation": "x", "passed": True, "detail": "y"}]}
        self.doors = self._doors()

    def _doors(self) -> dict[str, Door]:
        d = damage
        return {
            "yaml": Door(15, self._text("small.yaml", SCENARIO), lambda f: load_cases(f / "small.yaml")),
            "sweep": Door(
                6,
                lambda rng: {"sweep.yaml": d.of_text(rng.choice((SWEEP, LISTED)), rng)},
                lambda f: load_cases(f / "sweep.yaml"),
            ),
            "validate": Door(2, self._text("s.yaml", SCENARIO), lambda f: command("validate", str(f / "s.yaml"))),
            "include": Door(
                6,
                lambda rng: {"main.yaml": INCLUDING, "part.yaml": d.of_text(b"links:" + PART, rng)},
                lambda f: load_cases(f / "main.yaml"),
            ),
            "model": Door(15, self._text("model.yaml", MODEL), lambda f: load_model(f / "model.yaml")),
            "rules": Door(15, self._text("rules.yaml", RULES), self._enter_rules),
            "csv": Door(50, lambda rng: {"log.csv": d.of_text(self._csv, rng)}, self._motion("log.csv")),
            "measured csv": Door(20, lambda rng: {"log.csv": d.of_text(self._csv, rng)}, self._measured("log.csv")),
            "measured log": Door(10, self._make_log, self._measured("log.mcap")),
            "curve": Door(40, self._text("curve.csv", b"distance_cm,output_V\n1,2.0\n2,2.1\n3,2.2\n"), self._curve),
            "document": Door(40, lambda rng: {"log.json": d.of_json(self._document, rng)}, self._motion("log.json")),
            "parquet": Door(
                5, lambda rng: {"log.parquet": d.of_bytes(self._parquet, rng)}, self._motion("log.parquet")
            ),
            "log": Door(20, self._make_log, self._motion("log.mcap")),
            "log info": Door(8, self._make_log, lambda f: command("info", str(f / "log.mcap"))),
            "log export": Door(5, self._make_log, self._export("log.mcap")),
            "bag": Door(20, self._make_bag, self._enter_bag),
            "bag folder": Door(3, self._make_folder, self._enter_folder),
            "obj": Door(30, lambda rng: {"a.obj": d.of_text(self._mesh("obj"), rng)}, self._enter_mesh("a.obj")),
            "stl": Door(15, lambda rng: {"a.stl": d.of_bytes(self._mesh("stl"), rng)}, self._enter_mesh("a.stl")),
            "stl text": Door(
                25, lambda rng: {"a.stl": d.of_text(self._mesh("stl_ascii"), rng)}, self._enter_mesh("a.stl")
            ),
            "ply": Door(80, self._make_ply, self._enter_mesh("a.ply")),
            "glb": Door(60, self._make_glb, self._enter_mesh("a.glb")),
            "mcap read": Door(30, self._make_recording, lambda f: read(f / "made_up.mcap")),
            "mcap salvage": Door(
                15,
                lambda rng: {"made_up.mcap": d.of_bytes(self._recording, rng)},
                lambda f: read(f / "made_up.mcap", salvage=True),
            ),
            "mcap info": Door(10, self._make_recording, lambda f: command("info", str(f / "made_up.mcap"))),
            "mcap export": Door(6, self._make_recording, self._export("made_up.mcap")),
            "mcap diff": Door(8, self._make_recording, self._diff),
            "metadata": Door(150, self._make_metadata, self._enter_metadata),
            "run.json": Door(80, lambda rng: {"run.json": d.of_json(json.dumps(RUN).encode(), rng)}, self._accept),
            "result.json": Door(
                80,
                lambda rng: {"result.json": d.of_json(json.dumps(self._result).encode(), rng)},
                self._enter_result,
            ),
            "history": Door(80, self._make_history, self._enter_history),
            "accepted": Door(
                10,
                lambda rng: {"run.json": json.dumps(RUN).encode(), "accepted.jsonl": d.of_json(b'{"time": "x"}', rng)},
                self._accept,
            ),
            **robot_doors(),
            **RunDoors(self.folder, SCENARIO).doors(),
            **NightDoors(self.folder).doors(),
            **CompareDoors(self.folder).doors(),
        }

    def _text(self, name: str, whole: bytes) -> Callable[[random.Random], dict[str, bytes]]:
        return lambda rng: {name: damage.of_text(whole, rng)}

    def _mesh(self, kind: str) -> bytes:
        data = self._meshes[kind]
        return data.encode() if isinstance(data, str) else data

    def _enter_rules(self, folder: Path) -> object:
        return read_rules(folder / "rules.yaml", today=datetime.date(2026, 1, 1))

    def _curve(self, folder: Path) -> object:
        return read_curve(folder / "curve.csv")

    def _motion(self, name: str) -> Callable[[Path], object]:
        text = RECORDED.replace(b"FILE", name.encode())
        return lambda folder: load_sources("again.yaml", {"again.yaml": text, name: (folder / name).read_bytes()})

    def _measured(self, name: str) -> Callable[[Path], object]:
        text = MEASURED.replace(b"FILE", name.encode()).replace(b"PLACE", PLACES[name])
        return lambda folder: load_sources("again.yaml", {"again.yaml": text, name: (folder / name).read_bytes()})

    def _export(self, name: str) -> Callable[[Path], object]:
        def enter(folder: Path) -> object:
            kind = ("csv", "json", "parquet")[len((folder / name).read_bytes()) % 3]
            return command("export", str(folder / name), "--format", kind, "-o", str(folder / "out"), "--overwrite")

        return enter

    def _make_log(self, rng: random.Random) -> dict[str, bytes]:
        whole = self._logs[rng.choice([*self._logs])]
        return {"log.mcap": damage.of_mcap(damage.parse(whole), rng)}

    def _make_bag(self, rng: random.Random) -> dict[str, bytes]:
        name = rng.choice([*self._bags])
        return {name.replace("packed", "log"): damage.of_bytes(self._bags[name], rng)}

    def _enter_bag(self, folder: Path) -> object:
        (file,) = folder.glob("log.*")
        return self._motion(file.name)(folder)

    def _make_folder(self, rng: random.Random) -> dict[str, bytes]:
        files = dict(rng.choice(self._folders))
        name = "metadata.yaml" if rng.random() < 0.7 else rng.choice([*files])
        files[name] = (damage.of_text if name.endswith("yaml") else damage.of_bytes)(files[name], rng)
        return {f"drive/{name}": data for name, data in files.items()}

    def _enter_folder(self, folder: Path) -> object:
        (folder / "again.yaml").write_bytes(RECORDED.replace(b"FILE", b"drive"))
        return load_cases(folder / "again.yaml")

    def _make_ply(self, rng: random.Random) -> dict[str, bytes]:
        whole = self._mesh("ply") if rng.random() < 0.5 else TEXT_PLY
        head, mark, body = whole.partition(b"end_header\n")
        if rng.random() < 0.5:
            head = damage.of_text(head, rng)
        else:
            body = damage.of_bytes(body, rng)
        return {"a.ply": head + mark + body}

    def _make_glb(self, rng: random.Random) -> dict[str, bytes]:
        data = self._mesh("glb")
        size = int.from_bytes(data[12:16], "little")
        if rng.random() < 0.2:
            return {"a.glb": damage.of_bytes(data, rng)}
        text = damage.of_json(data[20 : 20 + size], rng)
        rest = data[20 + size :]
        head = b"glTF" + b"".join(n.to_bytes(4, "little") for n in (2, 20 + len(text) + len(rest), len(text)))
        return {"a.glb": head + b"JSON" + text + rest}

    def _enter_mesh(self, name: str) -> Callable[[Path], object]:
        return lambda folder: load_mesh(folder / name, scale=1.0)

    def _make_recording(self, rng: random.Random) -> dict[str, bytes]:
        return {"made_up.mcap": damage.of_mcap(self._parsed, rng)}

    def _diff(self, folder: Path) -> object:
        code = command(
            *("diff", str(self._baseline), str(folder / "made_up.mcap"), "--format", "json"),
            *("--html", str(folder / "d.html"), "--junit", str(folder / "d.xml")),
        )
        assert code in (ExitCode.FINE, ExitCode.DIFFERENT, ExitCode.INVALID)
        if code is not ExitCode.INVALID:
            ElementTree.parse(folder / "d.xml")
            (folder / "d.html").read_text()
        return code

    def _make_metadata(self, rng: random.Random) -> dict[str, bytes]:
        values = dict(self._metadata)
        key = rng.choice([*values])
        values[key] = damage.of_json(values[key].encode(), rng).decode(errors="replace")
        return {"metadata.json": json.dumps(values).encode()}

    def _enter_metadata(self, folder: Path) -> object:
        values = json.loads((folder / "metadata.json").read_bytes())
        found = Provenance.from_metadata("made_up.mcap", values)
        return json.dumps([found.to_metadata(), sorted(found.files.items()), found.code[:16], found.frames + 1])

    def _accept(self, folder: Path) -> object:
        (folder / "made_up").mkdir()
        shutil.copy(self._baseline, folder / "made_up" / "made_up.mcap")
        return plan_acceptance(folder, folder / "baseline").describe()

    def _enter_result(self, folder: Path) -> object:
        try:
            return CaseResult.from_json(read_result(folder / "result.json"), RecordedPaths(folder, None)).as_json()
        except ValueError as error:  # after which the scenario is run again
            raise ReplayError(str(error)) from None

    def _make_history(self, rng: random.Random) -> dict[str, bytes]:
        lines = [json.dumps(NIGHT).encode()] * 3
        lines[rng.randrange(3)] = damage.of_json(lines[0], rng)
        return {"history.jsonl": b"\n".join(lines) + b"\n"}

    def _enter_history(self, folder: Path) -> object:
        nights = read_history(folder / "history.jsonl")
        return [failing_since(nights, name) for name in ("a", "b")]


TEXT_PLY = (
    b"ply\nformat ascii 1.0\ncomment x\nelement vertex 5\nproperty float x\nproperty float y\nproperty float z\n"
    b"element face 3\nproperty list uchar int vertex_indices\nelement tristrips 1\n"
    b"property list int int vertex_indices\nend_header\n"
    b"0 0 0\n1 0 0\n1 1 0\n0 1 0\n0 0 1\n4 0 3 2 1\n3 0 1 4\n5 0 1 2 3 4\n5 0 1 2 -1 4\n"
)
