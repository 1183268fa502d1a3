"""What all commands share: usage errors, exit codes, what is loaded, output that cannot be written."""

import os
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

import replay
import replay.batch.run
import replay.batch.select
from replay.cli.exit_codes import ExitCode, worst
from replay.cli.main import run

ROOT = Path(replay.__file__).parents[1]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["run"], "Missing argument"),
        (["nonsense"], "No such command 'nonsense'; new, run, validate"),
        (["valdate", "x"], "No such command 'valdate'; did you mean 'validate'?; see replay --help"),
        (["run", "x", "--workers", "0"], "'0' is no number of processes; write 1 or more; see replay run --help"),
        (["run", "x", "--shard", "3/2"], "must be i/n with 1 <= i <= n, such as 2/4; see replay run --help"),
        (["info", "none.mcap"], "cannot be read"),
        (["view", "none.rrd"], "no such file"),
        (["view", "none.txt"], "neither a .rrd nor a .mcap"),
        (["view", "none.rrd", "--at", "1"], "--at belongs to --screenshot"),
        (["view", "none.rrd", "--screenshot", "x.jpg"], "x.jpg must end in .png"),
        (["run", "none.yaml"], "is not there"),
        (["run", "/dev/null"], "is neither a file nor a folder"),
        (["run", ""], "the path is empty"),
        (["run", "x", "-o", ""], "the path is empty"),
        (["run", "x", "--model", ""], "model = '': names none; give a file, or a built-in model: thesis2015"),
        (["export", "x.mcap"], "Missing option '--format'. Choose from: csv, json, parquet; see replay export --help"),
        (["view", "none.rrd", "--screenshot", "x.png", "--at", "nan"], "is no moment of a recording"),
    ],
)
def test_usage_and_unreadable_input_are_exit_code_2(arguments, message, capsys):
    assert run(arguments) is ExitCode.INVALID
    said = capsys.readouterr().err
    assert message in said
    assert said.startswith("replay: error: ") and said.count("\n") == 1


@pytest.mark.parametrize(
    ("name", "reason"), [("a" * 300, "File name too long"), ("circle/x", "Too many levels of symbolic links")]
)
@pytest.mark.parametrize(
    "arguments",
    [
        ["run", "NAME"],
        ["run", "x", "-o", "NAME"],
        ["validate", "NAME"],
        ["info", "NAME"],
        ["export", "NAME", "--format", "csv"],
        ["diff", "NAME", "x"],
        ["regress", "x", "--baseline", "NAME"],
        ["accept", "NAME", "--baseline", "x", "--reason", "why"],
        ["view", "NAME"],
        ["import", "NAME", "-o", "x.yaml"],
        ["import", "x.urdf", "-o", "NAME"],
        ["import", "x.urdf", "-o", "x.yaml", "--package", "a=NAME"],
        ["calibrate", "x", "--curve", "NAME"],
    ],
    ids=" ".join,
)
def test_a_name_that_no_file_can_have_is_one_line(arguments, name, reason, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("circle").symlink_to("circle")
    Path("x.urdf").write_text("<robot name='r'><link name='a'/></robot>")
    assert run([argument.replace("NAME", name) for argument in arguments]) is ExitCode.INVALID
    said = capsys.readouterr().err
    assert reason in said or "names no folder" in said
    assert said.startswith("replay: error: ") and said.count("\n") == 1


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="a system without /dev/full")
def test_a_result_that_standard_output_has_no_space_for_is_one_line(scenario):
    with Path("/dev/full").open("w") as full:
        command = [sys.executable, "-m", "replay", "validate", str(scenario)]
        done = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    assert done.returncode == ExitCode.INVALID
    assert done.stderr == ("replay: error: the result cannot be written to standard output: No space left on device\n")


@pytest.mark.parametrize("arguments", [["--help"], ["validate", "SCENARIO"], ["--version"]])
def test_light_commands_load_nothing_heavy(arguments, scenario):
    arguments = [str(scenario) if argument == "SCENARIO" else argument for argument in arguments]
    heavy = ("numba", "rerun", "trimesh", "scipy", "matplotlib", "pyarrow", "fcl")
    code = (
        f"import sys; from replay.cli.main import run; code = run({arguments!r});"
        f"print(int(code), [m for m in {heavy!r} if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "0 []"


def test_exit_codes_win_in_the_order_of_the_design():
    codes = [ExitCode(code) for code in (0, 5, 1, 3, 4, 2, 130)]
    assert [worst(codes[: k + 1]) for k in range(len(codes))] == codes
    assert worst([]) is ExitCode.FINE


def test_a_fault_of_the_program_never_looks_like_a_difference(scenario, monkeypatch, capsys):
    def broken(_):
        raise RuntimeError("unforeseen")

    monkeypatch.setattr(replay.batch.select, "load_all", broken)
    assert run(["validate", str(scenario)]) is ExitCode.FAILED
    assert "fault of replay: RuntimeError: unforeseen" in capsys.readouterr().err


def test_an_interrupt_that_passed_through_an_exec_changes_no_exit_code(tmp_path):
    """Python remembers it, and `python -m` would kill itself by SIGINT instead of leaving with its code."""
    module = """
        from replay.cli.main import main
        try:
            exec("raise KeyboardInterrupt")
        except KeyboardInterrupt:
            pass
        main(["--version"])
    """
    (tmp_path / "interrupted.py").write_text(textwrap.dedent(module))
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-m", "interrupted"]
    left = subprocess.run(command, check=False, cwd=tmp_path, env=environment, capture_output=True)
    assert left.returncode == 0
