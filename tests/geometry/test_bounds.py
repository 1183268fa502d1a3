"""Bounding volumes: they contain, they are tight where closed forms say how tight, and bad input is refused."""

import json
import math
from collections.abc import Callable
from fractions import Fraction
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from replay.errors import InvalidValue
from replay.geometry import primitives
from replay.geometry.bounds import Obb, fit_aabb, fit_obb, fit_sphere
from replay.geometry.mesh import load_mesh
from replay.geometry.principal_axes import covariance_of_points, covariance_of_triangles, eigen
from replay.numerics import transforms
from tests.amounts import cases

EPS = np.finfo(float).eps
PHANTOM = Path(find_spec("pyskindose").submodule_search_locations[0]) / "phantom_data/adult_male.stl"
CASES = json.loads((Path(__file__).parents[1] / "data/obb.json").read_text())["cases"]

TETRAHEDRON = np.array([[1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])
OCTAHEDRON = np.concatenate([np.eye(3), -np.eye(3)])
SOLIDS: dict[str, tuple[np.ndarray, float]] = {
    # name: vertices, volume of the smallest box
    "cube": (primitives.cube(1.0).vertices, 1.0),
    "near cube": (primitives.cuboid((1.0, 1.03, 1.06)).vertices, 1.03 * 1.06),
    "cuboid": (primitives.cuboid((1.0, 2.0, 3.0)).vertices, 6.0),
    "square prism": (primitives.cuboid((1.0, 1.0, 3.0)).vertices, 3.0),
    "octahedron": (OCTAHEDRON, 64 / 27),  # axes (2, 2, -1)/3, (2, -1, 2)/3, (-1, 2, 2)/3: half widths 2/3
    "tetrahedron": (TETRAHEDRON, 8.0),  # the cube it is cut from
    "sphere": (primitives.sphere(1.0, 0.005).vertices, 8.0),
    "flat cylinder": (primitives.cylinder(1.0, 0.5, 0.002).vertices, 2.0),
    "cylinder, all eigenvalues equal": (primitives.cylinder(1.0, 3.0**0.5, 0.002).vertices, 4.0 * 3.0**0.5),
    "long cylinder": (primitives.cylinder(1.0, 9.0, 0.002).vertices, 36.0),
}


def rigid(rng: np.random.Generator, far: float = 0.0) -> np.ndarray:
    T = transforms.from_quaternion(rng.normal(size=4))
    T[:3, 3] = far * rng.uniform(-1, 1, size=3)
    return T


def volume(box: Obb) -> float:
    return float(np.prod(2 * box.half_widths))


def check(box: Obb, points: np.ndarray) -> None:
    """Contains all points, exactly computed; axes orthonormal, right-handed; half widths sorted."""
    np.testing.assert_allclose(box.axes @ box.axes.T, np.eye(3), rtol=0, atol=4 * EPS)
    assert np.linalg.det(box.axes) == pytest.approx(1.0)
    assert (np.abs((points - box.center) @ box.axes.T) <= box.half_widths).all()
    for point in points[:: max(1, len(points) // 20)]:
        for axis, half_width in zip(box.axes, box.half_widths, strict=True):
            terms = (Fraction(a) * (Fraction(p) - Fraction(c)) for a, p, c in zip(axis, point, box.center, strict=True))
            assert abs(sum(terms)) <= Fraction(half_width)
    inflation = 16 * EPS * np.abs(points).max()  # half widths are sorted before they grow by ulps of the coordinates
    assert (np.diff(box.half_widths) <= 1e-9 * box.half_widths[0] + inflation).all()


@pytest.mark.parametrize("name", SOLIDS)
@pytest.mark.parametrize("method", ["triangles", "vertices"])
def test_obb(name: str, method: str) -> None:
    """Contained, and within 1 % of the smallest, whatever the order of vertices, rotation, place and size."""
    points, smallest = SOLIDS[name]
    rng = np.random.default_rng(11)
    for far, scale in ((0.0, 1.0), (0.0, 1e-6), (0.0, 1e6), (1e3, 1.0), (1e6, 1.0)):
        moved = transforms.apply(rigid(rng, far), scale * points)[rng.permutation(len(points))]
        box = fit_obb(moved, method=method)
        check(box, moved)
        assert volume(box) <= 1.01 * smallest * scale**3


@pytest.mark.parametrize("case", CASES, ids=[case["id"] for case in CASES])
@pytest.mark.parametrize("method", ["triangles", "vertices"])
def test_hard_cases(case: dict, method: str) -> None:
    points = np.array(case["vertices"], dtype=float)
    box = fit_obb(points, method=method)
    check(box, points)
    extent = np.ptp(points, axis=0).max()
    if "best_half_extents" in case["expect"]:
        best = 8 * np.prod(case["expect"]["best_half_extents"])
        assert volume(box) <= best * (1 + 1e-6)
    if "best_volume" in case["expect"]:
        assert volume(box) <= case["expect"]["best_volume"] + 1e-13 * extent**3
    if case["expect"].get("zero_eigen", 0):
        flat = box.half_widths[3 - case["expect"]["zero_eigen"] :]
        assert (flat <= 1e-14 * extent).all()


def test_cube_is_the_cube() -> None:
    rng = np.random.default_rng(3)
    for _ in range(50):
        T = rigid(rng)
        cube = transforms.apply(T, primitives.cube(2.0).vertices)[rng.permutation(8)]
        box = fit_obb(cube)
        np.testing.assert_allclose(box.half_widths, 1.0, atol=1e-13)
        aligned = np.abs(box.axes @ T[:3, :3])
        np.testing.assert_allclose(np.sort(aligned.ravel())[-3:], 1.0, atol=1e-13)


def test_surface_covariance_does_not_lean_to_dense_vertices() -> None:
    """A cuboid with one corner full of vertices: by triangles it is the cuboid, by vertices it need not be."""
    rng = np.random.default_rng(4)
    solid = primitives.cuboid((1.0, 2.0, 4.0))
    corner = np.array([0.5, 1.0, 2.0]) * (1 - 0.2 * rng.uniform(size=(500, 3)))
    points = np.concatenate([solid.vertices, corner])
    T = rigid(rng, 10.0)
    moved, surface = transforms.apply(T, points), transforms.apply(T, solid.triangles)
    by_hull, by_triangles = fit_obb(moved), fit_obb(moved, triangles=surface)
    for box in (by_hull, by_triangles):
        np.testing.assert_allclose(box.half_widths, [2.0, 1.0, 0.5], rtol=1e-9)
    assert volume(fit_obb(moved, method="vertices")) > 1.2 * 8.0


def test_triangles_by_index_or_coordinates() -> None:
    solid = load_mesh(PHANTOM, scale=0.01)
    points, index = np.unique(solid.triangles.reshape(-1, 3), axis=0, return_inverse=True)
    a = fit_obb(points, triangles=index.reshape(-1, 3))
    b = fit_obb(points, triangles=points[index.reshape(-1, 3)])
    check(a, points)
    np.testing.assert_array_equal(a.axes, b.axes)
    assert volume(a) < volume(fit_obb(points, method="vertices")) * 1.2


def test_covariance_is_that_of_the_sheet() -> None:
    """Against fine subdivision, 1e6 m away, and under splitting; eigenvectors of repeated values stay orthonormal."""
    triangle = np.random.default_rng(5).normal(size=(1, 3, 3))
    area, exact = covariance_of_triangles(triangle)
    n = 200
    i, j = np.meshgrid(np.arange(n), np.arange(n), indexing="ij")
    i, j = i[i + j < n], j[i + j < n]
    up = (i + 1 / 3) / n, (j + 1 / 3) / n
    inner = i + j < n - 1
    down = (i[inner] + 2 / 3) / n, (j[inner] + 2 / 3) / n
    s, t = (np.concatenate(x) for x in zip(up, down, strict=True))
    a, b, c = triangle[0]
    samples = a + s[:, None] * (b - a) + t[:, None] * (c - a)
    np.testing.assert_allclose(exact, np.cov(samples.T, bias=True), rtol=0, atol=1e-4 * np.abs(exact).max())
    assert area == pytest.approx(0.5 * np.linalg.norm(np.cross(b - a, c - a)))
    mesh = primitives.cone(1.0, 2.0, 0.01).triangles
    near = covariance_of_triangles(mesh)[1]
    np.testing.assert_allclose(covariance_of_triangles(mesh + 1e6)[1], near, atol=1e-9)
    assert covariance_of_triangles(np.ones((2, 3, 3)))[0] == 0.0
    points = np.random.default_rng(6).normal(size=(40, 3))
    np.testing.assert_allclose(covariance_of_points(points), np.cov(points.T, bias=True), rtol=1e-13)


@settings(max_examples=cases(200), deadline=None)
@given(st.lists(st.floats(-6, 6), min_size=3, max_size=3), st.integers(0, 2**32), st.booleans())
def test_eigen(exponents: list[float], seed: int, repeated: bool) -> None:
    values = np.sort(10.0 ** np.array(exponents))
    values[1] = values[0] if repeated else values[1]
    R = rigid(np.random.default_rng(seed))[:3, :3]
    matrix = R @ np.diag(values) @ R.T
    matrix = 0.5 * (matrix + matrix.T)
    found, vectors = eigen(matrix)
    np.testing.assert_allclose(found, np.linalg.eigvalsh(matrix), atol=1e-14 * values[2])
    np.testing.assert_allclose(vectors @ vectors.T, np.eye(3), atol=1e-14)
    np.testing.assert_allclose(vectors @ matrix @ vectors.T, np.diag(found), atol=1e-14 * values[2])


def brute_force_radius(points: np.ndarray) -> float:
    """The smallest ball by trying the ball of every pair, triple and quadruple."""
    from itertools import combinations

    best = np.inf
    for size in (1, 2, 3, 4):
        for subset in combinations(points, size):
            a = np.array(subset)
            edges = a[1:] - a[0]
            weights, *_ = np.linalg.lstsq(2 * edges @ edges.T, np.sum(edges**2, axis=1), rcond=None)
            centre = a[0] + weights @ edges
            best = min(best, np.linalg.norm(points - centre, axis=1).max())
    return float(best)


@settings(max_examples=cases(60), deadline=None)
@given(st.integers(1, 9), st.integers(0, 2**32), st.sampled_from(["cloud", "grid", "plane", "line", "shell"]))
def test_smallest_sphere(count: int, seed: int, kind: str) -> None:
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(count, 3))
    if kind == "grid":
        points = rng.integers(-1, 2, size=(count, 3)).astype(float)
    elif kind == "plane":
        points[:, 2] = 0.5
    elif kind == "line":
        points = points[:, :1] * np.array([1.0, 2.0, 3.0])
    elif kind == "shell":
        points /= np.linalg.norm(points, axis=1)[:, None]
    expected = brute_force_radius(points)
    for scale, far in ((1.0, 0.0), (1e-6, 0.0), (1e6, 0.0), (1.0, 1e6)):
        moved = transforms.apply(rigid(rng, far), scale * points)
        ball = fit_sphere(moved)
        assert (np.linalg.norm(moved - ball.center, axis=1) <= ball.radius).all()
        assert ball.radius == pytest.approx(scale * expected, rel=1e-14, abs=1e-15 * scale + 4 * EPS * far)


def test_every_point_is_in_its_sphere_and_box_however_distances_are_rounded() -> None:
    """What others compute of a point and a volume may be rounded otherwise than by whoever made the volume."""
    rng = np.random.default_rng(12)
    for _ in range(cases(300)):
        points = rng.normal(size=(rng.integers(2, 9), 3)) * 10.0 ** rng.uniform(-3, 3) + rng.normal(size=3)
        ball, box = fit_sphere(points), fit_aabb(points)
        x, y, z = (points - ball.center).T
        ways = (
            np.sqrt(x * x + y * y + z * z),
            np.sqrt((z * z + y * y) + x * x),
            np.array([math.dist(point, ball.center) for point in points]),
            np.hypot(np.hypot(x, y), z),
            np.linalg.norm(ball.center - points, axis=1),
        )
        for distance in ways:
            assert (distance <= ball.radius).all()
        exact = [
            sum((Fraction(float(a)) - Fraction(float(c))) ** 2 for a, c in zip(point, ball.center, strict=True))
            for point in points
        ]
        assert max(exact) <= Fraction(ball.radius) ** 2
        assert ball.radius <= math.sqrt(max(exact)) * (1.0 + 16.0 * EPS)
        for axis in range(3):
            offsets = [abs(Fraction(float(p)) - Fraction(float(box.center[axis]))) for p in points[:, axis]]
            assert max(offsets) <= Fraction(float(box.half_widths[axis]))


def test_sphere_of_large_sets() -> None:
    sphere = primitives.sphere(0.5, 1e-3).vertices + np.array([3.0, 4.0, 5.0])
    ball = fit_sphere(sphere)
    np.testing.assert_allclose(ball.center, [3, 4, 5], atol=1e-14)
    assert ball.radius == pytest.approx(0.5, rel=1e-14)
    phantom = load_mesh(PHANTOM, scale=0.01).vertices
    ball = fit_sphere(phantom)
    reach = np.linalg.norm(phantom - ball.center, axis=1)
    assert reach.max() <= ball.radius
    touching = phantom[reach > ball.radius * (1 - 1e-9)]  # the smallest ball's centre is in the hull of what it touches
    assert len(touching) >= 2
    assert ball.radius == pytest.approx(brute_force_radius(touching[:6]), rel=1e-9)


@settings(max_examples=cases(100), deadline=None)
@given(st.integers(1, 50), st.integers(0, 2**32), st.floats(-6, 6), st.floats(0, 1e6))
def test_aabb(count: int, seed: int, exponent: float, far: float) -> None:
    points = np.random.default_rng(seed).normal(size=(count, 3)) * 10.0**exponent + far
    box = fit_aabb(points)
    for point in points:
        for p, c, w in zip(point, box.center, box.half_widths, strict=True):
            assert abs(Fraction(p) - Fraction(c)) <= Fraction(w)
    np.testing.assert_allclose(2 * box.half_widths, np.ptp(points, axis=0), rtol=1e-14, atol=4 * EPS * far)


@settings(max_examples=cases(60), deadline=None)
@given(
    st.integers(1, 40),
    st.integers(0, 2**32),
    st.lists(st.floats(-9, 0), min_size=3, max_size=3),
    st.floats(-6, 6),
    st.sampled_from([0.0, 1.0, 1e6]),
)
def test_obb_of_anything(count: int, seed: int, flatness: list[float], exponent: float, far: float) -> None:
    """Needles, slabs, points, far and near, tiny and huge: contained, orthonormal, no larger than the aligned box."""
    rng = np.random.default_rng(seed)
    shape = rng.normal(size=(count, 3)) * 10.0 ** np.array(flatness)
    points = transforms.apply(rigid(rng, far), shape * 10.0**exponent)
    extent = 10.0**exponent
    for method in ("triangles", "vertices"):
        box = fit_obb(points, method=method)
        check(box, points)
        widths = np.sort(np.ptp(shape, axis=0) * extent)[::-1] + 1e-13 * extent + 8 * EPS * far
        assert (2 * box.half_widths <= 3.0 * widths[0]).all()
        if count >= 3:
            assert volume(box) <= 16.0 * np.prod(widths)


@pytest.mark.parametrize("far", [1e300, 1e-200])
def test_extreme_magnitudes(far: float) -> None:
    points = primitives.cube(1.0).vertices * far
    assert np.isfinite(fit_sphere(points).radius) and np.isfinite(fit_aabb(points).half_widths).all()
    for triangles in (None, primitives.cube(1.0).triangles * far, primitives.cube(1.0).triangles):
        box = fit_obb(points, triangles=triangles)
        np.testing.assert_allclose(box.half_widths, 0.5 * far, rtol=1e-13)


@pytest.mark.parametrize(
    "call",
    [
        lambda: fit_sphere(np.zeros((0, 3))),
        lambda: fit_aabb(np.zeros(3)),
        lambda: fit_obb(np.zeros((4, 2))),
        lambda: fit_obb(np.array([[0.0, 0, np.nan]])),
        lambda: fit_sphere(np.array([[0.0, 0, np.inf]])),
        lambda: fit_obb(TETRAHEDRON, method="pca"),
        lambda: fit_obb(TETRAHEDRON, triangles=np.array([[0, 1, 4]])),
        lambda: fit_obb(TETRAHEDRON, triangles=np.array([[0, 1, -1]])),
        lambda: fit_obb(TETRAHEDRON, triangles=np.array([[0.0, 1.0, 2.0]])),
        lambda: fit_obb(TETRAHEDRON, triangles=np.full((1, 3, 3), np.nan)),
        lambda: fit_obb(TETRAHEDRON, triangles=np.zeros((0, 3), dtype=int)),
    ],
)
def test_bad_input(call: Callable[[], object]) -> None:
    with pytest.raises(InvalidValue):
        call()


@pytest.mark.parametrize("method", ["triangles", "vertices"])
def test_obb_is_never_larger(method: str) -> None:
    # of 2000 random sets 201 had a larger one than along the axes, up to 1.65 times
    rng = np.random.default_rng(0)
    prisms = [
        [(0, 0), (3, 0), (0, 4)],
        [(0, 0), (4, 0), (4, 1), (2, 1)],
        [(0, 0), (4, 0), (5, 1), (1, 1)],
        [(0, 0), (4, 0), (4, 3), (0, 2)],
        [(0, 0), (4, 0), (4, 1), (1, 1), (1, 3), (0, 3)],
    ]
    sets = [np.array([(x, y, z) for x, y in prism for z in (0, 1)], dtype=float) for prism in prisms]
    sets += [rng.normal(size=(rng.integers(4, 12), 3)) for _ in range(cases(400))]
    sets += [rng.normal(size=(9, 3)) * 10.0 ** rng.uniform(-4, 4, 3) for _ in range(cases(100))]
    for points in sets:
        box, along = fit_obb(points, method=method), fit_aabb(points)
        rounding = 1e-14 * np.max(np.abs(along.half_widths))
        assert np.prod(box.half_widths) <= np.prod(along.half_widths + rounding)


def test_flat_sets_keep_the_smallest_rectangle() -> None:
    # as volumes, both boxes are nothing: the areas decide
    turned = np.array([[0.0, 0, 0], [2, 2, 0], [1, 3, 0], [-1, 1, 0]])
    for points in (turned, turned[:, [2, 0, 1]]):
        widths = 2.0 * fit_obb(points).half_widths
        np.testing.assert_allclose(widths, [2 * 2**0.5, 2**0.5, 0.0], atol=1e-12)
