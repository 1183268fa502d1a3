"""The collision benchmark, small."""

import numpy as np
import pytest

from replay.bench import broad_phase, collision, motion
from replay.bench.engines import OURS, OURS_CHECKED, PEERS, Engine, Queries
from replay.bench.hard_pairs import FAMILIES, hard_pairs
from replay.bench.report import Report
from replay.bench.truth import placed, proven_distance, signed_distance

pytestmark = pytest.mark.compiled  # it measures them

ABSENT = Engine("absent", "a_package_nobody_has", lambda *_: None)


def lies(a, b, T_world_a, T_world_b):
    count = len(T_world_a)
    return Queries(lambda: np.ones(count, dtype=bool), lambda: np.zeros(count))


LIAR = Engine("liar", "", lies)


def refuses(a, b, T_world_a, T_world_b):
    raise ValueError("too thin")


@pytest.fixture(scope="module")
def rows():
    engines = (OURS, OURS_CHECKED, *PEERS, LIAR, ABSENT)
    return collision.easy(engines, count=12, rounds=1, bodies=("box", "42 vertices"))


def test_bodies_with_edges_are_as_large_as_they_say():
    (box,) = (body for body in collision.BODIES.values() if body.size is not None)
    np.testing.assert_allclose(np.ptp(box.vertices, axis=0), box.size, rtol=1e-15)


@pytest.mark.parametrize("body", collision.BODIES.values(), ids=collision.BODIES)
def test_overlapping_copies_share_points_and_are_not_all_in_one_place(body):
    poses = collision.placements(body, "overlapping", 20, np.random.default_rng(4))
    assert all(proven_distance(body.vertices, body.vertices, pose)[0] == 0.0 for pose in poses)
    offsets = np.linalg.norm(poses[:, :3, 3], axis=1) / np.abs(body.vertices).max()
    assert offsets.min() > 0.0


def test_ours_are_right_everywhere(rows):
    ours = [row for row in rows if row.method in (OURS.name, OURS_CHECKED.name)]
    assert len(ours) == 2 * 2 * 3 * 2
    assert all(row.wrong == 0 and not row.failed for row in ours)
    assert all(row.worst_error <= 1e-14 for row in ours)


def test_a_liar_is_failed_and_a_missing_peer_is_said(rows):
    for row in rows:
        if row.method == "liar":
            assert row.failed == ("overlapping" not in row.case)
        if row.method == "absent":
            assert "not installed" in row.note
            assert row.rounds == 0


def test_hard_pairs_have_answers_of_every_kind():
    pairs = hard_pairs(8)
    assert {pair.family for pair in pairs} == set(FAMILIES)
    meets = [pair.meets for pair in pairs]
    assert min(meets.count(value) for value in (True, False, None)) >= 5
    rows = collision.hard((OURS_CHECKED, Engine("refuses", "", refuses)), count=4, rounds=1)
    for row in rows:
        assert row.failed == (row.method == "refuses"), row


def test_the_two_references_agree():
    for pair in hard_pairs(2):
        if pair.meets is False and pair.family in ("face to face 1e-1..1e-16", "corner to face 1e-1..1e-16"):
            T_a_b = np.linalg.inv(pair.T_world_a) @ pair.T_world_b
            low, high = proven_distance(pair.a.vertices, pair.b.vertices, T_a_b)
            assert low - 1e-14 <= pair.distance <= high + 1e-14


def test_reference_knows_boxes():
    a = collision.BODIES["box"].vertices
    for shift, expected in ((1.25, 0.25), (0.9, -0.1)):
        pose = np.identity(4)
        pose[0, 3] = shift
        assert signed_distance(placed(a, np.identity(4)), placed(a, pose)) == pytest.approx(expected, abs=1e-15)


def test_motion_agrees_with_the_peer():
    report = Report("collision")
    motion.add_to(report, frames=20, rounds=1)
    rows = report.tables[motion.TITLE]
    assert [row.method for row in rows] == [motion.OURS, motion.OURS_NEAR, motion.FCL, motion.FCL_MANAGER, motion.COAL]
    assert all(row.wrong == 0 for row in rows[:2])
    assert all(row.wrong <= 0.01 * 20 * 66 for row in rows[2:]), "peers are asked the same"
    assert [goal.key for goal in report.goals] == ["motion.fcl", "motion.coal"]


def test_no_volume_loses_a_contact():
    lines = broad_phase.tightness(16, 1).lines
    assert [line["volume"] for line in lines] == list(broad_phase.VOLUMES)
    assert all(line["contacts lost"] == 0 for line in lines)
    assert all(line["pass"] - line["touch"] == line["pass for nothing"] for line in lines)


def test_cost_against_bodies_is_fitted():
    report = Report("collision")
    broad_phase.growth(report, most=30, rounds=1)
    (rows,) = report.tables.values()
    assert len(rows) == 4
    assert any("grows like n^" in note for note in report.notes)
