"""The doors of nights: parts that are merged, a part that is accepted, numbers over nights, and explanations."""

from __future__ import annotations

import json
import random
import shutil
from pathlib import Path
from xml.etree import ElementTree

from replay.batch.judged import INDEX, JUNIT, SUMMARY
from replay.batch.written import RESULT
from replay.cli.exit_codes import ExitCode
from replay.comparison.run_folder import RUN
from replay.scenario.load import load_cases
from tests.fuzz import damage
from tests.fuzz.door import Door, command

GUARDED = """version: 1
name: NAME
rate: 60 Hz
duration: 0.5 s
tags: [night]
links:
  wall: {shapes: {slab: {type: cuboid, size: [0.1, 2, 2], pose: {xyz: [DISTANCE, 0, 0]}}}}
  arm:
    joint: {type: revolute, axis: [0, 1, 0], lower: -100 deg, upper: 100 deg, velocity: 60 deg/s, acceleration: 2}
    shapes: {rod: {type: cuboid, size: [0.1, 0.1, 1], pose: {xyz: [0, 0, 0.5]}}}
poses: {up: {arm: 0 deg}}
motion: {initial: up, moves: [{to: {arm: 60 deg}}]}
sensors:
  distance:
    tip:
      {link: arm, pose: {xyz: [0, 0, 1], rpy: [0, 90 deg, 0]}, aperture: 20 deg, range: 3,
       signal: {low_pass: 20 Hz, rate: 20 Hz, noise: {std: 2 mm, seed: 7}, delay: 50 ms}}
  capacitive:
    skin:
      {link: arm, plates: {a: {size: [0.1, 0.1], pose: {xyz: [0.06, 0, 0.9], rpy: [0, 90 deg, 0]}}}, coupling: 10 pF,
       signal: {quantisation: {bits: 12}, range: [0 V, 2.5 V]}}
guards:
  near: {when: {distance: tip, below: 1.1 m}, for: 10 ms, reaction: 20 ms, stop: [arm], deceleration: {arm: 20}}
  skin:
    when: {any: [{capacitive: skin, output: {below: 0.3 V}}, {all: [{pair: [arm, wall], clearance: {below: 5 cm}}]}]}
    slow: {to: 0.25, joints: [arm]}
    release: {after: 0.1 s}
expect:
  - {guard: near, stops: always, stopping_distance: {max: 60 deg}}
  - {pair: [arm, wall], contact: never}
"""
SIGNALS = (
    *("/distance/tip", "/distance/tip/distance", "/distance/tip/measured", "/capacitive/skin", "/capacitive/skin/a"),
    *(
        "/collision/arm/rod|wall/slab",
        "/collision/level/arm/rod|wall/slab",
        "/guards/near",
        "/guards",
        "/",
        "",
        "\x1b[2J",
    ),
)
FIRST = json.dumps(
    {
        "time": "2024-01-01T00:00:00+00:00",
        "version": "0.1",
        "failing": ["b"],
        "verdicts": {"a": "same", "b": "different"},
        "accepted": "2023-12-31T00:00:00+00:00",
        "units": {"clearance.min": "m", "expect[0].clearance": "m", "distance.tip.min": "m"},
        "results": {
            "clearance.min": {"a": 0.02, "b": -1.5e-3},
            "contact.first": {"b": 0.55},
            "contact.pairs": {"a": 0},
        },
    }
).encode()


def guarded(name: str, distance: float = 1.2) -> bytes:
    """Return a scenario with signals and guards."""
    return GUARDED.replace("NAME", name).replace("DISTANCE", f"{distance:g}").encode()


class NightDoors:
    """A night in two parts, each unlike its baseline, and the doors that parts and histories come in by."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder / "night"
        self._baseline = self._folder / "base"
        for part, names, missing in (("first", "ab", "create"), ("one", "a", "fail"), ("two", "b", "fail")):
            for name in names:
                file = self._folder / f"in {part}" / f"{name}.yaml"
                file.parent.mkdir(parents=True, exist_ok=True)
                file.write_bytes(guarded(name, 1.2 if part == "first" else 1.21))
            command(
                *("regress", str(self._folder / f"in {part}"), "--baseline", str(self._baseline), "--rrd", "none"),
                *("-o", str(self._folder / part), "--missing-baseline", missing, "--workers", "1"),
            )
        self._run = (self._folder / "two" / RUN).read_bytes()
        self._result = (self._folder / "two" / "b" / RESULT).read_bytes()
        self._recording = (self._folder / "two" / "b" / "b.mcap").read_bytes()
        self._parsed = damage.parse(self._recording)

    def doors(self) -> dict[str, Door]:
        """Return the doors by name."""
        return {
            "guards": Door(
                15, lambda rng: {"a.yaml": damage.of_text(guarded("a"), rng)}, lambda f: load_cases(f / "a.yaml")
            ),
            "guards diff": Door(4, lambda rng: {"b.mcap": damage.of_mcap(self._parsed, rng)}, self._diff),
            "trend": Door(20, self._make_history, self._trend),
            "merge": Door(4, self._make_part, self._merge),
            "accept group": Door(10, self._make_report, self._accept),
            "explain": Door(2, self._make_asked, self._explain),
        }

    def _make_history(self, rng: random.Random) -> dict[str, bytes]:
        lines = [FIRST] * 4
        lines[rng.randrange(4)] = damage.of_json(FIRST, rng)
        return {"history.jsonl": b"\n".join(lines) + b"\n"}

    def _trend(self, folder: Path) -> object:
        form = ("text", "json")[len((folder / "history.jsonl").read_bytes()) % 2]
        page = folder / "trend.html"
        return command("trend", "--history", str(folder / "history.jsonl"), "--format", form, "--html", str(page))

    def _make_report(self, rng: random.Random) -> dict[str, bytes]:
        return {f"part/{RUN}": damage.of_json(self._run, rng)}

    def _make_part(self, rng: random.Random) -> dict[str, bytes]:
        if rng.random() < 0.5:
            return {f"part/{RUN}": self._run, f"part/b/{RESULT}": damage.of_json(self._result, rng)}
        return {f"part/{RUN}": damage.of_json(self._run, rng), f"part/b/{RESULT}": self._result}

    def _place(self, folder: Path) -> Path:
        (folder / "part" / "b").mkdir(exist_ok=True)
        shutil.copy(self._folder / "two" / "b" / "b.mcap", folder / "part" / "b")
        return folder / "part"

    def _merge(self, folder: Path) -> object:
        whole = folder / "whole"
        code = command("merge", str(self._folder / "one"), str(self._place(folder)), "-o", str(whole))
        if code is not ExitCode.INVALID:
            ElementTree.parse(whole / JUNIT)
            assert all((whole / name).read_text(encoding="utf-8") for name in (INDEX, SUMMARY))
            json.loads((whole / RUN).read_text())
        return code

    def _accept(self, folder: Path) -> object:
        baseline = folder / "base"
        shutil.copytree(self._baseline, baseline)
        return command(
            *("accept", str(self._place(folder)), "--baseline", str(baseline), "--group", "*", "--yes"),
            *("--reason", "why"),
        )

    def _make_asked(self, rng: random.Random) -> dict[str, bytes]:
        asked = {"signal": rng.choice(SIGNALS), "at": rng.choice(("0.2", "0", "0.5", "1e308", "-1", "nan"))}
        return {"b.mcap": damage.of_mcap(self._parsed, rng), "asked.json": json.dumps(asked).encode()}

    def _explain(self, folder: Path) -> object:
        asked = json.loads((folder / "asked.json").read_bytes())
        return command("explain", str(folder / "b.mcap"), asked["signal"], f"--at={asked['at']}")

    def _diff(self, folder: Path) -> object:
        return command(
            *("diff", str(self._folder / "two" / "b" / "b.mcap"), str(folder / "b.mcap"), "--format", "json"),
            *("--html", str(folder / "d.html"), "--junit", str(folder / "d.xml")),
        )
