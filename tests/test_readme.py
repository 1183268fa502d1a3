"""What the README shows works as it stands."""

import datetime
import re
import shlex
from pathlib import Path

import pytest

import replay
from replay.cli.exit_codes import ExitCode
from replay.cli.main import COMMANDS, replay_command, run
from replay.comparison.rules_file import read_rules
from replay.errors import Problem
from replay.scenario.measures import COLUMNS
from replay.scenario.reference import MARK, reference
from replay.scenario.yaml_text import parse

ROOT = Path(replay.__file__).parents[1]
DOCS = {
    name: (ROOT / name).read_text(encoding="utf-8") for name in ("README.md", "replay/README.md", "schemas/README.md")
}
ALL = "\n".join(DOCS.values())


def blocks(language: str) -> list[str]:
    found = re.findall(r"^```(\w*)\n(.*?)^```$", ALL, re.DOTALL | re.MULTILINE)
    return [text for name, text in found if name == language]


def test_the_first_page_is_read_in_two_minutes():
    assert len(DOCS["README.md"].splitlines()) <= 200


def test_the_first_scenario_runs_and_its_expectations_hold(tmp_path):
    path = tmp_path / "reach.yaml"
    path.write_text(next(block for block in blocks("yaml") if "version: 1" in block))
    assert run(["run", str(path), "-o", str(tmp_path / "out"), "--no-rrd"]) is ExitCode.FINE


def rounded(text: str) -> str:
    """Return text with long numbers cut to six digits: the last ones are those of the machine."""
    return re.sub(r"-?\d\.\d{9,}(e-?\d+)?", lambda number: f"{float(number[0]):.6g}", text)


def test_the_worked_example_says_what_the_readme_shows(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(ROOT)
    for line in next(block for block in blocks("sh") if "-o thesis --model thesis2015 --no-rrd" in block).splitlines():
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


@pytest.mark.parametrize("name", DOCS)
def test_every_file_it_points_to_is_there(name):
    links = re.findall(r"\]\((?!https?:|#)([^)#]+)", DOCS[name])
    assert links
    assert [link for link in links if not ((ROOT / name).parent / link).exists()] == []


def test_every_command_it_names_is_one_and_every_command_is_named():
    named = set(re.findall(r"\breplay ([a-z]+)\b(?=[ `])", "\n".join([*blocks("sh"), *blocks(""), ALL])))
    assert set(COMMANDS) <= named


def command_lines() -> list[str]:
    """Return the calls of `replay` in shell blocks, and in the example for GitHub Actions."""
    texts = [*blocks("sh"), *(block for block in blocks("yaml") if "runs-on" in block)]
    found = re.findall(r"(?:^|&& |run: )(?:\.venv/bin/)?(replay [^|&\n]*)", "\n".join(texts), re.MULTILINE)
    return [re.sub(r"\$\{\{ matrix.shard \}\}", "1/4", line) for line in found]


@pytest.mark.parametrize("line", command_lines())
def test_every_command_line_is_taken(line):
    """Arguments and options are those that there are; what is long is not run."""
    name, *words = shlex.split(line, comments=True)[1:]
    if words:
        command = replay_command.get_command(None, name)
        with command.make_context(name, [word for word in words if word != ">"]):
            pass


def test_the_example_for_github_is_yaml_and_its_rule_is_one(tmp_path):
    workflow = next(block for block in blocks("yaml") if "runs-on" in block)
    problems: list[Problem] = []
    jobs = parse(workflow.encode(), "workflow", problems).data()["jobs"]
    assert problems == [] and list(jobs) == ["shard", "night"] and jobs["night"]["needs"] == "shard"
    rules = tmp_path / "rules.yaml"
    rules.write_text(next(block for block in blocks("yaml") if "rules_version" in block))
    assert read_rules(rules, today=datetime.date(2026, 11, 30)).active[0].scenarios == ("reach*",)


def test_the_query_over_many_nights_is_of_columns_that_there_are():
    (query,) = blocks("sql")
    assert {"scenario", "value", "name"} <= set(COLUMNS) & set(re.findall(r"\w+", query))


def test_the_reference_is_the_one_of_this_code():
    assert DOCS["schemas/README.md"].partition(MARK)[2].strip() == reference().strip()


@pytest.mark.parametrize(
    "line", [line for block in blocks("sh") for line in block.splitlines() if line.startswith("make ")]
)
def test_every_make_target_it_names_exists(line):
    target = shlex.split(line)[1]
    assert re.search(rf"^{target}:.*##", (ROOT / "Makefile").read_text(), re.MULTILINE)
