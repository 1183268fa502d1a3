"""Several rerun recordings in one, each below its own name, so that one viewer shows them beside each other."""

from __future__ import annotations

import contextlib
import warnings
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from replay.errors import ViewerError
from replay.numerics.arrays import Floats
from replay.recording import blueprint
from replay.recording.own_folder import own_folder
from replay.recording.rerun_file import RerunFile

_EYE = ("EyeControls3D:position", "EyeControls3D:look_target")
_SOMEWHERE = np.array([3.0, -4.0, 3.0]), np.zeros(3)  # where recordings that are not ours are looked at from


def side_names(files: Sequence[Path]) -> list[str]:
    """Return a name for each file: that of the file, or of the folder in which paths that end alike differ."""
    names = [file.stem for file in files]
    parts = [file.absolute().parts for file in files]
    for places in zip(*parts, strict=False):
        if len(set(names)) == len(names):
            break
        if len(set(places)) == len(places):
            names = list(places)
    return names if len(set(names)) == len(names) else [f"{k + 1} {name}" for k, name in enumerate(names)]


@contextlib.contextmanager
def one_recording(files: Sequence[Path]) -> Iterator[Path]:
    """Give the file itself when it is one, else one that shows all of them and is gone afterwards.

    Raises:
        ViewerError: a file cannot be read; the viewer would show nothing, or what is left of it.
    """
    if len(files) == 1:
        with readable(files[0]) as reader:
            for _ in reader.stream():
                pass
        yield files[0]
        return
    with own_folder() as folder:
        target = folder / "side_by_side.rrd"
        write_side_by_side(files, target)
        yield target


def write_side_by_side(files: Sequence[Path], target: Path) -> None:
    """Write one recording that shows several.

    Args:
        files: `.rrd` files.
        target: the one to write.

    Raises:
        ViewerError: a file cannot be read.
        WriteError: the file cannot be written.
    """
    sides = side_names(files)
    result = RerunFile(target, overwrite=True)
    try:
        stream = result.open("replay: side by side")
        stream.send_recording_name(" | ".join(sides))
        found = Contents()
        for side, file in zip(sides, files, strict=True):
            with readable(file) as reader:
                found.look_from(reader)
                for chunk in reader.stream():
                    _copy(stream, chunk, side, found)
        eye = blueprint.eye_of_all(found.eyes or [_SOMEWHERE])
        result.arrange(blueprint.side_by_side(sides, sorted(found.charts), eye, found.end))
        result.commit()
    except BaseException:
        result.discard()
        raise


@contextlib.contextmanager
def readable(file: Path) -> Iterator[Any]:
    """Open a file to be read within; ViewerError when it is cut, damaged or no recording."""
    from rerun.chunk import RrdReader

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # a file that was cut has no footer, which the library only warns of
            reader = RrdReader(str(file))
        yield reader
    except Warning:
        raise ViewerError(f"{file}: cannot be read: it was cut, or is of an old format: it has no footer") from None
    except (RuntimeError, ValueError) as error:
        raise ViewerError(f"{file}: cannot be read: {str(error).splitlines()[0]}") from None


class Contents:
    """What the recordings have: charts, their end [ns], and from where to where each looks at its scene."""

    def __init__(self) -> None:
        self.charts: set[str] = set()
        self.end = 0
        self.eyes: list[tuple[Floats, Floats]] = []

    def look_from(self, reader: Any) -> None:
        """Take a recording's eye."""
        for store in reader.blueprints():
            for chunk in reader.stream(store=store):
                names = chunk.to_record_batch().schema.names
                if all(name in names for name in _EYE):
                    batch = chunk.to_record_batch()
                    eye, target = (np.array(batch.column(name).to_pylist()[-1][0]) for name in _EYE)
                    self.eyes.append((eye, target))

    def take(self, chunk: Any) -> None:
        """Take what a chunk of a recording has: curves of a chart, and times."""
        top = str(chunk.entity_path).split("/")[1]
        if top in blueprint.CHARTS:
            self.charts.add(top)
        batch = chunk.to_record_batch()
        if blueprint.TIMELINE in chunk.timeline_names and len(batch):
            times = batch.column(blueprint.TIMELINE).cast("int64").to_numpy(zero_copy_only=False)
            self.end = max(self.end, int(times.max()))


def _copy(stream: Any, chunk: Any, side: str, found: Contents) -> None:
    """Send a chunk below the name of its side."""
    import rerun as rr

    path = str(chunk.entity_path)
    if path.startswith("/__"):  # properties of the recording itself
        return
    stream.send_chunks(chunk.with_entity_path(f"{rr.new_entity_path([side])}{path}"))
    found.take(chunk)
