"""What workers do in tests: tasks that behave, and tasks that do not."""

import os
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path


def behave(payload, follow):
    """Do what the payload says: (what, value)."""
    what, value = payload
    print(f"doing {what}")
    match what:
        case "return":
            follow(1, 1)
            return value
        case "raise":
            raise ValueError(value)
        case "exit":
            os._exit(value)
        case "segfault":
            os.kill(os.getpid(), signal.SIGSEGV)
        case "hang":
            time.sleep(3600)
        case "hang with a child":
            child = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(3600)"])
            Path(value).write_text(str(child.pid))
            time.sleep(3600)
        case "leave a child":
            child = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(3600)"])
            Path(value).write_text(str(child.pid))
            os._exit(3)
        case "eat":
            eaten = b"x" * (400 << 20)
            time.sleep(3600)
            del eaten
        case "eat for a moment":
            eaten = b"x" * (400 << 20)
            del eaten
            return "done"
        case "pid":
            return os.getpid()
    raise AssertionError(what)


@dataclass(frozen=True)
class PrepareTogether:
    """A preparation that is over when two workers are at it."""

    folder: Path

    def __call__(self, messages):
        messages.share()
        (self.folder / str(os.getpid())).touch()
        messages.progress("waiting")
        while len(list(self.folder.iterdir())) < 2:
            time.sleep(0.01)


def slow_start(messages):
    """Prepare for longer than the tests' time limits."""
    messages.tell("preparing")
    time.sleep(1.0)


def eat_and_forget_nothing(messages):
    """Take much memory for a moment, on a system that cannot begin to measure anew."""
    from replay.batch import memory

    memory._REFERENCES = Path("/proc/none/clear_refs")
    eaten = b"x" * (400 << 20)
    del eaten
