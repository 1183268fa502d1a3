"""Shards of a night put together."""

import json
from xml.etree import ElementTree

import pyarrow.parquet as pq

from replay.cli.exit_codes import ExitCode
from replay.cli.main import run
from tests.batch import scenes
from tests.cli.nights import junit_of, night, prepare, rows_of, verdicts_of


def test_shards_are_put_together_as_the_night_that_they_are_parts_of(tmp_path, capsys):
    prepare(tmp_path, plain=2, bad=0, differing=2)
    scenes.write(tmp_path / "in", "plain_0", contact="always")
    whole = tmp_path / "whole"
    assert night(tmp_path, whole, "--rrd", "none") is ExitCode.FAILED
    parts = [tmp_path / f"part_{k}" for k in (1, 2)]
    for k, part in enumerate(parts, start=1):
        night(tmp_path, part, "--rrd", "none", "--shard", f"{k}/2")
    for folder in (path for part in parts for path in part.iterdir() if path.is_dir()):
        (folder / "mine").mkdir()  # not the night's, and neither is what a link leads to
        (folder / "linked.txt").symlink_to(tmp_path / "in" / "plain_0.yaml")
    merged = tmp_path / "merged"
    history = tmp_path / "history.jsonl"
    capsys.readouterr()
    merge = ["merge", *map(str, parts), "-o", str(merged), "--history", str(history)]
    assert run(merge) is ExitCode.FAILED
    assert "4 scenarios: " in capsys.readouterr().out
    assert not [*merged.rglob("mine"), *merged.rglob("linked.txt")]
    assert verdicts_of(merged) == verdicts_of(whole)
    assert junit_of(merged) == junit_of(whole)
    messages = [row["message"] for row in rows_of(whole).values()]
    assert [row["message"] for row in rows_of(merged).values()] == messages
    assert all((merged / row["address"]).is_file() for row in rows_of(merged).values())
    told = [json.loads((folder / "run.json").read_text())["verdicts"] for folder in (whole, merged)]
    assert [entry.get("cause") for entry in told[1].values()] == [told[0][name].get("cause") for name in told[1]]
    rows = [sorted(pq.read_table(f / "metrics.parquet").to_pylist(), key=str) for f in (whole, merged)]
    assert rows[0] == rows[1]
    assert len(history.read_text().splitlines()) == 1
    assert run(["diff", str(whole), str(merged)]) is ExitCode.FINE
    texts = [case[0].get("message") for case in ElementTree.parse(merged / "junit.xml").iter("testcase") if len(case)]
    assert sum(text.startswith("distance +") for text in texts) == 2
    accept = ["accept", str(merged), "--baseline", str(tmp_path / "base"), "--yes", "--reason", "x", "--select", "d*"]
    assert run(accept) is ExitCode.FINE


def test_what_cannot_be_put_together_is_told(tmp_path, capsys):
    scenes.write(tmp_path / "in", "a")
    options = ("--missing-baseline", "skip", "--rrd", "none")
    for name, more in [("one", ()), ("two", ()), ("model", ("--model", "thesis2015"))]:
        assert night(tmp_path, tmp_path / name, *options, *more) is ExitCode.FINE
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "x").touch()
    for parts, output, message in [
        (["one", "two"], "new", "holds 'a', and so does"),
        (["one", "model"], "new", "was compared with model 'thesis2015'"),
        (["one", "in"], "new", "holds no run.json of a `replay regress`"),
        (["one"], "full", "is not empty"),
    ]:
        capsys.readouterr()
        command = ["merge", *(str(tmp_path / part) for part in parts), "-o", str(tmp_path / output)]
        assert run(command) is ExitCode.INVALID
        assert message in capsys.readouterr().err
