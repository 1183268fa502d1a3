"""Descriptions of public robots for the long versions: of packages that are installed, and of folders that are named.

None of the packages is needed. REPLAY_ROBOTS names folders, with : between them, of which all `*.urdf` are read.
"""

import importlib.metadata
import os
from pathlib import Path

PACKAGES = ("example-robot-data", "airo-models", "pybullet", "rtb-data")


def descriptions():
    """Return the files, the thousand blocks of pybullet left out."""
    found = []
    for package in PACKAGES:
        try:
            files = importlib.metadata.distribution(package).files or []
        except importlib.metadata.PackageNotFoundError:
            continue
        found += [Path(file.locate()) for file in files if file.suffix == ".urdf" and "random_urdfs" not in file.parts]
    for folder in filter(None, os.environ.get("REPLAY_ROBOTS", "").split(":")):
        found += [path for path in Path(folder).rglob("*.urdf") if "random_urdfs" not in path.parts and path.is_file()]
    return sorted(set(found))


def semantics(description):
    """Return the SRDF that comes with a description: beside it, or in a folder beside its own; None without one."""
    folders = (description.parent, description.parent.parent / "srdf", description.parent.parent / "config")
    files = (folder / f"{description.stem}.srdf" for folder in folders)
    return next((file for file in files if file.is_file()), None)
