"""Where worker processes look for modules."""

from __future__ import annotations

import contextlib
import os
import sys
from pathlib import Path


def import_path(module: str) -> list[str]:
    """Return where workers look for modules: where this process does, but for the current folder.

    Whatever lies in the folder that a command is called in, such as a json.py, is none of its business. The folder that
    this package, or the module of the work, has been imported from stays, as for a checkout that is the current folder.
    """
    homes: set[str] = set()
    for name in ("replay", module):
        package = sys.modules[name.partition(".")[0]]
        places = getattr(package, "__path__", None) or [getattr(package, "__file__", None)]
        homes.update(os.path.realpath(Path(place).parent) for place in places if place)
    with contextlib.suppress(OSError):  # the current folder may be gone
        here = os.path.realpath(Path.cwd())
        found = [here if folder == "" else folder for folder in sys.path]
        return [folder for folder in found if os.path.realpath(folder) != here or here in homes]
    return [folder for folder in sys.path if folder]
