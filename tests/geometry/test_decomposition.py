"""Convex decomposition: deterministic, its cost measured, kept on disk without ever being in the way."""

from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
import trimesh
from trimesh.proximity import closest_point

from replay.errors import InvalidValue
from replay.geometry import decomposition, primitives
from replay.geometry.containment import contains
from replay.geometry.convex import convex_sets
from replay.geometry.decomposition import closed_cavities, decompose
from replay.geometry.mesh import load_mesh, solid_from_triangles
from replay.geometry.solid import Solid

PHANTOM = Path(find_spec("pyskindose").submodule_search_locations[0]) / "phantom_data/adult_male_reduced_1000t.stl"


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr(decomposition, "RESOLUTION", 100_000)
    return tmp_path


def two_cubes(gap: float = 1.0) -> Solid:
    cube = primitives.cube(1.0).triangles
    return solid_from_triangles(np.concatenate([cube, cube + np.array([1.0 + gap, 0.0, 0.0])]))


@pytest.mark.compiled
def test_phantom_twice_and_from_cache(cache: Path) -> None:
    solid = load_mesh(PHANTOM, scale=0.01)
    first = decompose(solid)
    (entry,) = cache.rglob("*.npz")
    kept = decompose(solid)
    entry.write_bytes(entry.read_bytes()[:100])  # damaged: computed again, and repaired
    again = decompose(solid)
    for other in (kept, again):
        figures = (other.volume_error, other.protrusion, other.missed)
        assert figures == (first.volume_error, first.protrusion, first.missed)
        for mine, theirs in zip(first.pieces, other.pieces, strict=True):
            np.testing.assert_array_equal(mine, theirs)
    assert 0.0 < first.volume_error < 0.3
    assert 0.003 < first.protrusion < 0.05
    assert 0.0 < first.missed < 0.05
    assert [path.suffix for path in cache.rglob("*") if path.is_file()] == [".npz"]
    assert entry.stat().st_size > 1000
    sets = convex_sets(solid, pieces="convex")
    assert len(sets.first) == len(first.pieces) + 1 and not sets.surface


def test_protrusion_against_samples() -> None:
    """Dense samples of the pieces' corners and edges never stick out further than reported."""
    solid = load_mesh(PHANTOM, scale=0.01)
    result = decompose(solid)
    mesh = trimesh.Trimesh(**trimesh.triangles.to_kwargs(solid.triangles))
    rng = np.random.default_rng(1)
    samples = np.concatenate([rng.dirichlet(np.full(len(p), 0.2), size=40) @ p for p in result.pieces])
    samples = np.concatenate([samples, *result.pieces])
    samples = samples[~contains(solid.triangles, samples)]
    distance = closest_point(mesh, samples)[1]
    assert distance.max() <= result.protrusion + 1e-3 * 1.8
    assert distance.max() >= 0.3 * result.protrusion


def test_known_figures() -> None:
    apart = two_cubes()
    bridge = (np.concatenate([apart.vertices]),)  # one hull over both cubes
    assert decomposition._volume_error(apart, bridge) == pytest.approx(0.5, rel=1e-12)
    assert decomposition._protrusion(apart, bridge) == pytest.approx(0.5, abs=3e-3)  # the middle of the gap
    assert decomposition._missed(apart, bridge) <= 1e-15
    assert decomposition._missed(apart, (primitives.cube(1.0).vertices,)) == pytest.approx(2.0)  # x up to 2.5, not 0.5
    exact = decompose(primitives.arc(0.8, 2.5, 0.2, 0.1, 1e-3))
    assert (exact.volume_error, exact.protrusion, exact.missed) == (0.0, 0.0, 0.0) and len(exact.pieces) > 10


def test_size_and_place_do_not_matter() -> None:
    small = decompose(solid_from_triangles(two_cubes().triangles * 2.0**-20))
    plain = decompose(two_cubes())
    assert len(small.pieces) == len(plain.pieces)
    assert small.volume_error == pytest.approx(plain.volume_error, abs=1e-9)
    assert small.protrusion == pytest.approx(plain.protrusion * 2.0**-20, rel=1e-9, abs=1e-12)


def test_works_without_a_cache(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    blocked = cache / "file"
    blocked.write_text("not a folder")
    monkeypatch.setenv("XDG_CACHE_HOME", str(blocked))
    assert len(decompose(two_cubes()).pieces) >= 2
    monkeypatch.setenv("XDG_CACHE_HOME", "relative")
    monkeypatch.setenv("HOME", str(cache / "home"))
    decompose(two_cubes())
    assert len(list((cache / "home" / ".cache").rglob("*.npz"))) == 1


def test_open_and_flat_bodies() -> None:
    holed = solid_from_triangles(two_cubes().triangles[1:])
    result = decompose(holed)
    assert np.isnan(result.volume_error) and result.protrusion >= 0.0
    sheet = primitives.plane((1.0, 1.0)).triangles
    with pytest.raises(InvalidValue):
        decompose(solid_from_triangles(sheet))


def test_closed_cavities_are_counted() -> None:
    cube = primitives.cube(1.0).triangles
    hollow = np.concatenate([cube, 0.3 * cube[:, ::-1] + 0.1, 0.1 * cube[:, ::-1] - 0.3, 0.1 * cube + 0.1])
    for triangles, cavities in ((cube, 0), (hollow, 2), (hollow[:, ::-1], 2), (np.delete(hollow, 12, axis=0), 1)):
        assert closed_cavities(solid_from_triangles(triangles)) == cavities
