"""A recording that is looked at otherwise: what it holds stays."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from replay.errors import ViewerError
from replay.recording.rearranged import write_rearranged
from replay.recording.rerun_file import RerunFile
from tests.recording.test_side_by_side import contents, eyes, write


@pytest.mark.parametrize("alone", [False, True])
def test_all_is_copied_and_the_scene_is_looked_at_from_where_it_is_told(tmp_path: Path, alone: bool) -> None:
    file, target = write(tmp_path / "moving.rrd", 20), tmp_path / "other.rrd"
    view = write_rearranged(file, target, camera=((3.0, 2.0, 1.0), (0.0, 0.5, 0.0)), only_scene=alone)
    assert (view is not None) == alone  # of several views nobody asks for one
    assert repr(contents(target)) == repr(contents(file))
    np.testing.assert_allclose(eyes(target)[0], [(3.0, 2.0, 1.0), (0.0, 0.5, 0.0)], rtol=0, atol=1e-6)
    write_rearranged(file, tmp_path / "from.rrd", camera=((3.0, 2.0, 1.0), None), only_scene=alone)
    np.testing.assert_allclose(eyes(tmp_path / "from.rrd")[0], [(3.0, 2.0, 1.0), eyes(file)[0, 1]], rtol=0, atol=1e-6)
    write_rearranged(file, tmp_path / "same.rrd", camera=None, only_scene=alone)
    np.testing.assert_allclose(eyes(tmp_path / "same.rrd")[0], eyes(file)[0], rtol=0, atol=1e-6)


def test_what_is_no_recording_of_ours_leaves_nothing_behind(tmp_path: Path) -> None:
    other = RerunFile(tmp_path / "other.rrd", overwrite=True)
    other.open("somebody's")
    other.commit()
    with pytest.raises(ViewerError, match="is it a recording of replay"):
        write_rearranged(tmp_path / "other.rrd", tmp_path / "target.rrd", camera=None, only_scene=True)
    assert [path.name for path in tmp_path.iterdir()] == ["other.rrd"]
