"""What workers do in tests: tasks that behave, and tasks that do not."""

import os
import signal
import subprocess
import sys
import time
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
            eaten = []
            while True:
                eaten.append(b"x" * (10 << 20))
                time.sleep(0.01)
        case "pid":
            return os.getpid()
        case "when":
            Path(value).open("a").close()
            return time.monotonic()
    raise AssertionError(what)


def slow_start(tell):
    """Prepare for longer than the tests' time limits."""
    tell("preparing")
    time.sleep(1.0)
