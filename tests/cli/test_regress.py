"""A night as CI sees it: verdicts, exit codes, reports, and how results are accepted."""

import json
import re
import signal
import subprocess
import sys
from pathlib import Path
from urllib.parse import unquote, urljoin, urlsplit
from xml.etree import ElementTree

import psutil
import pytest
import xmlschema

from replay.batch import regress
from replay.batch.baseline import Baseline
from replay.cli.exit_codes import ExitCode
from replay.cli.main import run
from replay.errors import RecordingError
from tests.batch import scenes

XSD = Path(__file__).parents[1] / "data" / "junit.xsd"
LIMITS = ["--workers", "2", "--timeout", "6s", "--memory", "600MiB"]


def verdicts_of(folder):
    return {name: entry["verdict"] for name, entry in json.loads((folder / "run.json").read_text())["verdicts"].items()}


def junit_of(folder):
    """Return the verdicts of a valid junit.xml: pass, failure, error or skipped by name."""
    xmlschema.XMLSchema(XSD).validate(str(folder / "junit.xml"))
    (suite,) = ElementTree.parse(folder / "junit.xml").getroot()
    cases = {case.get("name"): (case[0].tag if len(case) else "pass") for case in suite.iter("testcase")}
    for tag, attribute in (("failure", "failures"), ("error", "errors"), ("skipped", "skipped")):
        assert int(suite.get(attribute)) == list(cases.values()).count(tag)
    assert int(suite.get("tests")) == len(cases)
    return cases


def night(folder, output, *more):
    base = ["--baseline", str(folder / "base"), "-o", str(output)]
    return run(["regress", str(folder / "in"), *base, *LIMITS, *map(str, more)])


def prepare(folder, plain, bad, differing):
    """Write scenarios and accept them as they are; then change those that are to differ."""
    names = [f"{kind}_{k}" for kind, count in [("plain", plain), ("differ", differing)] for k in range(count)]
    for name in names:
        scenes.write(folder / "in", name)
    assert night(folder, folder / "first", "--rrd", "none") is ExitCode.FAILED  # there are no baselines yet
    assert set(verdicts_of(folder / "first").values()) == {"missing baseline"}
    assert run(["accept", str(folder / "first"), "--baseline", str(folder / "base"), "--yes", "--reason", "ok"]) == 0
    for k in range(differing):
        scenes.write(folder / "in", f"differ_{k}", distance=1.25)
    for kind in ("crash", "hang", "eat"):
        for k in range(bad):
            scenes.write(folder / "in", f"{kind}_{k}")


def check_night(tmp_path, monkeypatch, *, plain, bad, differing):
    before = {process.pid for process in psutil.Process().children(recursive=True)}
    prepare(tmp_path, plain, bad, differing)
    monkeypatch.setattr("replay.batch.run.run_case", scenes.misbehave)
    out = tmp_path / "night"
    assert night(tmp_path, out) is ExitCode.FAILED
    check_verdicts(out, plain, bad, differing)
    assert {process.pid for process in psutil.Process().children(recursive=True)} == before
    for kind in ("crash", "hang", "eat"):
        for k in range(bad):
            (tmp_path / "in" / f"{kind}_{k}.yaml").unlink()
    assert night(tmp_path, out) is ExitCode.DIFFERENT
    return out


def check_verdicts(out, plain, bad, differing):
    """Check that run.json and junit.xml give each scenario the verdict of its name."""
    counted = {"plain": "same", "differ": "different", "crash": "crashed", "hang": "timeout", "eat": "memory"}
    found = verdicts_of(out)
    assert found == {name: counted[name.split("_")[0]] for name in found}
    assert len(found) == plain + 3 * bad + differing
    tags = {"same": "pass", "different": "failure"}
    assert junit_of(out) == {name: tags.get(verdict, "error") for name, verdict in found.items()}


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
    page = (out / "index.html").read_text()
    assert f"since {json.loads(nights[0])['time']}" in page
    assert page.index("differ_0") < page.index("plain_0")
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
    assert "rate = &#39;fast&#39;" in (out / "index.html").read_text()
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


def test_a_damaged_baseline_is_replaced_by_accepting(tmp_path, capsys):
    prepare(tmp_path, plain=3, bad=0, differing=0)
    for name in ("plain_0", "plain_1"):
        damaged = tmp_path / "base" / name / f"{name}.mcap"
        damaged.write_bytes(damaged.read_bytes()[:-100])
    out = tmp_path / "out"
    assert night(tmp_path, out, "--select", "plain_[02]") is ExitCode.INVALID
    assert verdicts_of(out) == {"plain_0": "unreadable baseline", "plain_1": "skipped", "plain_2": "same"}
    capsys.readouterr()
    assert run(["accept", str(out), "--baseline", str(tmp_path / "base"), "--yes", "--reason", "mended"]) == 0
    assert "plain_0: replaces a baseline that cannot be read: damaged: its end" in capsys.readouterr().out
    assert night(tmp_path, out, "--select", "plain_[02]") is ExitCode.FINE


def test_accepting_shows_refuses_and_logs(tmp_path, capsys):
    scenes.write(tmp_path / "in", "a")
    scenes.write(tmp_path / "in", "b")
    out, base = tmp_path / "out", tmp_path / "base"
    accept = ["accept", str(out), "--baseline", str(base)]
    assert run(["run", str(tmp_path / "in"), "-o", str(out), "--no-rrd"]) is ExitCode.FINE
    assert run([*accept, "--yes", "--reason", "first"]) is ExitCode.FINE
    assert "no --reason" not in capsys.readouterr().err
    assert run([*accept, "--yes"]) is ExitCode.FINE
    assert "0 to be accepted, 2 unchanged" in capsys.readouterr().out
    scenes.write(tmp_path / "in", "a", distance=1.3)
    assert run(["run", str(tmp_path / "in"), "-o", str(out), "--no-rrd", "--overwrite"]) is ExitCode.FINE
    assert run(accept) is ExitCode.INVALID
    assert "nobody to ask" in capsys.readouterr().err
    assert run([*accept, "--yes", "--reason", "the wall was moved"]) is ExitCode.FINE
    assert re.search("^a: .*signals changed", capsys.readouterr().out, re.MULTILINE)
    log = [json.loads(line) for line in (base / "accepted.jsonl").read_text().splitlines()]
    assert [(line["reason"], list(line["scenarios"])) for line in log] == [
        ("first", ["a", "b"]),
        ("the wall was moved", ["a"]),
    ]
    assert night(tmp_path, tmp_path / "night", "--rrd", "none") is ExitCode.FINE
    scenes.write(tmp_path / "in", "b", contact="always")
    assert night(tmp_path, tmp_path / "night", "--rrd", "none") is ExitCode.FAILED
    assert verdicts_of(tmp_path / "night")["b"] == "broken"
    assert run(["accept", str(tmp_path / "night"), "--baseline", str(base), "--yes"]) is ExitCode.INVALID
    assert "did not pass: b (broken)" in capsys.readouterr().err
    summary = json.loads((out / "run.json").read_text())
    (out / "run.json").write_text(json.dumps({**summary, "interrupted": True}))
    assert run([*accept, "--yes"]) is ExitCode.INVALID
    assert "interrupted" in capsys.readouterr().err
    assert run(["accept", str(tmp_path), "--baseline", str(base)]) is ExitCode.INVALID


INTERRUPTED = """
import signal, sys, time
import replay.batch.regress as regress
from replay.cli.main import main

signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background jobs ignore it
read_pair = regress.read_pair

def slow(baseline, candidate, **rules):
    if candidate.stem == "b":
        print("comparing b", flush=True)
        time.sleep(60)
    return read_pair(baseline, candidate, **rules)

regress.read_pair = slow
main(sys.argv[1:])
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_request_to_stop_while_comparing_leaves_partial_reports(tmp_path, capsys, number):
    for name in "abc":
        scenes.write(tmp_path / "in", name)
    out, base = tmp_path / "out", tmp_path / "base"
    assert night(tmp_path, out, "--missing-baseline", "create", "--rrd", "none") is ExitCode.FINE
    arguments = ["regress", str(tmp_path / "in"), "--baseline", str(base), "-o", str(out), "--workers", "1"]
    command = [sys.executable, "-c", INTERRUPTED, *arguments]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout.readline() == "comparing b\n"
            assert not (out / "index.html").exists()  # that of the night before
            process.send_signal(number)
            text, error = process.communicate(timeout=20)
        finally:
            process.kill()
    assert process.returncode == 130, error
    assert "Traceback" not in error
    assert "b: interrupted: the run was ended before it was compared" in text
    assert "interrupted: the reports are partial" in text
    assert json.loads((out / "run.json").read_text())["interrupted"] is True
    assert verdicts_of(out) == {"a": "same", "b": "interrupted", "c": "interrupted"}
    assert junit_of(out) == {"a": "pass", "b": "error", "c": "error"}
    assert "Interrupted" in (out / "index.html").read_text()
    assert len((out / "history.jsonl").read_text().splitlines()) == 1  # no night of the history
    assert run(["accept", str(out), "--baseline", str(base), "--yes"]) is ExitCode.INVALID
    assert "interrupted" in capsys.readouterr().err


def test_a_request_to_stop_after_the_results_changes_nothing(tmp_path):
    scenes.write(tmp_path / "in", "a")
    code = "import atexit, sys, time; from replay.cli.main import main;"
    code += "atexit.register(lambda: (print('end', flush=True), time.sleep(0.5))); main(sys.argv[1:])"
    command = [sys.executable, "-c", code, "validate", str(tmp_path / "in")]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        while process.stdout.readline() != "end\n":
            assert process.poll() is None
        process.send_signal(signal.SIGTERM)
        process.communicate(timeout=20)
    assert process.returncode == 0


def test_a_baseline_folder_that_cannot_be_written_is_told_in_the_reports(tmp_path, capsys):
    scenes.write(tmp_path / "in", "a")
    (tmp_path / "base").mkdir()
    (tmp_path / "base" / "a").write_text("where the folder should be")
    assert night(tmp_path, tmp_path / "out", "--missing-baseline", "create", "--rrd", "none") is ExitCode.FAILED
    assert f"a: missing baseline: {tmp_path / 'base'}" in capsys.readouterr().out
    assert junit_of(tmp_path / "out") == {"a": "failure"}


def test_a_recording_is_run_and_compared_again_by_the_command_on_the_page(tmp_path):
    scenes.write(tmp_path / "in", "a")
    assert run(["run", str(tmp_path / "in"), "-o", str(tmp_path / "old"), "--no-rrd"]) is ExitCode.FINE
    old, out = tmp_path / "old" / "a" / "a.mcap", tmp_path / "out"
    options = ["--baseline", str(tmp_path / "base"), "--rrd", "none", "--missing-baseline", "create"]
    assert run(["regress", str(old), *options, "-o", str(out)]) is ExitCode.FINE
    command = re.search("<pre class=.mono.>(replay regress .*)</pre>", (out / "index.html").read_text())[1].split()
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
    page = (tmp_path / "out" / "index.html").read_text()
    assert "<script" not in page
    assert "&lt;script&gt;" in page
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


def test_a_night_that_could_not_be_reported_is_not_begun(tmp_path, capsys):
    scenes.write(tmp_path / "in", "plain")
    (tmp_path / "file").write_text("")
    for arguments, message in [
        (["--baseline", str(tmp_path / "file")], "is a file; give the folder that `replay accept` writes"),
        (["--baseline", str(tmp_path), "--history", str(tmp_path)], "cannot be read before it is appended to: Is a"),
        (["--baseline", str(tmp_path), "--history", str(tmp_path / "file" / "h")], "file where a folder is needed"),
    ]:
        assert run(["regress", str(tmp_path / "in"), "-o", str(tmp_path / "out"), *arguments]) is ExitCode.INVALID
        said = capsys.readouterr().err
        assert message in said and said.count("\n") == 1
        assert not (tmp_path / "out").exists()


def test_one_odd_baseline_never_ends_a_night(tmp_path, monkeypatch, capsys):
    """Whatever is odd about one comparison, in a way that nobody has foreseen."""
    prepare(tmp_path, plain=4, bad=0, differing=1)
    read_pair = regress.read_pair

    def odd(baseline, candidate, **rules):
        match candidate.stem:
            case "plain_0":
                raise RecursionError("maximum recursion depth exceeded\nwhile comparing")
            case "plain_1":
                raise RecordingError(str(candidate), "damaged: its end is missing")
            case "plain_2":
                raise RecordingError(str(baseline), "damaged: its end is missing")
        return read_pair(baseline, candidate, **rules)

    def undrawable(*_):
        raise ZeroDivisionError("no extent")

    monkeypatch.setattr(regress, "read_pair", odd)
    monkeypatch.setattr(regress, "plots", undrawable)
    monkeypatch.setattr(regress, "write_overlay", undrawable)
    out = tmp_path / "out"
    assert night(tmp_path, out) is ExitCode.INVALID
    assert verdicts_of(out) == {
        "differ_0": "different",
        "plain_0": "failed",
        "plain_1": "failed",
        "plain_2": "unreadable baseline",
        "plain_3": "same",
    }
    tags = ["failure", "error", "error", "error", "pass"]
    assert list(junit_of(out).values()) == tags
    said = capsys.readouterr().out
    recursion = "RecursionError: maximum recursion depth exceeded while comparing"
    assert f"plain_0: failed: it cannot be compared with its baseline: {recursion}" in said
    assert f"plain_1: failed: its own recording: {out / 'plain_1' / 'plain_1.mcap'}: damaged" in said
    assert "it cannot be drawn: ZeroDivisionError: no extent; both runs cannot be shown" in said
    assert "Traceback" in (out / "plain_0" / "log.txt").read_text()
    assert "differ_0" in (out / "index.html").read_text()
    assert len((out / "history.jsonl").read_text().splitlines()) == 1


def test_one_report_that_cannot_be_made_keeps_none_of_the_others(tmp_path, monkeypatch, capsys):
    prepare(tmp_path, plain=1, bad=0, differing=0)
    out = tmp_path / "out"
    (out / "junit.xml").mkdir(parents=True)
    (out / "junit.xml" / "in_the_way").touch()
    capsys.readouterr()
    assert night(tmp_path, out, "--rrd", "none") is ExitCode.INVALID
    said = capsys.readouterr()
    assert "junit.xml: cannot be written" in said.err and "1 scenario: 1 same" in said.out
    assert verdicts_of(out) == {"plain_0": "same"}
    assert (out / "index.html").is_file() and (out / "history.jsonl").is_file()


def test_a_new_baseline_is_told_only_where_one_was_written(tmp_path, capsys):
    scenes.write(tmp_path / "in", "a", contact="always")
    scenes.write(tmp_path / "in", "b")
    scenes.write(tmp_path / "in", "c")
    (tmp_path / "base").mkdir()
    (tmp_path / "base" / "c").write_text("where the folder should be")
    out = tmp_path / "out"
    assert night(tmp_path, out, "--missing-baseline", "create", "--rrd", "none") is ExitCode.FAILED
    assert verdicts_of(out) == {"a": "broken", "b": "missing baseline", "c": "missing baseline"}
    assert "its baseline is new" not in (out / "run.json").read_text() + capsys.readouterr().out
    (tmp_path / "base" / "c").unlink()
    assert night(tmp_path, out, "--missing-baseline", "create", "--rrd", "none") is ExitCode.FAILED
    entries = json.loads((out / "run.json").read_text())["verdicts"]
    assert {name: entry.get("message", "") for name, entry in entries.items() if name != "a"} == dict.fromkeys(
        "bc", "its baseline is new"
    )
    assert "baseline is new" not in entries["a"]["message"]
    assert Baseline(tmp_path / "base").names() == ["b", "c"]


KILLED = """
import os, signal, sys
import replay.batch.regress as regress
from replay.cli.main import main
judge = regress._judge

def killing(name, *arguments, **options):
    if name == "c":
        os.kill(os.getpid(), signal.SIGKILL)
    return judge(name, *arguments, **options)

regress._judge = killing
main(sys.argv[1:])
"""


def test_a_night_that_was_cut_is_carried_on(tmp_path, capsys):
    for name in "abc":
        scenes.write(tmp_path / "in", name)
    out, base = tmp_path / "out", tmp_path / "base"
    assert night(tmp_path, out, "--missing-baseline", "create", "--rrd", "none") is ExitCode.FINE
    scenes.write(tmp_path / "in", "b", distance=1.3)
    arguments = ["regress", str(tmp_path / "in"), "--baseline", str(base), "-o", str(out), "--workers", "1"]
    assert subprocess.run([sys.executable, "-c", KILLED, *arguments], check=False).returncode == -signal.SIGKILL
    cut = json.loads((out / "run.json").read_text())
    assert cut["interrupted"] is True and "verdicts" not in cut  # the night is not over
    assert {entry["status"] for entry in cut["scenarios"].values()} == {"passed"}
    assert run(["accept", str(out), "--baseline", str(base), "--yes"]) is ExitCode.INVALID
    before = {file: file.stat().st_mtime_ns for file in out.glob("*/*.mcap")}
    capsys.readouterr()
    assert night(tmp_path, out, "--resume", "--rrd", "none", "--timeout", "60s") is ExitCode.DIFFERENT
    assert capsys.readouterr().err.count(": reused") == 3
    assert {file: file.stat().st_mtime_ns for file in out.glob("*/*.mcap")} == before
    assert verdicts_of(out) == {"a": "same", "b": "different", "c": "same"}
    assert json.loads((out / "run.json").read_text())["interrupted"] is False
    assert len((out / "history.jsonl").read_text().splitlines()) == 2
    (out / "c" / "c.mcap").unlink()
    assert (
        night(tmp_path, out, "--resume", "--rrd", "all", "--timeout", "60s") is ExitCode.DIFFERENT
    )  # now with recordings for eyes
    assert len(list(out.glob("*/?.rrd"))) == 3
    assert verdicts_of(out)["c"] == "same"


def test_the_page_of_a_night_finds_its_baselines_wherever_both_are_moved(tmp_path):
    scenes.write(tmp_path / "first" / "in", "a[1]")
    path = tmp_path / "first" / "in" / "a[1].yaml"
    path.write_text(path.read_text().replace("name: a[1]", "name: 'a: 50 % #1'"))
    night(tmp_path / "first", tmp_path / "first" / "out", "--missing-baseline", "create", "--rrd", "none")
    assert night(tmp_path / "first", tmp_path / "first" / "out", "--rrd", "none") is ExitCode.FINE
    (tmp_path / "first").rename(tmp_path / "moved elsewhere")
    out = tmp_path / "moved elsewhere" / "out"
    page = (out / "index.html").read_text()
    assert "file:" not in page
    (address,) = re.findall('href="([^"]*)">baseline<', page)
    target = urlsplit(urljoin((out / "index.html").as_uri(), address))
    assert Path(unquote(target.path)).is_file()
