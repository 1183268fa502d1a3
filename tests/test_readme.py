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
    found = re.findall(r"^```(\w*)\n(.*?)^```$", README, re.DOTALL | re.MULTILINE)
    return [text for name, text in found if name == language]


def test_the_first_scenario_runs_and_its_expectations_hold(tmp_path):
    path = tmp_path / "reach.yaml"
    path.write_text(next(block for block in blocks("yaml") if "version: 1" in block))
    assert run(["run", str(path), "-o", str(tmp_path / "out"), "--no-rrd"]) is ExitCode.FINE


def rounded(text: str) -> str:
    """Return text with long numbers cut to six digits: the last ones are those of the machine."""
    return re.sub(r"-?\d\.\d{9,}(e-?\d+)?", lambda number: f"{float(number[0]):.6g}", text)


def test_the_worked_example_says_what_the_readme_shows(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(ROOT)
    for line in next(block for block in blocks("sh") if "thesis2015" in block).splitlines():
        words = shlex.split(line)
        made = ("thesis", "ours", "difference.html", "differences")
        command = [str(tmp_path / word) if word in made else word for word in words]
        capsys.readouterr()
        code = run(command[1:])
        assert code is (ExitCode.DIFFERENT if "diff" in words else ExitCode.FINE)
    said = iter(rounded(capsys.readouterr().out).splitlines())
    shown = next(block for block in blocks("") if "carm_parking: " in block)
    for line in rounded(shown).splitlines():
        assert line == "..." or line in said  # each after the one before
    assert (tmp_path / "difference.html").is_file()
    assert (tmp_path / "differences" / "carm_parking.rrd").is_file()


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
