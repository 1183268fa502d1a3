"""Pictures of `view --screenshot` and `regress --pictures`, rendered by the driver that `make system` installs."""

from __future__ import annotations

import math

import numpy as np
import pytest
from PIL import Image

from replay.cli.exit_codes import ExitCode
from replay.cli.main import run
from tests.batch import scenes

TEXT = """
version: 1
name: cubes
rate: 10 Hz
duration: 2 s
links:
  middle: {shapes: {cube: {type: cube, size: 40 cm, color: "#ff0000"}}}
  slide:
    joint: {type: prismatic, axis: [0, 1, 0], lower: -2, upper: 2}
    shapes: {cube: {type: cube, size: 20 cm, color: "#0000ff"}}
motion: {points: {slide: [{time: 0, position: 0.8}, {time: 2, position: -0.8}]}}
"""
HALF_VIEW = math.tan(math.radians(55.0) / 2.0)
"""The viewer's field of view."""


@pytest.fixture(scope="module")
def cubes(tmp_path_factory):
    folder = tmp_path_factory.mktemp("cubes")
    (folder / "cubes.yaml").write_text(TEXT)
    assert run(["run", str(folder / "cubes.yaml"), "-o", str(folder)]) is ExitCode.FINE
    return folder / "cubes" / "cubes.mcap"


def seen(png, share=1.0):
    """Return a picture's size, and (column, row, width, height) of red and blue in the left share of it."""
    with Image.open(png) as image:
        pixels = np.asarray(image.convert("RGB")).astype(int)
    found, scene = {}, pixels[:, : round(share * pixels.shape[1])]
    for channel, name in ((0, "red"), (2, "blue")):
        others = np.delete(scene, channel, axis=2).max(axis=2)
        rows, columns = np.nonzero(scene[..., channel] > 60 + 2 * others)
        assert len(rows), f"nothing {name} in {png}"
        box = [(values.min(), values.max() + 1) for values in (columns, rows)]
        found[name] = (*(sum(ends) / 2 for ends in box), *(last - first for first, last in box))
    return pixels.shape[1::-1], found


def test_the_scene_alone_from_where_the_camera_stands(cubes, tmp_path):
    png = tmp_path / "from_the_front.png"
    options = ["--camera", "3,0,0,0,0,0", "--at", "0", "--size", "640x480", "--scene-only"]
    assert run(["view", str(cubes), "--screenshot", str(png), *options]) is ExitCode.FINE
    (width, height), found = seen(png)
    assert 600 < width <= 640 and 340 < height <= 480, "all of the window but its borders"
    pixels = height / 2 / HALF_VIEW  # a metre in a distance of one
    column, row, across, high = found["red"]
    assert (column, row) == pytest.approx((width / 2, height / 2), abs=3)
    assert (across, high) == pytest.approx((0.4 / 2.8 * pixels,) * 2, rel=0.05)
    assert found["blue"][0] - width / 2 == pytest.approx(0.8 / 3.0 * pixels, rel=0.06), "y is to the right from there"


def test_the_whole_window_from_behind_at_the_end(cubes, tmp_path):
    png = tmp_path / "from_behind.png"
    options = ["--camera", "-3,0,0,0,0,0", "--size", "900x600"]
    assert run(["view", str(cubes), "--screenshot", str(png), *options]) is ExitCode.FINE
    size, found = seen(png, share=0.6)  # charts and tables are on the right
    assert size == (900, 600)
    assert found["red"][0] == pytest.approx(270, abs=3)
    assert found["blue"][0] > found["red"][0] + 30, "at the end it is where y is negative: from behind, on the right"


def test_a_night_shows_the_worst_moment_of_both_runs(tmp_path):
    for name, distance in (("same", 1.2), ("differs", 1.2)):
        scenes.write(tmp_path / "in", name, distance=distance)
    night = ["regress", str(tmp_path / "in"), "--baseline", str(tmp_path / "base"), "-o", str(tmp_path / "out")]
    assert run([*night, "--missing-baseline", "create", "--rrd", "none"]) is ExitCode.FINE
    scenes.write(tmp_path / "in", "differs", distance=1.6)
    assert run([*night, "--pictures", "2"]) is ExitCode.DIFFERENT
    assert [path.parent.name for path in (tmp_path / "out").glob("*/worst.png")] == ["differs"]
    with Image.open(tmp_path / "out" / "differs" / "worst.png") as image:
        assert image.size == (1200, 600)
        pixels = np.asarray(image.convert("RGB")).astype(int)[80:560]  # without the names above, the time line below
    warmth = pixels[..., 0] - pixels[..., 2]
    assert (warmth[:, 10:590] < -50).mean() > 0.1, "the baseline, in blue, is on the left"
    assert (warmth[:, 610:1190] > 50).mean() > 0.1, "the candidate, in orange, is on the right"
    assert (warmth[:, 10:590] < 50).all()
    assert (warmth[:, 610:1190] > -50).all()
    assert run([*night, "--rrd", "none"]) is ExitCode.DIFFERENT
    assert not list((tmp_path / "out").glob("*/worst.png")), "those of the night before are gone"
