"""A scenario that names its log, and the recording that was made of it."""

import pytest

from replay.recording.record import record
from replay.scenario.load import load
from tests.comparison.measured import machine


@pytest.fixture(scope="session")
def swing(tmp_path_factory):
    """The folder of a scenario with a log in CSV, one in MCAP, maps and rules, and the scenario's recording."""
    folder = tmp_path_factory.mktemp("machine")
    machine.csv_log(folder / "run.csv")
    machine.mcap_log(folder / "run.mcap")
    (folder / "plain.yaml").write_text(machine.SCENARIO)
    (folder / "swing.yaml").write_text(f"{machine.SCENARIO}measured:\n  file: run.csv{machine.OF_CSV}")
    (folder / "csv_map.yaml").write_text(machine.map_of(machine.OF_CSV))
    (folder / "mcap_map.yaml").write_text(machine.map_of(machine.OF_MCAP))
    (folder / "tolerances.yaml").write_text(machine.RULES)
    record(load(folder / "swing.yaml"), folder / "run", rrd=False)
    return folder
