"""Dask clusters on this machine, as processes of their own, and certificates for them."""

import contextlib
import json
import os
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import psutil

ROOT = Path(__file__).parents[2]


@dataclass(frozen=True)
class Cluster:
    """Processes of a cluster; `folder` is where its workers keep what they need."""

    address: str
    scheduler: subprocess.Popen
    workers: list
    folder: Path


@contextlib.contextmanager
def cluster(folder, *options, workers=2, **environment):
    """Start a scheduler and workers, with options of both, and end them with all that they have started."""
    found = folder / "scheduler.json"
    environment = {
        **os.environ,
        "PYTHONPATH": str(ROOT),
        "DASK_DISTRIBUTED__SCHEDULER__WORK_STEALING": "False",
        **environment,
    }
    quiet = {"cwd": folder, "env": environment, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}

    def dask(name, *more):
        command = [
            sys.executable,
            "-m",
            f"distributed.cli.dask_{name}",
            "--scheduler-file",
            str(found),
            *options,
            *more,
        ]
        return subprocess.Popen(command, **quiet)

    begun = [dask("scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard")]
    common = ("--nthreads", "1", "--no-nanny", "--no-dashboard", "--local-directory", str(folder))
    begun += [dask("worker", *common) for _ in range(workers)]
    try:
        while not found.is_file() or not found.read_text():
            time.sleep(0.1)
            assert begun[0].poll() is None
        yield Cluster(json.loads(found.read_text())["address"], begun[0], begun[1:], folder)
    finally:
        for process in reversed(begun):
            family = psutil.Process(process.pid).children(recursive=True) if process.poll() is None else []
            process.kill()
            process.wait()
            for member in family:
                with contextlib.suppress(psutil.NoSuchProcess):
                    member.kill()


def authority(folder, name):
    """Make an authority and a certificate that it has signed; return the paths of both, and of the second's key."""
    folder.mkdir(parents=True, exist_ok=True)

    def openssl(*arguments):
        subprocess.run(["openssl", *map(str, arguments)], check=True, capture_output=True, cwd=folder)

    own = {"ca": folder / "ca.pem", "cert": folder / "cert.pem", "key": folder / "key.pem"}
    made = ("req", "-newkey", "rsa:2048", "-nodes")
    openssl(*made, "-x509", "-days", 2, "-subj", f"/CN={name}", "-keyout", "ca.key", "-out", own["ca"])
    openssl(*made, "-subj", f"/CN=of {name}", "-keyout", own["key"], "-out", "request.pem")
    signed = ("x509", "-req", "-in", "request.pem", "-CA", own["ca"], "-CAkey", "ca.key", "-CAcreateserial")
    openssl(*signed, "-days", 2, "-out", own["cert"])
    return own
