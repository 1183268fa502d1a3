"""The doors of a comparison with a machine: its log, the map of it, and a recording that holds both."""

from __future__ import annotations

import random
from collections.abc import Callable
from pathlib import Path
from unittest import mock
from xml.etree import ElementTree

from replay.cli.exit_codes import ExitCode
from replay.recording.record import record
from replay.scenario.load import load
from tests.comparison.measured import machine
from tests.fuzz import damage
from tests.fuzz.door import Door, command


class CompareDoors:
    """A machine's log in both forms and a recording to compare it with, made once in a folder."""

    def __init__(self, folder: Path) -> None:
        made = folder / "machine"
        made.mkdir()
        self._csv = machine.csv_log(made / "run.csv").read_bytes()
        self._mcap = damage.parse(machine.mcap_log(made / "run.mcap").read_bytes())
        self._maps = {"run.csv": machine.map_of(machine.OF_CSV), "run.mcap": machine.map_of(machine.OF_MCAP)}
        (made / "swing.yaml").write_text(f"{machine.SCENARIO}measured:\n  file: run.csv{machine.OF_CSV}")
        self._recording = record(load(made / "swing.yaml"), made, rrd=False).mcap
        self._parsed = damage.parse(self._recording.read_bytes())

    def doors(self) -> dict[str, Door]:
        """Return the doors by name."""
        return {
            "compare csv": Door(
                6,
                lambda rng: {"run.csv": damage.of_text(self._csv, rng), **self._map("run.csv")},
                self._enter("run.csv"),
            ),
            "compare log": Door(
                6,
                lambda rng: {"run.mcap": damage.of_mcap(self._mcap, rng), **self._map("run.mcap")},
                self._enter("run.mcap"),
            ),
            "compare map": Door(4, self._make_map, self._enter("run.csv")),
            "compare recording": Door(
                3,
                lambda rng: {"swing.mcap": damage.of_mcap(self._parsed, rng)},
                lambda f: _compared(f, f / "swing.mcap"),
            ),
        }

    def _map(self, log: str) -> dict[str, bytes]:
        return {"map.yaml": self._maps[log].encode()}

    def _make_map(self, rng: random.Random) -> dict[str, bytes]:
        return {"run.csv": self._csv, "map.yaml": damage.of_text(self._maps["run.csv"].encode(), rng)}

    def _enter(self, log: str) -> Callable[[Path], object]:
        def enter(folder: Path) -> object:
            long = len((folder / log).read_bytes()) % 2 == 1  # half of the tables are read as long ones are
            with mock.patch("replay.logs.field_csv.is_long", lambda data: long):
                given = ("--measured", str(folder / log), "--map", str(folder / "map.yaml"))
                return _compared(folder, self._recording, *given)

        return enter


def _compared(folder: Path, recording: Path, *given: str) -> ExitCode:
    reports = ("--format", "json", "--html", str(folder / "c.html"), "--junit", str(folder / "c.xml"))
    code = command("compare", str(recording), *given, *reports)
    assert code in (ExitCode.FINE, ExitCode.DIFFERENT, ExitCode.INVALID)
    if code is not ExitCode.INVALID:
        ElementTree.parse(folder / "c.xml")
        (folder / "c.html").read_text()
    return code
