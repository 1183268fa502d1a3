"""The doors of a run folder: what is used again of it, what is compared, and a recording that is to be run again."""

from __future__ import annotations

import random
import shutil
from pathlib import Path

from replay.batch.resume import earlier_result
from replay.batch.run import Execution, run_all
from replay.batch.written import RESULT
from replay.comparison.run_folder import RUN
from replay.errors import ReplayError
from replay.scenario.load import load_sources
from tests.fuzz import damage
from tests.fuzz.door import Door, command


class RunDoors:
    """A run of one scenario, made once in a folder, and the doors that it comes back by."""

    def __init__(self, folder: Path, text: bytes) -> None:
        self._whole = folder / "run"
        self._scenario = load_sources("s.yaml", {"s.yaml": text})
        self._name = self._scenario.name
        run_all([self._scenario], self._whole, rrd=False, execution=Execution(workers=1))
        self._file = self._whole / self._name / f"{self._name}.mcap"
        self._recording = self._file.read_bytes()
        self._parsed = damage.parse(self._recording)

    def doors(self) -> dict[str, Door]:
        """Return the doors by name."""
        return {
            "run resume": Door(12, self._make_earlier, self._resume),
            "run diff": Door(8, self._make_report, lambda f: command("diff", str(self._whole), str(self._placed(f)))),
            "mcap again": Door(
                8, lambda rng: {"s.mcap": self._damaged(rng)}, lambda f: command("validate", str(f / "s.mcap"))
            ),
        }

    def _damaged(self, rng: random.Random) -> bytes:
        return damage.of_mcap(self._parsed, rng)

    def _make_earlier(self, rng: random.Random) -> dict[str, bytes]:
        result = (self._whole / self._name / RESULT).read_bytes()
        if rng.random() < 0.5:
            return {RESULT: result, f"{self._name}.mcap": self._damaged(rng)}
        return {RESULT: damage.of_json(result, rng), f"{self._name}.mcap": self._recording}

    def _resume(self, folder: Path) -> object:
        found = earlier_result(self._scenario, folder, model=None, rrd=False)
        if isinstance(found, str):  # why the scenario is run again
            raise ReplayError(found)
        return found.as_json()

    def _make_report(self, rng: random.Random) -> dict[str, bytes]:
        return {RUN: damage.of_json((self._whole / RUN).read_bytes(), rng)}

    def _placed(self, folder: Path) -> Path:
        (folder / self._name).mkdir()
        shutil.copy(self._file, folder / self._name)
        return folder
