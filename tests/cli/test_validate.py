"""`replay validate`: problems with place and remedy, notes and counts."""

import json

from replay.cli.exit_codes import ExitCode
from replay.cli.main import run
from tests.cli.swing import SCENARIO


def test_validate_says_place_value_rule_and_remedy(tmp_path, capsys):
    path = tmp_path / "swing.yaml"
    path.write_text(SCENARIO.replace("EXPECTED", "never").replace("60 deg", "60 cm"))
    assert run(["validate", str(path)]) is ExitCode.INVALID
    error = capsys.readouterr().err
    assert "swing.yaml:13:" in error
    assert "60 cm" in error


def test_a_mistake_in_a_sweep_is_not_said_a_thousand_times(tmp_path, capsys):
    path = tmp_path / "many.yaml"
    path.write_text(
        "version: 1\nname: many\nrate: 10\nduration: 1\nlinks: {a: {shapes: {s: {type: cube, size: 1}}}}\n"
        f"sweep: {{grid: {{links.a.shapes.s.size: {[-k for k in range(1000)]}}}}}\n"
    )
    assert run(["validate", str(path)]) is ExitCode.INVALID
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 101
    assert lines[-1] == "replay: error: ... and 900 more"


def test_a_note_that_the_cases_of_a_sweep_share_is_said_once(tmp_path, capsys):
    path = tmp_path / "many.yaml"
    path.write_text(
        SCENARIO.replace("EXPECTED", "never").replace("time: 1,", "time: 3,") + "sweep: {grid: {rate: [10, 20]}}\n"
    )
    assert run(["validate", str(path)]) is ExitCode.FINE
    assert capsys.readouterr().err.count("after the scenario's end") == 1


def test_validate_deep_counts_what_would_be_simulated(scenario, capsys):
    assert run(["validate", str(scenario), "--deep", "--format", "json"]) is ExitCode.FINE
    entry = json.loads(capsys.readouterr().out)[0]
    assert (entry["pairs"], entry["triangles"], entry["distance_sensors"]) == (1, 24, 1)


def test_validate_deep_tells_of_meshes_too_and_nothing_twice(tmp_path, capsys):
    (tmp_path / "leaf.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    path = tmp_path / "leaf.yaml"
    path.write_text(
        "version: 1\nname: leaf\nrate: 10\nduration: 1\n"
        "links: {a: {joint: {type: prismatic, axis: [1, 0, 0], lower: 0, upper: 1}, "
        "shapes: {m: {type: mesh, file: leaf.obj, scale: 1}}}}\n"
        "motion: {points: {a: [{time: 0, position: 0}, {time: 3, position: 1}]}}\n"
    )
    said = []
    for deep in ([], ["--deep"]):
        assert run(["validate", str(path), *deep]) is ExitCode.FINE
        said.append(capsys.readouterr().err)
    assert [text.count("after the scenario's end") for text in said] == [1, 1]
    assert [text.count("3 edges are open") for text in said] == [0, 1]


def test_an_unusable_mesh_is_invalid_input_and_fails_one_of_many(tmp_path, capsys):
    (tmp_path / "cut.ply").write_bytes(b"ply\nformat ascii 1.0\nelement vertex 9\nend_header\n0\n")
    path = tmp_path / "bad.yaml"
    path.write_text(
        "version: 1\nname: bad\nrate: 10\nduration: 1\n"
        "links: {a: {shapes: {m: {type: mesh, file: cut.ply, scale: 1}}}}\n"
    )
    line = f"{path}:5:44: links.a.shapes.m.file = 'cut.ply' cannot be used: is not a usable PLY file: its header"
    assert run(["validate", str(path)]) is ExitCode.FINE
    assert run(["validate", "--deep", str(path)]) is ExitCode.INVALID
    assert capsys.readouterr().err.startswith(f"replay: error: {line}")
    out = ["-o", str(tmp_path / "out"), "--no-rrd", "--overwrite"]
    assert run(["run", str(path), *out]) is ExitCode.INVALID
    assert line in capsys.readouterr().out
    path.with_name("good.yaml").write_text("version: 1\nname: good\nrate: 10\nduration: 1\nlinks: {a: {}}\n")
    assert run(["run", str(tmp_path), *out]) is ExitCode.FAILED
    assert "good: passed" in capsys.readouterr().out


def test_one_of_a_kind_is_not_said_in_the_plural(tmp_path, capsys):
    path = tmp_path / "one.yaml"
    path.write_text("version: 1\nname: one\nrate: 1\nduration: 0.5\nlinks: {a: {shapes: {s: {type: cube, size: 1}}}}\n")
    assert run(["validate", "--deep", str(path)]) is ExitCode.FINE
    said = "one: valid, 1 frame, 1 link, 1 shape, 12 triangles, 0 pairs, 0 distance sensors, 0 capacitive sensors\n"
    assert capsys.readouterr().out == said
    out = tmp_path / "out"
    assert run(["run", str(path), "-o", str(out), "--no-rrd"]) is ExitCode.FINE
    assert run(["info", str(out / "one" / "one.mcap")]) is ExitCode.FINE
    text = capsys.readouterr().out
    assert "one: passed, 1 frame in" in text
    assert "one.mcap: one, 1 frame, 0 s, " in text


def test_what_touches_in_the_first_frame_is_told_with_lines_to_copy(tmp_path, capsys):
    path = tmp_path / "touch.yaml"
    ball = "shapes: {ball: {type: sphere, radius: 1}}"
    links = f"  a: {{{ball}}}\n  b: {{pose: {{xyz: [1.5, 0, 0]}}, {ball}}}\n  c: {{pose: {{xyz: [5, 0, 0]}}, {ball}}}\n"
    path.write_text(f"version: 1\nname: touch\nrate: 10\nduration: 0\nlinks:\n{links}")
    assert run(["validate", str(path), "--deep", "--format", "json"]) is ExitCode.FINE
    said = capsys.readouterr()
    assert json.loads(said.out)[0]["touching"] == ["a/ball|b/ball"]
    head, line = said.err.splitlines()
    assert head.startswith("replay: note: 1 pair is in contact in the first frame;")
    path.write_text(path.read_text() + f"collision:\n  disable:\n{line}\n")
    assert run(["validate", str(path), "--deep"]) is ExitCode.FINE
    assert capsys.readouterr().err == ""
