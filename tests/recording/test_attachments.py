"""What is attached to a recording is what its provenance states, or it is not read, whatever the checksums say."""

import json
from pathlib import Path

import pytest

from replay.batch.baseline import Baseline, Entry
from replay.batch.resume import earlier_result
from replay.batch.select import load_all
from replay.cli.exit_codes import ExitCode
from replay.cli.main import run
from replay.errors import RecordingError
from replay.logs.mcap_reader import McapLog
from replay.recording.reader import read
from replay.recording.slim import attached_files, write_slim
from replay.recording.summary import summarize
from tests.batch.test_baseline import NOW
from tests.comparison import made_up
from tests.comparison.changed import BASELINE
from tests.recording.rewritten import rewritten

RULE = r"damaged: the attached 'meshes/beam.stl' is not the file whose SHA-256 its metadata states"
MESH = "meshes/beam.stl"


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    return made_up.write(BASELINE, tmp_path_factory.mktemp("whole") / "made_up.mcap")


def forged(whole: Path, folder: Path, **attached: bytes) -> Path:
    """Return a recording with other attachments, every checksum of its file made right."""
    target = folder / "made_up" / "made_up.mcap"
    target.parent.mkdir(parents=True)
    target.write_bytes(rewritten(whole.read_bytes(), attached=attached))
    with McapLog(target):
        return target


@pytest.mark.parametrize("salvage", [False, True])
def test_by_none_who_reads_it(whole, tmp_path, salvage):
    file = forged(whole, tmp_path, **{MESH: b"hollow beam"})
    with pytest.raises(RecordingError, match=RULE):
        read(file, salvage=salvage)
    with pytest.raises(RecordingError, match=RULE):
        read(file, salvage=salvage, topics=["/collision"])
    with pytest.raises(RecordingError, match=RULE):
        summarize(file, salvage=salvage)
    for use in (attached_files, lambda path: load_all([path])):
        with pytest.raises(RecordingError, match=RULE):
            use(file)
    with pytest.raises(RecordingError, match=RULE):
        write_slim(file, tmp_path / "slim.mcap", tmp_path / "objects")
    with pytest.raises(RecordingError, match=RULE):
        Baseline(tmp_path / "base").store({"made_up": Entry(file, "new")}, reason="x", now=NOW)
    assert not (tmp_path / "base").exists() and not (tmp_path / "objects").exists()


def test_by_no_command(whole, tmp_path, capsys):
    file = forged(whole, tmp_path / "run", **{MESH: b"hollow beam"})
    (tmp_path / "run" / "run.json").write_text(
        json.dumps({"interrupted": False, "scenarios": {"made_up": {"status": "passed"}}})
    )
    for command in (
        ["info", str(file)],
        ["export", str(file), "--format", "csv", "-o", str(tmp_path / "out")],
        ["diff", str(whole), str(file)],
        ["diff", str(file), str(whole)],
        ["run", str(file), "-o", str(tmp_path / "out")],
        ["validate", str(file)],
        ["accept", str(tmp_path / "run"), "--baseline", str(tmp_path / "base"), "--yes", "--reason", "x"],
    ):
        assert run(command) is ExitCode.INVALID, command
        (line,) = capsys.readouterr().err.splitlines()
        assert line == f"replay: error: {file}: {RULE}"
    assert not (tmp_path / "out").exists()


def test_nor_is_it_kept_by_a_run_that_is_resumed(whole, tmp_path):
    from tests.batch import scenes

    file = forged(whole, tmp_path, **{MESH: b"hollow beam"})
    (file.parent / "result.json").write_text("{}")
    scenario = scenes.scene("made_up")
    found = earlier_result(scenario, file.parent, model=None, rrd=False)
    assert isinstance(found, str) and found.startswith("damaged: the attached")


def test_what_is_attached_and_not_stated_is_none_of_the_scenarios_files(whole, tmp_path):
    file = forged(whole, tmp_path, **{"include.yaml": b"links: {}", "../x": b"", "a\x1b[2J": b""})
    assert read(file).files == made_up.FILES
    assert attached_files(file) == ("made_up", "run.yaml", made_up.FILES)
    write_slim(file, tmp_path / "slim.mcap", tmp_path / "objects")
    with McapLog(tmp_path / "slim.mcap") as log:
        assert [entry.name for entry in log.attachments] == ["run.yaml"]
    assert len(list((tmp_path / "objects").iterdir())) == 1


@pytest.mark.parametrize("digest", ["../../victim", "/etc/passwd", "", "A" * 64, "0" * 63, "\0"])
def test_a_digest_that_is_a_path_leads_nowhere(tmp_path, digest):
    (tmp_path / "objects").mkdir()
    made = made_up.with_provenance(BASELINE, files={**BASELINE.provenance.files, "other.stl": digest})
    file = made_up.write(made, tmp_path / "made_up.mcap")
    with pytest.raises(RecordingError, match=r"what its metadata states of 'other.stl' is no SHA-256"):
        attached_files(file)
    with pytest.raises(RecordingError, match="is no SHA-256"):
        write_slim(file, tmp_path / "slim.mcap", tmp_path / "objects")


def test_a_recording_that_lacks_a_file_is_not_accepted(tmp_path):
    files = {name: data for name, data in made_up.FILES.items() if name != MESH}
    file = made_up.write(BASELINE, tmp_path / "made_up.mcap", files=files)
    assert read(file).files == files  # as a slim one, it can be read and compared
    with pytest.raises(RecordingError, match=f"needs '{MESH}', which is neither attached nor in a folder"):
        Baseline(tmp_path / "base").store({"made_up": Entry(file, "new")}, reason="x", now=NOW)
