"""A scenario to its recordings, in one run."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from replay.errors import RecordingExistsError
from replay.logs.part_file import write_error
from replay.recording.behind import WriteBehind, Writer
from replay.recording.provenance import describe
from replay.recording.recorded_paths import RecordedPaths
from replay.recording.scene_view import view
from replay.recording.writer import McapWriter
from replay.simulation import FrameBlock, Simulation

if TYPE_CHECKING:
    from replay.scenario.methods import Model
    from replay.scenario.model import Scenario
    from replay.scenario.scene import Scene

Progress = Callable[[int, int], None]
"""Called with the number of frames computed and the number of all frames."""


def record(
    scenario: Scenario,
    directory: str | Path,
    *,
    model: Model | str | Path | None = None,
    savings: bool = True,
    rrd: bool = True,
    overwrite: bool = False,
    progress: Progress | None = None,
) -> RecordedPaths:
    """Simulate a scenario and record it as DIRECTORY/NAME.mcap and DIRECTORY/NAME.rrd.

    Args:
        scenario: what `load` returned.
        directory: made when it is not there.
        model: replaces the scenario's own model; a built-in model's name, or a file that holds one, will do.
        savings: see `simulate`; the recording says when they were off.
        rrd: whether to make a rerun recording too.
        overwrite: replace recordings that exist; they stay when the run fails. Without `rrd`, an old rerun recording is
            removed: it shows another run.
        progress: called after each block.

    Raises:
        RecordingExistsError: a recording exists, of either kind, and may not be overwritten.
        WriteError: a file cannot be written.
        ReplayError: whatever the simulation raises; no file is left then.
    """
    from replay.scenario.scene import build

    scene = build(scenario, model=model, savings=savings)
    return record_blocks(scene, Simulation(scene).blocks(), directory, rrd=rrd, overwrite=overwrite, progress=progress)


def record_blocks(
    scene: Scene,
    blocks: Iterable[FrameBlock],
    directory: str | Path,
    *,
    rrd: bool = True,
    overwrite: bool = False,
    progress: Progress | None = None,
) -> RecordedPaths:
    """Record blocks of a scene, however they were computed; arguments and errors as of `record`."""
    scenario = scene.scenario
    provenance = describe(
        scenario.name,
        scenario.main_source,
        scenario.sources,
        frames=scene.frames,
        layout=scene.layout,
        model=scene.model.identity(savings=scene.savings),
        originals=scenario.provenance.originals,
    )
    shown = view(scene)
    shown_in = Path(directory) / f"{scenario.name}.rrd"
    if shown_in.exists() and not overwrite:
        raise RecordingExistsError(str(shown_in))
    paths = RecordedPaths(mcap=Path(directory) / f"{scenario.name}.mcap", rrd=shown_in if rrd else None)
    if rrd:  # before any file is made: loading rerun takes a second, in which a run may be interrupted
        from replay.recording.rerun_log import RerunWriter
    writers: list[Writer] = []  # the log of record is the last to be closed: where it is, all is
    try:
        writers.append(McapWriter(paths.mcap, provenance, shown, scenario.sources, overwrite=overwrite))
        if paths.rrd is not None:
            writers.insert(0, RerunWriter(paths.rrd, scene.layout, shown, overwrite=overwrite))
        with WriteBehind(writers, threaded=scene.frames > provenance.block_frames) as behind:
            done = 0
            for block in blocks:
                behind.put(block)
                done += len(block.time)
                if progress is not None:
                    progress(done, scene.frames)
    except BaseException:  # an interruption may come before WriteBehind looks after its writers
        for writer in writers:
            writer.discard()
        raise
    if not rrd:
        try:
            shown_in.unlink(missing_ok=True)
        except OSError as error:
            raise write_error(shown_in, error) from None
    return paths
