"""A night as CI sees it: verdicts, exit codes, reports."""

import json
import re
from pathlib import Path
from urllib.parse import unquote, urljoin, urlsplit

import psutil
import pytest

from replay.batch.baseline import Baseline
from replay.cli.exit_codes import ExitCode
from replay.cli.main import run
from tests.batch import scenes
from tests.cli.nights import check_verdicts, junit_of, night, prepare, rows_of, verdicts_of


def check_night(tmp_path, monkeypatch, *, plain, bad, differing):
    before = {process.pid for process in psutil.Process().children(recursive=True)}
    prepare(tmp_path, plain, bad, differing)
    monkeypatch.setattr("replay.batch.run.run_case", scenes.misbehave)
    out = tmp_path / "night"
    assert night(tmp_path, out, "--timeout", "6s", workers=2) is ExitCode.FAILED
    check_verdicts(out, plain, bad, differing)
    assert {process.pid for process in psutil.Process().children(recursive=True)} == before
    for kind in ("crash", "hang", "eat"):
        for k in range(bad):
            (tmp_path / "in" / f"{kind}_{k}.yaml").unlink()
    assert night(tmp_path, out) is ExitCode.DIFFERENT
    return out


def test_a_night_gives_exactly_the_verdicts_of_its_scenarios(tmp_path, monkeypatch, capsys):
    out = check_night(tmp_path, monkeypatch, plain=3, bad=1, differing=2)
    text = capsys.readouterr().out
    assert "differ_0: different: " in text
    assert "5 scenarios: 2 different, 3 same" in text
    assert (out / "differ_0" / "differ_0.rrd").is_file()
    assert (out / "differ_0" / "differ_0.difference.rrd").is_file()
    assert not list(out.glob("plain*/*.rrd"))
    nights = (out / "history.jsonl").read_text().splitlines()
    assert len(nights) == 2
    summary = json.loads((out / "run.json").read_text())
    assert summary["verdicts"]["differ_1"]["since"] == json.loads(nights[0])["time"]
    assert summary["host"]
    rows = rows_of(out)
    assert rows["differ_1"]["since"] == json.loads(nights[0])["time"]
    assert list(rows)[:2] == ["differ_0", "differ_1"]
    page = (out / rows["differ_0"]["address"]).read_text()
    command = re.search("<pre class=.mono.>(replay regress .*--select differ_0 .*)</pre>", page)[1]
    again = command.split()[1:]
    again[again.index("-o") + 1] = str(tmp_path / "again")
    assert run(again) is ExitCode.DIFFERENT


@pytest.mark.soak
def test_a_night_of_two_hundred(tmp_path, monkeypatch):
    check_night(tmp_path, monkeypatch, plain=175, bad=5, differing=10)


def test_filters_missing_and_unused_baselines(tmp_path, capsys):
    for name in ("a", "b", "c"):
        scenes.write(tmp_path / "in", name)
    out = tmp_path / "out"
    assert night(tmp_path, out, "--select", "a", "--missing-baseline", "skip", "--rrd", "none") is ExitCode.FINE
    assert verdicts_of(out) == {"a": "no baseline", "b": "skipped", "c": "skipped"}
    assert set(junit_of(out).values()) == {"skipped"}
    assert night(tmp_path, out, "--shard", "1/3", "--missing-baseline", "create", "--rrd", "all") is ExitCode.FINE
    assert sorted(verdicts_of(out).values()) == ["created", "skipped", "skipped"]
    (made,) = Baseline(tmp_path / "base").names()
    assert (out / made / f"{made}.rrd").is_file()
    (tmp_path / "in" / f"{made}.yaml").unlink()
    capsys.readouterr()
    assert night(tmp_path, out, "--missing-baseline", "skip", "--rrd", "none") is ExitCode.FINE
    assert f"1 unused baseline, of no scenario given: {made}" in capsys.readouterr().out
    assert f"<li><code>{made}</code>" in (out / "index.html").read_text()
    assert night(tmp_path, out, "--select", "tag:none") is ExitCode.NOTHING


def test_one_scenario_with_a_mistake_does_not_cost_the_night(tmp_path, capsys):
    prepare(tmp_path, plain=3, bad=0, differing=0)
    wrong = tmp_path / "in" / "plain_1.yaml"
    wrong.write_text("version: 1\nname: plain_1 # of three\nrate: fast\nduration: 1\nlinks: {}\n")
    out = tmp_path / "out"
    capsys.readouterr()
    assert night(tmp_path, out) is ExitCode.INVALID
    said = capsys.readouterr().out
    assert f"plain_1: failed: {wrong}:3:7: rate = 'fast'" in said
    assert "unused" not in said
    assert verdicts_of(out) == {"plain_0": "same", "plain_1": "failed", "plain_2": "same"}
    assert junit_of(out) == {"plain_0": "pass", "plain_1": "error", "plain_2": "pass"}
    assert "rate = &#39;fast&#39;" in (out / "plain_1" / "report.html").read_text()
    assert "rate = 'fast'" in rows_of(out)["plain_1"]["message"]
    assert run(["accept", str(out), "--baseline", str(tmp_path / "base"), "--yes"]) is ExitCode.INVALID
    assert "plain_1 (failed)" in capsys.readouterr().err
    assert night(tmp_path, out, "--select", "plain_0") is ExitCode.FINE  # not asked for
    assert night(tmp_path, out, "--select", "plain_1") is ExitCode.INVALID  # nothing else asked for
    assert night(tmp_path, out, "--shard", "2/2") is ExitCode.FINE  # told in the first part
    assert night(tmp_path, out, "--shard", "1/2", "--select", "tag:quick") is ExitCode.INVALID
    (tmp_path / "in" / "other.yaml").write_text("version: 1\nname: [\n")  # named by its file then
    assert night(tmp_path, out, "--select", "*er") is ExitCode.INVALID
    assert night(tmp_path, out, "--select", "other", "--select", "plain_2") is ExitCode.INVALID
    assert verdicts_of(out)["other"] == "failed"


def test_mistakes_with_names_that_are_taken_have_names_of_their_own(tmp_path, capsys):
    prepare(tmp_path, plain=2, bad=0, differing=0)
    wrong = "version: 1\nname: plain_0\nrate: fast\n"
    for folder in ("first", "second"):
        (tmp_path / "in" / folder).mkdir()
        (tmp_path / "in" / folder / "plain_0.yaml").write_text(wrong)
    assert night(tmp_path, tmp_path / "out", "--rrd", "none") is ExitCode.INVALID
    failed = dict.fromkeys(("plain_0_2", "plain_0_3"), "failed")
    assert verdicts_of(tmp_path / "out") == {"plain_0": "same", "plain_1": "same", **failed}
    capsys.readouterr()


def test_a_renamed_scenario_is_told_by_its_readings(tmp_path, capsys):
    prepare(tmp_path, plain=2, bad=0, differing=0)
    (tmp_path / "in" / "plain_1.yaml").unlink()
    scenes.write(tmp_path / "in", "new_name")
    scenes.write(tmp_path / "in", "another", distance=1.25)
    capsys.readouterr()
    assert night(tmp_path, tmp_path / "out", "--rrd", "none") is ExitCode.FAILED
    said = capsys.readouterr().out
    assert "new_name: missing baseline" in said and "unused baseline plain_1 has exactly the same" in said
    assert said.count("renamed?") == 1
    assert "1 unused baseline, of no scenario given: plain_1; delete the folder of what is gone" in said


def test_one_file_is_compared_with_its_own_baseline_alone(tmp_path, capsys):
    prepare(tmp_path, plain=2, bad=0, differing=0)
    capsys.readouterr()
    base = ["--baseline", str(tmp_path / "base"), "-o", str(tmp_path / "out")]
    assert run(["regress", str(tmp_path / "in" / "plain_0.yaml"), *base]) is ExitCode.FINE
    assert "unused" not in capsys.readouterr().out


def test_a_recording_is_run_and_compared_again_by_the_command_on_the_page(tmp_path):
    scenes.write(tmp_path / "in", "a")
    assert run(["run", str(tmp_path / "in"), "-o", str(tmp_path / "old"), "--no-rrd"]) is ExitCode.FINE
    old, out = tmp_path / "old" / "a" / "a.mcap", tmp_path / "out"
    options = ["--baseline", str(tmp_path / "base"), "--rrd", "none", "--missing-baseline", "create"]
    assert run(["regress", str(old), *options, "-o", str(out)]) is ExitCode.FINE
    command = re.search("<pre class=.mono.>(replay regress .*)</pre>", (out / "a" / "report.html").read_text())[
        1
    ].split()
    assert command[:3] == ["replay", "regress", str(old)]
    command[command.index("-o") + 1] = str(tmp_path / "again")
    assert run(command[1:]) is ExitCode.FINE
    assert verdicts_of(tmp_path / "again") == {"a": "same"}


def test_rules_beside_the_scenarios_are_the_default(tmp_path):
    scenes.write(tmp_path / "in", "a")
    assert night(tmp_path, tmp_path / "out", "--missing-baseline", "create", "--rrd", "none") is ExitCode.FINE
    scenes.write(tmp_path / "in", "a", distance=1.2000001)
    assert night(tmp_path, tmp_path / "out", "--rrd", "none") is ExitCode.DIFFERENT
    rules = tmp_path / "in" / "rules.yaml"
    rules.write_text("rules_version: 1\nrules: [{signal: '*', abs: 1e-3, ignore: true, reason: rounding}]\n")
    assert night(tmp_path, tmp_path / "out", "--rrd", "none") is ExitCode.FINE
    assert json.loads((tmp_path / "out" / "run.json").read_text())["rules"] == str(rules)


def test_names_and_messages_are_shown_and_not_run(tmp_path):
    scenes.write(tmp_path / "in", "x")
    path = tmp_path / "in" / "x.yaml"
    path.write_text(path.read_text().replace("name: x", "name: '<script>alert(1)<script>'"))
    assert night(tmp_path, tmp_path / "out") is ExitCode.FAILED
    (row,) = rows_of(tmp_path / "out")
    assert row == "<script>alert(1)<script>"
    page = (tmp_path / "out" / "index.html").read_text()
    assert page.count("<script") == 1 and "&lt;script&gt;alert(1)" in page
    assert "<script" not in (tmp_path / "out" / row / "report.html").read_text()
    assert list(junit_of(tmp_path / "out")) == ["<script>alert(1)<script>"]


def test_a_sweep_is_run_case_by_case_and_a_case_again_from_its_recording(tmp_path):
    path = scenes.write(tmp_path / "in", "s")
    path.write_text(path.read_text() + 'sweep: {grid: {"sensors.distance.tip.aperture": [10 deg, 20 deg]}}\n')
    out = tmp_path / "out"
    assert run(["run", str(path), "-o", str(out), "--no-rrd"]) is ExitCode.FINE
    name = "s[aperture=20deg]"
    assert sorted(folder.name for folder in out.iterdir() if folder.is_dir()) == ["s[aperture=10deg]", name]
    recording = out / name / f"{name}.mcap"
    assert run(["run", str(recording), "-o", str(tmp_path / "again"), "--no-rrd", "--select", name]) is ExitCode.FINE
    assert (tmp_path / "again" / name / f"{name}.mcap").read_bytes() == recording.read_bytes()


def test_the_page_of_a_night_finds_its_baselines_wherever_both_are_moved(tmp_path):
    scenes.write(tmp_path / "first" / "in", "a[1]")
    path = tmp_path / "first" / "in" / "a[1].yaml"
    path.write_text(path.read_text().replace("name: a[1]", "name: 'a: 50 % #1'"))
    night(tmp_path / "first", tmp_path / "first" / "out", "--missing-baseline", "create", "--rrd", "none")
    assert night(tmp_path / "first", tmp_path / "first" / "out", "--rrd", "none") is ExitCode.FINE
    (tmp_path / "first").rename(tmp_path / "moved elsewhere")
    out = tmp_path / "moved elsewhere" / "out"
    (row,) = rows_of(out).values()
    page = Path(unquote(urlsplit(urljoin((out / "index.html").as_uri(), row["address"])).path))
    assert "file:" not in page.read_text()
    (address,) = re.findall('href="([^"]*)" target="_top">baseline<', page.read_text())
    target = urlsplit(urljoin(page.as_uri(), address))
    assert Path(unquote(target.path)).is_file()
