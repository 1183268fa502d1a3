"""The public GJK functions against independent answers, invariances and bad input."""

import numba
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog
from scipy.spatial import ConvexHull

from replay.collision import gjk_exact, gjk_kernel
from replay.collision.gjk import Status, distance, intersect
from replay.collision.support import make_sets
from replay.errors import InvalidValue
from replay.geometry.primitives import cone, cylinder
from tests.amounts import cases
from tests.collision import motions, reference

UNIT = reference.box((1, 1, 1))


def sets(bodies, *, tables=False):
    """Return bodies, each one convex set, as `Sets`."""
    return make_sets(np.concatenate(bodies), np.cumsum([0, *(len(body) for body in bodies)]), tables=tables)


def run_boxes(n, seed):
    """Return (hits, wrong, undecided) over n random pairs of boxes, rotations from aligned to arbitrary."""
    rng = np.random.default_rng(seed)
    halves = rng.uniform(0.05, 1.0, (200, 3)) * 10.0 ** rng.integers(-1, 1, (200, 1))
    bodies = sets([reference.box(2 * half) for half in halves])
    which = rng.integers(0, len(halves), (n, 2))
    few = np.stack([motions.rotation(rng) for _ in range(cases(500))] + [np.identity(3)] * 100)
    rotations = few[rng.integers(0, len(few), n)]
    reach = np.sqrt((halves[which[:, 0]] ** 2).sum(1)) + np.sqrt((halves[which[:, 1]] ** 2).sum(1))
    positions = rng.normal(size=(n, 3)) * (0.35 * reach)[:, None]
    return _boxes(bodies, halves, which, rotations, positions, gjk_exact.workspace())


_precise_points = numba.njit(gjk_exact.precise_points)


@numba.njit
def _boxes(bodies, halves, which, rotations, positions, work):
    hits, wrong, undecided = 0, 0, 0
    precise = _precise_points()
    for k in range(len(which)):
        i, j = which[k]
        size = 2.0 * (np.abs(positions[k]).max() + halves[i].max() + halves[j].max())
        gap = reference.box_gap(rotations[k], positions[k], halves[i], halves[j])
        status = gjk_kernel.query(bodies, i, bodies, j, rotations[k], positions[k], size, 0.0, 0.0, work, precise)
        measured = gjk_kernel.query(bodies, i, bodies, j, rotations[k], positions[k], size, np.inf, 0.0, work, precise)
        hits += gap <= 0.0
        undecided += (status == gjk_exact.UNDECIDED) + (measured == gjk_exact.UNDECIDED)
        if abs(gap) > 1e-12 * size:
            apart = gap > 0.0
            wrong += (status == gjk_exact.SEPARATED) != apart or (measured == gjk_exact.SEPARATED) != apart
            # the largest separation over the axes is a lower bound on the distance
            wrong += apart and not (gap <= work.result[gjk_exact.DISTANCE] + 1e-12 * size)
    return hits, wrong, undecided


def run_hulls(n, seed):
    """Return (hits, wrong, undecided, worst error over size) over n random pairs of hulls, distances included."""
    rng = np.random.default_rng(seed)
    bodies, faces, edges = [], [], []
    for _ in range(60):
        points = rng.normal(size=(rng.integers(4, 13), 3)) * 10.0 ** rng.uniform(-1, 0, 3)
        hull = ConvexHull(points)
        names = {old: new for new, old in enumerate(hull.vertices)}
        sides = np.array([[names[v] for v in simplex] for simplex in hull.simplices])
        bodies.append(points[hull.vertices])
        faces.append(sides)
        edges.append(np.unique(np.sort(sides[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1), axis=0))
    several = sets(bodies)
    work = gjk_exact.workspace()
    hits = wrong = undecided = 0
    worst = 0.0
    for _ in range(n):
        i, j = rng.integers(0, len(bodies), 2)
        turn, position = motions.rotation(rng), 0.4 * rng.normal(size=3)
        size = 2.0 * (np.abs(bodies[i]).max() + np.abs(bodies[j]).max() + np.abs(position).max())
        moved = bodies[j] @ turn.T + position
        gap = reference.hull_gap(bodies[i], faces[i], edges[i], moved, faces[j], edges[j])
        status = _query(several, i, j, turn, position, size, work)
        hits += gap <= 0.0
        undecided += status == gjk_exact.UNDECIDED
        if abs(gap) > 1e-12 * size:
            wrong += (status == gjk_exact.SEPARATED) != (gap > 0.0)
            worst = max(worst, abs(work.result[gjk_exact.DISTANCE] - max(gap, 0.0)) / size)
    return hits, wrong, undecided, worst


@numba.njit
def _query(bodies, i, j, rotation, translation, size, work):
    precise = _precise_points()
    return gjk_kernel.query(bodies, i, bodies, j, rotation, translation, size, np.inf, 0.0, work, precise)


def test_random_boxes_agree_with_separating_axes():
    n = 20_000
    hits, wrong, undecided = run_boxes(n, seed=1)
    assert 0.3 < hits / n < 0.7
    assert (wrong, undecided) == (0, 0)


def test_random_hulls_agree_with_features():
    n = 2_000
    hits, wrong, undecided, worst = run_hulls(n, seed=2)
    assert 0.3 < hits / n < 0.7
    assert (wrong, undecided) == (0, 0)
    assert worst <= 1e-12


def test_tables_find_what_looking_at_every_vertex_finds():
    """Round, flat-topped, needle and off-centre hulls, at gaps from contact to far: same status, same distance."""
    rng = np.random.default_rng(31)
    directions = rng.normal(size=(300, 3))
    directions /= np.sqrt((directions**2).sum(axis=1))[:, None]
    shapes = (
        directions * np.array([0.5, 0.4, 0.3]),
        cylinder(0.3, 1.0, 0.0005).vertices,
        cone(0.01, 2.0, 0.00001).vertices,
        directions[:100] * np.array([0.01, 0.01, 1.0]) + np.array([5.0, 0, 0]),
    )
    listed = [sets([shape], tables=True) for shape in shapes]
    looked_at = [sets([shape]) for shape in shapes]
    assert all(several.side[0] >= 8 for several in listed)
    assert all(several.side[0] == 0 for several in looked_at)
    work = gjk_exact.workspace()
    met = 0
    for _ in range(cases(400)):
        i, j = rng.integers(0, len(shapes), 2)
        turn = motions.rotation(rng) if rng.random() < 0.7 else np.identity(3)
        place = 20.0 * np.identity(3)[rng.integers(3)] if rng.random() < 0.3 else 12.0 * rng.normal(size=3)
        _pair(looked_at[i], looked_at[j], turn, place, 100.0, np.inf, work)
        gap = rng.choice([-1.0, 0.0, 1.0]) * 10.0 ** rng.uniform(-14, -1)
        direction = work.result[gjk_exact.DIRECTION :][:3]
        place = place - (work.result[gjk_exact.DISTANCE] - gap) * direction / np.sqrt((direction**2).sum())
        for cutoff in (0.0, np.inf):
            truth = _pair(looked_at[i], looked_at[j], turn, place, 20.0, cutoff, work)
            expected = work.result[gjk_exact.DISTANCE]
            assert _pair(listed[i], listed[j], turn, place, 20.0, cutoff, work) == truth
            met += truth == gjk_exact.CONTACT
            if truth == gjk_exact.SEPARATED and cutoff == np.inf:
                assert work.result[gjk_exact.DISTANCE] == pytest.approx(expected, rel=1e-12, abs=1e-15)
    assert 100 < met < 700


@numba.njit
def _pair(a, b, rotation, translation, size, cutoff, work):
    precise = _precise_points()
    return gjk_kernel.query(a, 0, b, 0, rotation, translation, size, cutoff, 0.0, work, precise)


@pytest.mark.soak
def test_million_pairs():
    _, wrong, undecided = run_boxes(900_000, seed=3)
    assert (wrong, undecided) == (0, 0)
    _, wrong, undecided, worst = run_hulls(100_000, seed=4)
    assert (wrong, undecided) == (0, 0)
    assert worst <= 1e-12


@pytest.mark.parametrize("exponent", range(-50, 1, 5))
@pytest.mark.parametrize("kind", ["face", "edges", "corner"])
def test_ladder_of_gaps_is_exact(kind, exponent):
    """Gaps of 2^k between a face and a face, an edge and an edge, a corner and a face, without any rounding."""
    gap = 2.0**exponent
    roof = np.array([[-1.0, 0, 0], [1, 0, 0], [0, -1, -1], [0, 1, -1]])  # edge along x on top
    other = {
        "face": UNIT + np.array([0.25, 0.125, 1 + gap]),
        "edges": roof[:, [1, 0, 2]] * [1, 1, -1] + np.array([0, 0, gap]),
        "corner": np.array([[0.0, 0, 0], [1, 0, 1], [0, 1, 1], [-1, -1, 1]]) + np.array([0, 0, gap]),
    }[kind]
    body = {"face": UNIT, "edges": roof, "corner": UNIT - [0, 0, 0.5]}[kind]
    for scale in (1.0, 2.0**-30, 2.0**20):
        for shift, status, expected in ((0.0, Status.SEPARATED, gap), (gap, Status.CONTACT, 0.0)):
            other_there = scale * (other - [0, 0, shift])
            separation = distance(scale * body, other_there)
            assert separation.status is intersect(scale * body, other_there).status is status
            assert abs(separation.distance - scale * expected) <= 2.0**-52 * scale * expected
            assert intersect(scale * body, scale * (other - [0, 0, 2 * gap])).status is Status.CONTACT


def test_sets_of_any_dimension():
    point, segment = [[0.25, 0.0, 0.0]], [[0.0, -1, 1], [0, 1, 1], [0, 0.5, 1]]
    square = [[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, 0.5, 0], [1, 1, 0]]
    assert distance(point, point).status is Status.CONTACT
    assert distance(point, segment).distance == np.sqrt(1 + 0.25**2)
    assert distance(point, square).status is Status.CONTACT
    assert distance(segment, square).distance == 1.0
    assert distance(segment, np.array(segment) + np.array([0, 1e-3, 0])).status is Status.CONTACT
    assert distance(square, np.array(square) + np.array([0.5, 0.5, 0])).status is Status.CONTACT
    assert distance(square, np.array(square) + np.array([1.5, 0, 0])).distance == 0.5
    assert distance(np.repeat(UNIT, 3, axis=0), np.repeat(UNIT, 2, axis=0) + np.array([0, 2, 0])).distance == 1.0
    assert intersect(UNIT, UNIT).status is intersect(UNIT, 1e-3 * UNIT).status is Status.CONTACT


def test_far_from_the_origin_reads_the_same():
    """World coordinates of 2^27 m cancel exactly, by pose and by vertex."""
    near = distance(UNIT, UNIT + np.array([1.001, 0.25, 0.5]))
    offset = np.full(3, 2.0**27)
    there = np.round((np.array([1.001, 0.25, 0.5]) + offset) - offset, 15)
    far = distance(UNIT + offset, UNIT + offset + there)
    by_pose = distance(
        UNIT, UNIT, pose_a=motions.pose(np.identity(3), offset), pose_b=motions.pose(np.identity(3), offset + there)
    )
    rounded = (offset + there - offset)[0] - 1.0
    assert abs(near.distance - 0.001) < 1e-15
    assert far.distance == pytest.approx(rounded, rel=1e-12)
    assert by_pose.distance == pytest.approx(rounded, rel=1e-12)


def test_degenerate_sets_on_a_lattice_agree_with_a_linear_programme():
    """Few integer points: most simplices are flat, collinear or repeated, and a third of the pairs just touch."""
    rng = np.random.default_rng(13)
    met = 0
    for _ in range(cases(400)):
        a, b = (rng.integers(-1, 3, (rng.integers(1, 9), 3)).astype(float) for _ in range(2))
        b += rng.integers(-2, 3, 3) * np.array([1.0, 1.0, 0.5])
        # weights u, v >= 0 of sum 1 with sum u a = sum v b
        weights = np.vstack([np.hstack([a.T, -b.T]), np.r_[np.ones(len(a)), np.zeros(len(b))]])
        weights = np.vstack([weights, np.r_[np.zeros(len(a)), np.ones(len(b))]])
        meets = linprog(np.zeros(len(a) + len(b)), A_eq=weights, b_eq=[0, 0, 0, 1, 1]).status == 0
        separation = distance(a, b)
        assert separation.status is intersect(a, b).status is (Status.CONTACT if meets else Status.SEPARATED)
        assert separation.distance - separation.lower_bound <= 1e-12 * separation.distance
        met += meets
    assert 0.3 < met / 400 < 0.7


points = st.lists(st.tuples(*[st.floats(-10, 10, allow_subnormal=False)] * 3), min_size=1, max_size=9).map(np.array)


@settings(max_examples=cases(200), deadline=None)
@given(points, points, st.integers(0, 2**32 - 1))
def test_answers_carry_their_proof(a, b, seed):
    pose_a = motions.random_pose(np.random.default_rng(seed))
    separation = distance(a, b, pose_a=pose_a)
    verdict = intersect(a, b, pose_a=pose_a)
    swapped = distance(b, a, pose_b=pose_a)
    assert separation.status is verdict.status is swapped.status is not Status.UNDECIDED
    assert separation.distance == swapped.distance
    assert (separation.point_a == swapped.point_b).all()
    in_world = a @ pose_a[:3, :3].T + pose_a[:3, 3]
    size = np.abs(in_world).max() + np.abs(b).max()
    for direction, bound in (
        (separation.direction, separation.lower_bound),
        (verdict.direction, verdict.gap_lower_bound),
    ):
        if separation.status is Status.SEPARATED:
            assert (b @ direction).min() - (in_world @ direction).max() >= bound - 1e-14 * size
    if separation.status is Status.SEPARATED:
        gap = np.linalg.norm(separation.point_a - separation.point_b)
        assert gap == pytest.approx(separation.distance, abs=1e-14 * size)
        # farther along the separating direction is farther apart, by as much at most
        farther = distance(a, b + 0.5 * separation.direction, pose_a=pose_a)
        assert separation.distance - 1e-14 * size <= farther.distance <= separation.distance + 0.5 + 1e-14 * size
        moved = motions.random_pose(np.random.default_rng(seed + 1), 10.0)
        again = distance(a, b, pose_a=moved @ pose_a, pose_b=moved)
        assert again.distance == pytest.approx(separation.distance, abs=1e-13 * size)


@pytest.mark.parametrize(
    ("arguments", "name"),
    [
        ({"a": [[0, 0]]}, "a"),
        ({"a": np.zeros((0, 3))}, "a"),
        ({"b": [[0, 0, np.nan]]}, "b[0, 2]"),
        ({"b": [[0, np.inf, 0]]}, "b[0, 1]"),
        ({"b": [[1e101, 0, 0]]}, "b[0, 0]"),
        ({"a": "cube"}, "a"),
        ({"pose_a": np.identity(3)}, "pose_a"),
        ({"pose_a": np.full((4, 4), np.nan)}, "pose_a[0, 0]"),
        ({"pose_b": np.diag([1.0, 1.0, 1.001, 1.0])}, "pose_b[:3, :3]"),
        ({"pose_b": np.diag([1.0, 1.0, -1.0, 1.0])}, "pose_b[:3, :3]"),
        ({"pose_b": np.diag([1.0, 1.0, 1.0, 2.0])}, "pose_b[3]"),
    ],
)
def test_bad_input_is_refused(arguments, name):
    with pytest.raises(InvalidValue) as caught:
        distance(**{"a": UNIT, "b": UNIT, **arguments})
    assert caught.value.name == name
