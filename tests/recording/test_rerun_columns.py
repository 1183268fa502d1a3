"""Columns made straight from arrays are those that the library's own classes make."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import rerun as rr
from rerun.chunk import RrdReader

from replay.recording import blueprint
from replay.recording.blueprint_parts import recording_blueprint
from replay.recording.rerun_columns import Column, Lengths, column, constants, index_of, packed, row
from replay.recording.rerun_file import RerunFile

RNG = np.random.default_rng(7)
COUNTS = np.array([2, 0, 1, 3, 0])
POINTS, NUMBERS = RNG.normal(size=(6, 3)), np.array([1.5, np.nan, -0.0, np.inf, 1e-300, 2.0])
COLORS = RNG.integers(0, 256, size=(6, 4), dtype=np.uint8)


def same(mine: Column, theirs: Any) -> None:
    descriptor, mine_array = mine
    theirs_array = theirs.as_arrow_array()
    assert descriptor == theirs.component_descriptor()
    mine_array.validate(full=True)
    assert mine_array.type == theirs_array.type
    assert repr(mine_array.to_pylist()) == repr(theirs_array.to_pylist())  # by text: NaN is not NaN


@pytest.mark.parametrize(
    ("archetype", "field", "values"),
    [
        ("Points3D", "positions", POINTS),
        ("Transform3D", "translation", POINTS),
        ("Transform3D", "quaternion", RNG.normal(size=(6, 4))),
        ("Scalars", "scalars", NUMBERS),
        ("TextLog", "text", ["a", "", "ä/b", "x" * 300, "\n", "e"]),
        ("TextLog", "level", ["INFO"] * 6),
        ("Mesh3D", "vertex_normals", POINTS[:, ::-1]),  # not contiguous
    ],
)
@pytest.mark.parametrize("lengths", [1, 2, COUNTS])
def test_columns_are_the_librarys(archetype: str, field: str, values: Any, lengths: Lengths) -> None:
    (theirs,) = getattr(rr, archetype).from_fields(**{field: values}).as_component_batches()
    counts = lengths if isinstance(lengths, np.ndarray) else np.full(6 // lengths, lengths)
    same(column(archetype, field, values, lengths), theirs.partition(counts))


def test_colors_are_the_librarys() -> None:
    (theirs,) = rr.Mesh3D.columns(albedo_factor=COLORS)
    same(column("Mesh3D", "albedo_factor", packed(COLORS), 1), theirs)


@pytest.mark.parametrize("points", [2, np.array([2, 3, 2, 1, 2, 2])])
def test_line_strips_are_lists_of_lists(points: Lengths) -> None:
    sizes = np.broadcast_to(points, 6)
    corners = RNG.normal(size=(int(sizes.sum()), 3))
    strips = np.split(corners, np.cumsum(sizes)[:-1])
    (theirs,) = rr.LineStrips3D.columns(strips=strips)
    same(column("LineStrips3D", "strips", corners, COUNTS, points), theirs.partition(COUNTS))


def test_a_row_holds_all_values() -> None:
    theirs = rr.Mesh3D(vertex_positions=POINTS).as_component_batches()[0]
    same(row("Mesh3D", "vertex_positions", POINTS), theirs.partition([6]))
    same(
        row("Mesh3D", "vertex_positions", np.zeros((0, 3))),
        theirs.__class__(_nothing(), theirs._descriptor).partition([0]),
    )
    for mine, batch in zip(
        constants(rr.SeriesLines(names="a", widths=2.0)),
        rr.SeriesLines(names="a", widths=2.0).as_component_batches(),
        strict=True,
    ):
        same(mine, batch.partition([1]))


def _nothing() -> Any:
    return rr.components.Position3DBatch([])


def test_lengths_add_up_to_the_number_of_elements() -> None:
    with pytest.raises(AssertionError, match="add up"):
        column("Scalars", "scalars", NUMBERS, np.array([1, 2]))


def test_times_are_the_librarys() -> None:
    time, frames = np.array([0, 16_666_667, 2**62]), np.arange(3) + 7
    theirs = rr.TimeColumn("time", duration=time.astype("timedelta64[ns]")), rr.TimeColumn("frame", sequence=frames)
    mine = index_of(time, frames)
    assert list(mine) == [column.timeline_name() for column in theirs]
    assert all(mine[column.timeline_name()].equals(column.as_arrow_array()) for column in theirs)


@pytest.mark.parametrize("charts", [(), ("joints",), ("distance", "capacitive", "clearance", "joints")])
def test_a_blueprint_made_of_parts_is_the_librarys(charts: tuple[str, ...], tmp_path: Any) -> None:
    found = []
    for k, corners in enumerate((RNG.normal(size=(5, 3)), 10.0 * RNG.normal(size=(5, 3)))):
        end = 1_000_000_000 * (k + 2)
        eye = blueprint.eye_of(corners)
        described = blueprint.recording(charts, eye, blueprint.axis_until(end))
        mine = contents(tmp_path / "mine.rrd", recording_blueprint(charts, corners, end))
        assert mine == contents(tmp_path / "theirs.rrd", described)
        assert len(mine) > 15
        found.append(mine)
    assert found[0] != found[1], "the eye and the axes are each recording's own"


def contents(path: Any, layout: Any) -> list[str]:
    """Return what is in the blueprint of a file, with each view and container called by what is in it."""
    file = RerunFile(path, overwrite=True)
    file.open("test").send_blueprint(layout, make_active=False)
    file.commit()
    reader = RrdReader(str(path))
    (store,) = reader.blueprints()
    values: list[tuple[str, str, str]] = []
    names: dict[str, str] = {}
    for chunk in reader.stream(store=store):
        batch = chunk.to_record_batch()
        for component in batch.schema.names:
            if ":" in component:
                kept = (
                    str(chunk.entity_path),
                    component,
                    f"{batch.column(component).type} {batch.column(component).to_pylist()}",
                )
                values.append(kept)
                if component in ("ViewBlueprint:display_name", "ContainerBlueprint:container_kind"):
                    names[kept[0].split("/")[2]] = kept[2]
    lines = []
    for path_, component, text in values:
        line = f"{path_} {component} {'' if component.endswith('root_container') else text}"
        for identity, name in names.items():
            line = line.replace(identity, name)
        lines.append(line)
    return sorted(lines)
