"""Rerun recordings read back: what is drawn, when, and in which colour."""

from __future__ import annotations

import dataclasses
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
from PIL import Image
from rerun.chunk import RrdReader

from replay.errors import RecordingExistsError, ViewerError
from replay.numerics import transforms
from replay.recording.blueprint import eye_of, eye_of_all
from replay.recording.picture import _cause, picture
from replay.recording.rerun_log import LEVEL_COLORS, RerunWriter
from replay.recording.rerun_scene import extent
from replay.recording.scene_view import BodyView, indexed
from replay.recording.surfaces import corner_normals
from replay.recording.viewer_process import viewer_binary
from tests.recording import moving
from tests.recording.synthetic import drawn

FRAMES = 300
Rows = dict[int, list[object]]


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    target = tmp_path_factory.mktemp("rerun") / "moving.rrd"
    writer = RerunWriter(target, moving.LAYOUT, moving.scene())
    for block in moving.blocks(FRAMES):
        writer.write(block)
    writer.commit()
    return target


@pytest.fixture(scope="module")
def logged(path: Path) -> dict[tuple[str, str], Rows]:
    return logged_in(path)


def logged_in(path: Path) -> dict[tuple[str, str], Rows]:
    """Return, for each entity and component, its values by frame; what does not change is at frame -1."""
    result: dict[tuple[str, str], Rows] = {}
    for chunk in RrdReader(str(path)).stream():
        batch = chunk.to_record_batch()
        names = batch.schema.names
        frames = batch.column(names.index("frame")).to_pylist() if "frame" in names else [-1] * batch.num_rows
        for name, column in zip(names, batch.columns, strict=True):
            if ":" in name and pa.types.is_list(column.type):
                rows = result.setdefault((str(chunk.entity_path), name.rpartition(":")[2]), {})
                rows.update(zip(frames, column.to_pylist(), strict=True))
    return result


def blocks_of(field: str, group: str) -> np.ndarray:
    return np.concatenate([getattr(getattr(block, group), field) for block in moving.blocks(FRAMES)])


def test_bodies_hang_on_moving_links(logged: dict[tuple[str, str], Rows]) -> None:
    heights = np.concatenate([block.joint_positions[:, 0] for block in moving.blocks(FRAMES)])
    moves = logged["/scene/head", "translation"]
    assert {frame: row[0][2] for frame, row in moves.items()} == {  # type: ignore[index]
        frame: pytest.approx(height, abs=1e-6) for frame, height in enumerate(heights.tolist())
    }
    assert list(logged["/scene/table", "translation"]) == [0], "a link that stands is placed once"
    positions = logged["/scene/table/body", "vertex_positions"][-1]
    assert np.allclose(np.array(positions).reshape(-1, 3, 3), moving.scene().bodies[2].triangles, atol=1e-6)


def test_bodies_are_coloured_by_their_worst_pair(logged: dict[tuple[str, str], Rows]) -> None:
    level = blocks_of("level", "collision")
    palette = {0: moving.scene().bodies[0].color, **LEVEL_COLORS}

    def packed(value: int) -> int:
        red, green, blue, alpha = palette[value]
        return red << 24 | green << 16 | blue << 8 | alpha

    for entity, worst in (("/scene/head/housing", level.max(axis=1)), ("/scene/table/top", level[:, 1])):
        rows = logged[entity, "albedo_factor"]
        changes = [0, *(np.flatnonzero(np.diff(worst)) + 1).tolist()]
        assert sorted(rows) == changes, entity
        if entity == "/scene/head/housing":
            assert [rows[k] for k in changes] == [[packed(int(worst[k]))] for k in changes]
            assert {int(worst[k]) for k in changes} == {0, 1, 2}
    assert list(logged["/scene/room/stand", "albedo_factor"]) == [-1], "a body in no pair keeps its colour"


def test_beams_are_drawn_while_something_is_seen(logged: dict[tuple[str, str], Rows]) -> None:
    seen = blocks_of("status", "distance")[:, 0] > 0
    strips = logged["/scene/closest_points/down", "strips"]
    for frame, strip in strips.items():
        assert bool(strip) == seen[frame]
    shown = np.array([bool(strips[max(k for k in strips if k <= frame)]) for frame in range(FRAMES)])
    assert np.array_equal(shown, seen) and 0 < seen.sum() < FRAMES
    some = next(frame for frame in strips if seen[frame])
    heights = np.concatenate([block.joint_positions[:, 0] for block in moving.blocks(FRAMES)])
    assert np.allclose(strips[some][0], [[0, 0, heights[some] - 0.1], [0, 0, 1.25]], atol=1e-6)  # type: ignore[index]


def test_curves_have_a_gap_where_there_is_no_value(logged: dict[tuple[str, str], Rows]) -> None:
    expected = blocks_of("clearance", "collision")[:, 0]
    entity = next(name for name, component in logged if name.startswith("/clearance/") and component == "scalars")
    curve = logged[entity, "scalars"]
    for frame, value in enumerate(expected):
        if not np.isnan(value):
            assert curve[frame] == [value]
    gaps = [frame for frame, value in curve.items() if np.isnan(value[0])]  # type: ignore[index]
    ends = np.flatnonzero(~np.isnan(expected[:-1]) & np.isnan(expected[1:])) + 1
    assert gaps == ends.tolist() != []
    texts = [row[0] for row in logged["/events", "text"].values()]  # type: ignore[index]
    assert any("contact begins: head/housing|table/body" in text for text in texts)
    assert "name: moving" in logged["/scenario", "text"][-1][0]  # type: ignore[index]


@pytest.mark.parametrize(
    ("present", "gaps"),
    [(range(250, 256), [256]), (range(256, 260), [260]), (range(200, 300), []), ([255, 257], [256, 258])],
)
def test_a_gap_may_begin_where_a_block_ends(tmp_path: Path, present: Sequence[int], gaps: list[int]) -> None:
    writer = RerunWriter(tmp_path / "gap.rrd", moving.LAYOUT, moving.scene())
    for block in moving.blocks(FRAMES):
        frames = block.first + np.arange(len(block.time))
        evaluated = np.stack([np.isin(frames, list(present)), np.zeros(len(frames), dtype=bool)], axis=1)
        clearance = np.where(evaluated, 0.25, np.nan)
        writer.write(
            dataclasses.replace(
                block, collision=dataclasses.replace(block.collision, evaluated=evaluated, clearance=clearance)
            )
        )
    writer.commit()
    curves = {
        name: rows for (name, component), rows in logged_in(tmp_path / "gap.rrd").items() if component == "scalars"
    }
    (curve,) = (rows for name, rows in curves.items() if name.startswith("/clearance/"))
    expected = {**dict.fromkeys(present, 0.25), **dict.fromkeys(gaps, None)}
    assert {k: None if np.isnan(row[0]) else row[0] for k, row in curve.items()} == expected  # type: ignore[index]


def test_an_existing_recording_stays(path: Path) -> None:
    with pytest.raises(RecordingExistsError):
        RerunWriter(path, moving.LAYOUT, moving.scene())


def test_normals_are_smooth_on_a_barrel_and_sharp_on_a_box() -> None:
    box = moving.box((1, 2, 3), (0, 0, 0))
    across = np.cross(box[:, 1] - box[:, 0], box[:, 2] - box[:, 0])
    face = across / np.linalg.norm(across, axis=1, keepdims=True)
    assert np.allclose(corner_normals(indexed([box])), face[:, None])
    barrel = moving.barrel(0.2, 1.0)
    normals = corner_normals(indexed([barrel]))
    side = np.abs(normals[..., 1]) < 0.5
    radial = barrel[..., [0, 2]] / 0.2
    assert np.allclose(normals[side][:, [0, 2]], radial[side], atol=np.pi / 32)  # half a segment


def test_normals_are_those_of_every_corner_against_every_other() -> None:
    rng = np.random.default_rng(3)
    fan = np.array(
        [[[0, 0, 1], [np.cos(a), np.sin(a), 0], [np.cos(a + 0.2), np.sin(a + 0.2), 0]] for a in np.arange(30)]
    )
    triangles = np.concatenate([rng.normal(size=(20, 3))[rng.integers(0, 20, size=(80, 3))], fan, np.zeros((1, 3, 3))])
    across = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    length = np.linalg.norm(across, axis=1)
    face = across / np.where(length > 0, length, 1.0)[:, None]
    expected = np.zeros_like(triangles)
    for here in np.ndindex(triangles.shape[:2]):
        for there in np.ndindex(triangles.shape[:2]):
            if here == there or ((triangles[here] == triangles[there]).all() and face[here[0]] @ face[there[0]] > 0.8):
                expected[here] += across[there[0]]
    length = np.linalg.norm(expected, axis=2)
    expected /= np.where(length > 0, length, 1.0)[..., None]
    assert np.allclose(corner_normals(indexed([triangles])), expected, atol=1e-12)  # sums in another order


def test_the_first_picture_shows_all_bodies_but_the_floor() -> None:
    scene = moving.scene()
    poses = next(moving.blocks(FRAMES)).link_poses[[0, 40, 80]]
    sheet = np.array([[[-9.0, -9, 0], [9, -9, 0], [9, 9, 0]]])
    floor = BodyView("room/floor", 1, sheet, (0, 0, 0, 255))
    nothing = BodyView("room/nothing", 1, np.zeros((0, 3, 3)), (0, 0, 0, 255))
    placed = [transforms.apply(T[body.link], body.triangles).reshape(-1, 3) for body in scene.bodies for T in poses]
    apexes = [(T[0] @ moving.CONE.T_link_sensor)[None, :3, 3] for T in poses]
    flat = np.array([[x, y, 0.0] for x in (-0.05, 0.05) for y in (-0.15, 0.15)])
    corners = [transforms.apply(T[0] @ moving.GUARD.plates[0].T_link_plate, flat) for T in poses]
    bare = dataclasses.replace(scene, sensors=())
    for view, bodies, points in (
        (scene, (floor, *scene.bodies, nothing), [*placed, *apexes, *corners]),
        (bare, (floor, *scene.bodies, nothing), placed),
        (scene, (nothing,), [*apexes, *corners]),
        (bare, (nothing, floor), [sheet.reshape(-1, 3)]),
        (bare, (nothing,), [np.array([[-1.0, -1, 0], [1, 1, 1]])]),
    ):
        shown, wanted = extent(dataclasses.replace(view, bodies=bodies), poses), np.concatenate(points)
        assert np.allclose([shown.min(axis=0), shown.max(axis=0)], [wanted.min(axis=0), wanted.max(axis=0)])


def test_one_eye_sees_what_several_see() -> None:
    def place(eye: Any) -> Any:
        return tuple(np.array(part.as_arrow_array().to_pylist()[0]) for part in (eye.position, eye.look_target))

    near, far = np.eye(3), np.eye(3) * 5.0 + [20.0, 0.0, 0.0]
    one, other, both = (place(eye_of(points)) for points in (near, far, np.concatenate([near, far])))
    assert np.allclose(place(eye_of_all([one, one])), one, atol=1e-6)
    eye, target = place(eye_of_all([one, other]))
    assert np.linalg.norm(eye - target) >= np.linalg.norm(both[0] - both[1])


@pytest.mark.parametrize("size", [(12.0, 0.2, 0.2), (0.2, 0.2, 8.0), (1.0, 2.0, 3.0), (0.3, 0.3, 0.01)])
def test_the_first_picture_is_filled_by_what_it_shows(size: tuple[float, float, float]) -> None:
    points = 5.0 + np.random.default_rng(7).uniform(-1.0, 1.0, (30, 3)) * size
    eye = eye_of(points)
    position, target = (part.as_arrow_array().to_pylist()[0] for part in (eye.position, eye.look_target))
    ahead = np.subtract(target, position)
    right = np.cross(ahead, [0.0, 0.0, 1.0])
    axes = np.stack([right, np.cross(right, ahead), ahead])
    seen = (points - position) @ (axes / np.linalg.norm(axes, axis=1, keepdims=True)).T
    edge = np.tan(np.radians(55.0 / 2))  # the viewer's field of view
    filled = np.abs(seen[:, :2] / seen[:, 2:]).max() / edge
    assert (seen[:, 2] > 0.0).all() and 0.75 < filled < 0.95


def test_cones_have_their_aperture_and_range() -> None:
    cone = moving.CONE
    apex = cone.T_link_sensor[:3, 3]
    axis = cone.T_link_sensor[:3, 2]
    ends = np.concatenate([strip[-1:] for strip in drawn("distance", cone).drawing.strips]) - apex
    assert np.allclose(np.linalg.norm(ends, axis=1), cone.range)
    assert np.allclose(np.arccos(ends @ axis / cone.range), cone.aperture / 2)


@pytest.mark.skipif(not list(Path("/usr/share/vulkan/icd.d").glob("*.json")), reason="needs a Vulkan driver")
def test_the_viewer_shows_contact_in_red(path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))  # what the viewer is given stands there
    named = tmp_path / "検査 ∕ 😀.rrd"  # the viewer's font has none of these letters
    named.write_bytes(path.read_bytes())
    with pytest.raises(ViewerError, match="has no moment 99 s; it ends at "):
        picture(named, tmp_path / "late.png", at=99.0)
    picture(named, tmp_path / "contact.png", at=2.5, size=(1000, 700))
    with Image.open(tmp_path / "contact.png") as image:
        pixels = np.asarray(image.convert("RGB")).astype(int)
    scene = pixels[:, : pixels.shape[1] // 2]
    red = (scene[..., 0] > 120) & (scene[..., 1] < 70) & (scene[..., 2] < 70)
    assert red.mean() > 0.01
    running = subprocess.run(["ps", "-eo", "args"], capture_output=True, text=True, check=True).stdout
    assert str(tmp_path) not in running, "the viewer must not outlive the picture"


def test_pictures_of_nothing_are_refused(tmp_path: Path) -> None:
    assert viewer_binary().is_file()
    with pytest.raises(ViewerError, match="no such file"):
        picture(tmp_path / "none.rrd", tmp_path / "none.png")


@pytest.mark.parametrize(
    ("log", "cause"),
    [
        (
            "wgpu adapter backend: Vulkan\nthread 'main' panicked at 'No glyph for \"検\" (U+691C) in Proportional.",
            'its font has no letter "検" (U+691C), which is in a name or a text that it shows',
        ),
        ("Error: Failed to find a graphics adapter", "it found no Vulkan driver"),
        ("thread 'main' panicked at 'Failed to get render context'", "it found no Vulkan driver"),
        ("INFO wgpu adapter backend: Vulkan\nthread 'main' panicked at 'x'\nstack backtrace:", "panicked at 'x'"),
        ("", "no message"),
    ],
)
def test_a_viewer_that_stops_says_why(log: str, cause: str) -> None:
    assert cause in _cause(log)
