"""A workplace in which commands are killed and meet each other, and what must hold in it afterwards.

Two versions of the same scenarios, `old` and `new`, differ in every recording and share no mesh. Whatever happens, each
recording is byte by byte of one of them, and no report says of anything what is not so.
"""

import contextlib
import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import psutil
import trimesh

from replay.batch.baseline import Baseline
from replay.batch.claim import claim
from replay.batch.run import Execution, run_all
from replay.batch.select import load_all
from replay.cli.exit_codes import ExitCode
from replay.cli.main import run
from replay.geometry import primitives
from replay.recording.slim import attached_files
from tests.batch import scenes

NAMES = ("a", "b", "c")
VERSIONS = {"old": 1.2, "new": 1.3}
ROOT = Path(__file__).parents[2]


@dataclass(frozen=True)
class Ended:
    """A command that is over.

    Attributes:
        kind: of it.
        version: of the scenarios that it was given.
        code: its exit code; negative for the signal that ended it.
        said: on stderr.
        began: time [s].
    """

    kind: str
    version: str
    code: int
    said: str
    began: float


def children(parent):
    """Return the processes that a process has started and that live."""
    try:
        return psutil.Process(parent).children(recursive=True)
    except psutil.Error:
        return []


class Workplace:
    """Scenarios and whole runs of both versions, and folders in which commands are run."""

    def __init__(self, folder):
        self.folder = folder
        self.out, self.base = folder / "out", folder / "base"
        for version, distance in VERSIONS.items():
            for name in NAMES:
                scenes.write(folder / "in" / version, name, distance=distance, duration=0.2)
            solid = primitives.sphere(0.1 * distance, 0.02)
            mesh = trimesh.Trimesh(**trimesh.triangles.to_kwargs(solid.triangles))
            (folder / "in" / version / "ball.stl").write_bytes(mesh.export(file_type="stl"))
            path = folder / "in" / version / "a.yaml"
            ball = "  ball: {pose: {xyz: [0, 3, 0]}, shapes: {ball: {type: mesh, file: ball.stl, scale: 1}}}\n"
            path.write_text(path.read_text().replace("links:\n", f"links:\n{ball}"))
            whole = folder / "whole" / version
            run_all(load_all([folder / "in" / version]), whole, rrd=False, execution=Execution(workers=2))
            accept = ["accept", str(whole), "--baseline", str(folder / "slim" / version), "--yes", "--reason", version]
            assert run(accept) is ExitCode.FINE
        self.recordings = self._recordings("whole")
        self.slim = self._recordings("slim")

    def _recordings(self, kind):
        places = {(v, name): self.folder / kind / v / name / f"{name}.mcap" for v in VERSIONS for name in NAMES}
        return {key: place.read_bytes() for key, place in places.items()}

    def arguments(self, kind, version, *more):
        """Return the command line of a kind of command."""
        scenarios = str(self.folder / "in" / version)
        into = ["-o", str(self.out), "--workers", "1", *more]
        match kind.split():
            case ["run", how]:
                return ["run", scenarios, "--no-rrd", f"--{how}", *into]
            case ["regress", *how]:
                resume = [f"--{one}" for one in how]
                return ["regress", scenarios, "--baseline", str(self.base), "--rrd", "none", *resume, *into]
            case ["accept"]:
                whole = str(self.folder / "whole" / version)
                return ["accept", whole, "--baseline", str(self.base), "--yes", "--reason", version]
            case ["accept", "out"]:
                return ["accept", str(self.out), "--baseline", str(self.base), "--yes", "--reason", "out"]
            case ["diff"]:
                return ["diff", str(self.folder / "whole" / version), str(self.out)]
        raise AssertionError(kind)

    def start(self, kind, version, *more):
        """Begin a command; the process remembers what it was."""
        environment = {**os.environ, "PYTHONPATH": str(ROOT)}
        command = [sys.executable, "-m", "replay", *self.arguments(kind, version, *more)]
        began = time.time()
        process = subprocess.Popen(
            command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
        )
        process.replay = kind, version, began
        return process

    def end(self, process):
        """Wait for a command, and for all that it has started."""
        family = children(process.pid)
        _, said = process.communicate(timeout=300)
        _, alive = psutil.wait_procs(family, timeout=20.0)
        assert not alive
        kind, version, began = process.replay
        return Ended(kind, version, process.returncode, said, began)

    def strike(self, process, number, whom, rng):
        """Send a signal to a command, or to one of its workers if it has any: children of it, or of `whom`."""
        target = process.pid
        if whom != "command":
            parents = [process.pid] if whom == "worker" else whom
            family = [child for parent in parents for child in children(parent)]
            if not family:
                return
            target = rng.choice(family).pid
        with contextlib.suppress(ProcessLookupError):
            os.kill(target, number)

    def check(self, *ended):
        """Check all that must hold after commands have ended, whichever way."""
        for one in ended:
            assert "Traceback" not in one.said and "fault of replay" not in one.said, one
            assert one.code in (0, 1, 2, 4, 130, -signal.SIGKILL, -signal.SIGTERM), one
        with claim(self.out), claim(self.base):  # nobody holds them any more
            self._check_runs(ended)
            self._check_baselines()

    def _check_runs(self, ended):
        versions = {}
        for name in NAMES:
            file = self.out / name / f"{name}.mcap"
            if file.exists():
                data = file.read_bytes()
                found = [v for v in VERSIONS if data == self.recordings[v, name]]
                assert found, f"{file} is of no version"
                versions[name] = found[0]
        report = self.out / "run.json"
        if not report.exists():
            return
        summary = json.loads(report.read_text())
        entries = summary["scenarios"]
        for name, entry in entries.items():
            told = self.out / name / "result.json"
            if told.exists():
                assert json.loads(told.read_text())["status"] in ("passed", "crashed", "failed", "broken")
            if entry["status"] == "passed":
                assert name in versions, f"{name} passed and has no recording"
            elif entry["status"] == "interrupted":
                assert summary["interrupted"] is True
                fresh = told.exists() and told.stat().st_mtime > max(one.began for one in ended)
                killed = any(one.code == -signal.SIGKILL for one in ended)
                assert not fresh or killed, f"{name} has ended and is called interrupted"
                assert not fresh or entry["error"] == "it had not ended when this was written"
            else:
                assert name not in versions, f"{name} {entry['status']} and has a recording"
        passed = {versions[name] for name, entry in entries.items() if entry["status"] == "passed"}
        assert len(passed) <= 1, f"recordings of several versions in one run: {versions}"
        if "verdicts" in summary:
            self._check_reports(summary, entries)

    def _check_reports(self, summary, entries):
        for name, verdict in summary["verdicts"].items():
            status = entries[name]["status"]
            if status != "passed":
                assert verdict["verdict"] == status
            else:
                assert verdict["verdict"] in ("same", "different", "missing baseline", "interrupted")

    def _check_baselines(self):
        baseline = Baseline(self.base)
        for name in baseline.names():
            data = baseline.recording(name).read_bytes()
            assert data in [self.slim[v, name] for v in VERSIONS], f"the baseline of {name} is of no version"
            attached_files(baseline.recording(name))
        log = self.base / "accepted.jsonl"
        told = (
            {name for line in log.read_text().splitlines() for name in json.loads(line)["scenarios"]}
            if log.exists()
            else set()
        )
        assert set(baseline.names()) <= told

    def settle(self, version):
        """Carry everything on to its end: nothing that happened before can be seen any more."""
        for kind, codes in (("accept", (0,)), ("regress resume", (0,)), ("regress", (0,))):
            ended = self.end(self.start(kind, version))
            assert ended.code in codes, ended
            self.check(ended)
        summary = json.loads((self.out / "run.json").read_text())
        assert summary["interrupted"] is False
        assert {name: entry["verdict"] for name, entry in summary["verdicts"].items()} == dict.fromkeys(NAMES, "same")
        for name in NAMES:
            assert (self.out / name / f"{name}.mcap").read_bytes() == self.recordings[version, name]
            assert (self.base / name / f"{name}.mcap").read_bytes() == self.slim[version, name]
        assert not [file for place in (self.out, self.base) for file in place.rglob("*.part")]
        assert not [file for place in (self.out, self.base) for file in place.glob(".*")]
        assert len(list((self.base / "objects").iterdir())) == 1
