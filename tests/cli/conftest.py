"""A scenario and its recording, for all commands."""

import pytest

from replay.cli.exit_codes import ExitCode
from replay.cli.main import run
from tests.cli.swing import SCENARIO


@pytest.fixture(scope="session")
def scenario(tmp_path_factory):
    path = tmp_path_factory.mktemp("scenario") / "swing.yaml"
    path.write_text(SCENARIO.replace("EXPECTED", "never"))
    return path


@pytest.fixture(scope="session")
def recorded(scenario, tmp_path_factory):
    folder = tmp_path_factory.mktemp("run")
    assert run(["run", str(scenario), "-o", str(folder)]) is ExitCode.FINE
    return folder / "swing"
