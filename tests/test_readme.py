"""What the README shows works as it stands."""

import re
import shlex
from pathlib import Path

import pytest

import replay
from replay.cli.exit_codes import ExitCode
from replay.cli.main import COMMANDS, run

ROOT = Path(replay.__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", README, re.DOTALL)


def test_the_first_scenario_runs_and_its_expectations_hold(tmp_path):
    path = tmp_path / "reach.yaml"
    path.write_text(next(block for block in blocks("yaml") if "version: 1" in block))
    assert run(["run", str(path), "-o", str(tmp_path / "out"), "--no-rrd"]) is ExitCode.FINE


def test_every_file_it_points_to_is_there():
    links = re.findall(r"\]\((?!https?:|#)([^)#]+)", README)
    assert links
    assert [link for link in links if not (ROOT / link).exists()] == []


def test_every_command_it_names_is_one_and_every_command_is_named():
    named = set(re.findall(r"\breplay ([a-z]+)\b(?=[ `])", "\n".join(blocks("sh") + blocks("") + [README])))
    assert set(COMMANDS) <= named


@pytest.mark.parametrize(
    "line", [line for block in blocks("sh") for line in block.splitlines() if line.startswith("make ")]
)
def test_every_make_target_it_names_exists(line):
    target = shlex.split(line)[1]
    assert re.search(rf"^{target}:.*##", (ROOT / "Makefile").read_text(), re.MULTILINE)
