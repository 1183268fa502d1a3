"""Scenes that are hard to get right: each is read rightly, beside the same thing said simply or the reference."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import replay
from replay.errors import ReplayError
from replay.sensing.capacitive.columns import CapacitiveColumns

Floats = NDArray[np.float64]

CLOSE = 1e-2
"""Two meshes of one surface, as `field` cuts them."""

SCENE = """
version: 1
name: hard
rate: 10 Hz
duration: 0 s
links:
  unit:
    pose: {{rpy: {turn}}}
    shapes: {{panel: {{type: cuboid, size: [{a} cm, {b} cm, {c} cm], pose: {{xyz: [0, 0, {d} cm]}}}}}}
  {links}
sensors:
  capacitive:
    {sensors}
model: {{capacitive: {{method: {method}}}}}
"""


def read(
    folder: Path, links: str, *, method: str = "field", scale: float = 1.0, turn: str = "[0, 0, 0]", sensors: str = ""
) -> CapacitiveColumns:
    """Read two plates over a panel before links, all of them children of the unit."""
    size = f"size: [{5 * scale} cm, {6 * scale} cm]"
    own = "\n    ".join(
        f"{name}: {{link: unit, back: [panel], coupling: 10 pF, "
        f"plates: {{p: {{{size}, pose: {{xyz: [{x * scale} cm, 0, 0]}}}}}}}}"
        for name, x in (("left", -4.0), ("right", 4.0))
    )
    path = folder / "hard.yaml"
    numbers = dict(zip("abcd", (scale * x for x in (16.0, 10.0, 4.0, -2.8)), strict=True))
    path.write_text(SCENE.format(links=links, method=method, turn=turn, sensors=sensors or own, **numbers))
    (block,) = replay.simulate(replay.load(path))
    found: CapacitiveColumns = block.capacitive
    assert found.increase is not None and found.unresolved is not None
    return found


def increase(folder: Path, shapes: str, *, earth: str = "grounded", **given: object) -> Floats:
    """Return the increases [pF] by one body."""
    found = read(folder, f"body: {{parent: unit, earth: {earth}, shapes: {{{shapes}}}}}", **given)  # type: ignore[arg-type]
    assert found.increase is not None and found.unresolved is not None
    assert not (found.saturated | found.unresolved).any() and (found.increase > 0.0).all()
    return np.asarray(1e12 * found.increase[0])


def cuboid(name: str, x: float, y: float, z: float, *size: float) -> str:
    lengths = ", ".join(f"{length} cm" for length in size)
    return f"{name}: {{type: cuboid, size: [{lengths}], pose: {{xyz: [{x} cm, {y} cm, {z} cm]}}}}"


BOX = cuboid("box", 2, 0, 5, 10, 8, 6)


def box_triangles(x: float, y: float, z: float, *size: float) -> Floats:
    from replay.geometry import primitives

    return np.asarray(primitives.cuboid(size).triangles + np.array([x, y, z]))


def mesh(folder: Path, triangles: Floats) -> str:
    """Write an STL file, in metres, and return the shape."""
    rows = ["solid made"]
    for triangle in triangles:
        rows += ["facet normal 0 0 0", "outer loop", *(f"vertex {a:.9g} {b:.9g} {c:.9g}" for a, b, c in triangle)]
        rows += ["endloop", "endfacet"]
    (folder / "made.stl").write_text("\n".join([*rows, "endsolid made"]))
    return "made: {type: mesh, file: made.stl, scale: 1}"


def test_a_mesh_that_is_open_turned_inside_out_doubled_or_has_slivers(tmp_path: Path) -> None:
    plain = increase(tmp_path, BOX)
    box = box_triangles(0.02, 0.0, 0.05, 0.10, 0.08, 0.06)
    top = box[:, :, 2].min(axis=1) > 0.0799
    corners = box[~top][0]
    middle = 0.5 * (corners[0] + corners[1]) + 1e-13
    sliver = np.stack([corners[0], corners[1], middle])[None]
    for name, triangles in (
        ("open", box[~top]),
        ("inside out", box[:, ::-1]),
        ("doubled", np.concatenate([box, box[:, ::-1], box[:, [1, 2, 0]]])),
        ("slivers", np.concatenate([box, sliver])),
    ):
        assert increase(tmp_path, mesh(tmp_path, triangles)) == pytest.approx(plain, rel=CLOSE), name


def test_shapes_that_overlap_are_what_is_around_them(tmp_path: Path) -> None:
    plain = increase(tmp_path, BOX)
    parts = ", ".join([cuboid("a", 0, 0, 5, 6, 8, 6), cuboid("b", 3, 0, 5, 8, 8, 6), cuboid("c", 2, 0, 5.5, 3, 3, 3)])
    assert increase(tmp_path, parts) == pytest.approx(plain, rel=3 * CLOSE)
    assert increase(tmp_path, parts, earth="floating") == pytest.approx(
        increase(tmp_path, BOX, earth="floating"), rel=3 * CLOSE
    )


def test_a_thin_sheet_is_a_plane(tmp_path: Path) -> None:
    plane = "plane: {type: plane, size: [10 cm, 8 cm], pose: {xyz: [2 cm, 0, 3 cm]}}"
    for thickness in (0.01, 0.001):
        sheet = increase(tmp_path, cuboid("sheet", 2, 0, 3 + thickness / 2, 10, 8, thickness))
        assert sheet == pytest.approx(increase(tmp_path, plane), rel=3 * CLOSE)


def test_a_body_on_both_sides_of_the_unit(tmp_path: Path) -> None:
    sides = ", ".join([cuboid("front", 2, 0, 3, 10, 8, 2), cuboid("behind", 0, 0, -8, 20, 14, 2)])
    found = increase(tmp_path, sides)
    assert found == pytest.approx(increase(tmp_path, sides, method="bem"), rel=3.5e-2)
    assert (found >= increase(tmp_path, cuboid("front", 2, 0, 3, 10, 8, 2)) * (1.0 - CLOSE)).all()


def test_a_scene_that_is_turned_as_a_whole_reads_the_same(tmp_path: Path) -> None:
    turned = increase(tmp_path, BOX, turn="[20 deg, -50 deg, 100 deg]")
    assert turned == pytest.approx(increase(tmp_path, BOX), rel=1e-6)


@pytest.mark.parametrize("scale", [0.25, 10.0])
def test_capacitances_are_as_large_as_the_scene(tmp_path: Path, scale: float) -> None:
    """A gap of 2 cm is one of 5 mm, and of 20 cm."""
    scaled = cuboid("box", *(scale * x for x in (2, 0, 5, 10, 8, 6)))
    assert increase(tmp_path, scaled, scale=scale) == pytest.approx(scale * increase(tmp_path, BOX), rel=2 * CLOSE)


def test_a_tenth_of_the_scene_is_not_resolved_below_3_mm(tmp_path: Path) -> None:
    scaled = cuboid("box", *(0.1 * x for x in (2, 0, 5, 10, 8, 6)))
    found = read(tmp_path, f"body: {{parent: unit, shapes: {{{scaled}}}}}", scale=0.1)
    assert found.unresolved is not None and found.unresolved.all() and found.error is not None
    assert np.isnan(found.error).all() and np.isfinite(found.capacitance).all()


def test_thirty_sensors_read_a_body_before_their_middle_alike_on_both_sides(tmp_path: Path) -> None:
    own = [
        f"s{i}_{j}: {{link: unit, coupling: 10 pF, plates: {{p: {{size: [2 cm, 1.5 cm], "
        f"pose: {{xyz: [{2.6 * i - 6.5} cm, {2 * j - 4} cm, 0]}}}}}}}}"
        for i in range(6)
        for j in range(5)
    ]
    found = read(
        tmp_path, f"body: {{parent: unit, shapes: {{{cuboid('box', 0, 0, 4, 6, 6, 3)}}}}}", sensors="\n    ".join(own)
    )
    assert found.increase is not None
    map_ = found.increase[0].reshape(6, 5)
    large = map_ > 0.1 * map_.max()
    assert np.abs(map_ / map_[::-1] - 1.0)[large].max() < 3.5e-2
    assert np.abs(map_ / map_[:, ::-1] - 1.0)[large].max() < 3.5e-2
    assert found.increase[0].argmax() in (12, 17)


def test_to_a_unit_another_is_a_body_whose_plates_are_not_there(tmp_path: Path) -> None:
    other = (
        "other: {parent: unit, pose: {xyz: [2 cm, 0, 5 cm]}, shapes: {box: {type: cuboid, size: [10 cm, 8 cm, 6 cm]}}}"
    )
    sensor = (
        "{name}: {{link: {link}, coupling: 10 pF, plates: {{p: {{size: [4 cm, 4 cm], pose: {{xyz: [0, 0, {z}]}}}}}}}}"
    )
    one = sensor.format(name="a", link="unit", z="5 mm")
    both = one + "\n    " + sensor.format(name="b", link="other", z="15 mm")
    alone, found = (read(tmp_path, other, sensors=text) for text in (one, both))
    assert alone.increase is not None and found.increase is not None
    assert found.increase[0, 0] == alone.increase[0, 0] and found.increase[0, 1] > 0.0


def test_a_body_without_area_is_refused_in_one_line(tmp_path: Path) -> None:
    flat = mesh(tmp_path, np.array([[[0.0, 0, 0.1], [0.1, 0, 0.1], [0.05, 0, 0.1]]]))
    with pytest.raises(ReplayError) as told:
        increase(tmp_path, flat)
    assert "\n" not in str(told.value)
