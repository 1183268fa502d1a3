"""Record-and-replay batch service for mechanical systems: collisions and proximity sensors, frame by frame.

The names below are the public interface. They are resolved on first use, so that `import replay` costs nothing:
numba, rerun, trimesh and scipy load only when something needs them.
"""

import os
import sys

if sys.argv[:1] == ["-m"] and not sys.flags.safe_path:
    # `python -m replay` looks for modules in the current folder first; a typing.py that lies there is none of Python's.
    # So nothing is imported above but what Python itself has imported by now, not even from __future__.
    try:
        if sys.path[0] == os.getcwd() != os.path.dirname(__path__[0]):  # noqa: PTH109, PTH120
            del sys.path[0]
    except OSError:  # the current folder is gone, and so on no path
        pass

import importlib
import importlib.util
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from replay.comparison.runs import diff as diff
    from replay.recording.reader import read as read
    from replay.recording.record import record as record
    from replay.scenario.load import load as load
    from replay.simulation import FrameBlock as FrameBlock
    from replay.simulation import simulate as simulate

__version__ = "0.1.0"

_PUBLIC = {
    "load": "replay.scenario.load",
    "simulate": "replay.simulation",
    "FrameBlock": "replay.simulation",
    "record": "replay.recording.record",
    "read": "replay.recording.reader",
    "Recording": "replay.recording.reader",
    "diff": "replay.comparison.runs",
    "Difference": "replay.comparison.difference",
}
_ROOMS = (
    "errors",
    "numerics",
    "geometry",
    "kinematics",
    "collision",
    "sensing",
    "scenario",
    "recording",
    "simulation",
    "comparison",
)

__all__ = [*_PUBLIC, *_ROOMS]  # noqa: PLE0604


def submodules(package: str, **public: str) -> Callable[[str], Any]:
    """Return a package's `__getattr__` that imports its modules on first use: `replay.collision.gjk` just works.

    Args:
        package: its name.
        public: the module of each name that the package itself offers.
    """

    def resolve(name: str) -> Any:
        if name in public:
            return getattr(importlib.import_module(f"{package}.{public[name]}"), name)
        if not name.startswith("_") and importlib.util.find_spec(f"{package}.{name}"):
            return importlib.import_module(f"{package}.{name}")
        raise AttributeError(f"module {package!r} has no attribute {name!r}")

    return resolve


def __getattr__(name: str) -> Any:
    if name in _PUBLIC:
        return getattr(importlib.import_module(_PUBLIC[name]), name)
    if name in _ROOMS:
        return importlib.import_module(f"replay.{name}")
    raise AttributeError(f"module 'replay' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
