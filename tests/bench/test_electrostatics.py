"""The benchmark of electrostatics, small."""

import numpy as np
import pytest

from replay.bench import charge_motions, electrostatics
from replay.bench.conductors import configurations, surface
from replay.bench.report import Report
from replay.sensing.electrostatics import bem
from tests.sensing.electrostatics import made_cases

pytestmark = pytest.mark.compiled  # it measures them


def test_the_surfaces_are_those_of_the_cases():
    shapes = [
        shape
        for case in made_cases.CASES.values()
        for shape in [*case["bodies"], *(shape for electrode in case["electrodes"] for shape in electrode["shapes"])]
    ]
    assert {shape["type"] for shape in shapes} == {"rect", "box", "prism", "icosphere", "phantom"}
    for shape in shapes:
        ours, other = surface(shape), made_cases.surface(shape)
        assert ours.shape == other.shape
        np.testing.assert_allclose(np.ptp(ours, axis=(0, 1)), np.ptp(other, axis=(0, 1)), rtol=1e-12)
        area = [np.linalg.norm(np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0]), axis=1).sum() for t in (ours, other)]
        assert area[0] == pytest.approx(area[1], rel=1e-6)
        np.testing.assert_allclose(ours.mean(axis=(0, 1)), other.mean(axis=(0, 1)), atol=1e-6)


def test_every_configuration_is_there_with_what_is_behind_its_plates():
    several = configurations()
    assert [case.name for case in several] == list(made_cases.CASES)
    for case in several:
        truth = made_cases.CASES[case.name]["truth"]
        assert len(case.plates) == len(case.truth) == len(truth["order"]) - bool(case.behind)
        assert case.counted.any()
        assert (case.errors(case.truth) == 0.0).all()
        np.testing.assert_allclose(case.errors(1.1 * case.truth), 0.1, rtol=1e-9)


def test_all_methods_on_a_bare_plate():
    report = Report("electrostatics")
    (case, *_) = configurations({"bare"})
    electrostatics.judge(report, [case])
    found = {row.method: row for row in report.tables[electrostatics.CASES]}
    assert len(found) == 1 + len(electrostatics.UNKNOWNS) + len(bem.LEVELS) + 1 + len(electrostatics.THESIS)
    assert not any(row.failed for row in found.values())
    reading = bem.read(case.unit(), case.placed())
    assert found["bem"].worst_error == pytest.approx(case.errors(reading.increase).max(), rel=1e-6)
    assert found["bem"].worst_error < found["bem f=1.5"].worst_error
    assert {goal.key: goal.verdict for goal in report.goals} == {
        "field.worst": "met",
        "field.median": "met",
        "field.covered": "met",
        "bem.worst": "met",
    }
    assert len(report.grids[electrostatics.EACH].lines) == 1 and len(report.plots) == 1


def test_a_motion_beside_the_reference_and_how_a_pose_grows(monkeypatch):
    monkeypatch.setattr(charge_motions, "ACCURACIES", (0.03, 0.1))
    monkeypatch.setattr(charge_motions, "_FRAMES", 64)
    report = Report("electrostatics")
    charge_motions.judge(report, frames=2, count=1)
    rows = {row.method: row for row in report.tables[charge_motions.MOVING]}
    assert rows["field, accuracy 3 %"].worst_error < 0.035 < rows["tree rtol 1e-06"].worst_error
    (keys,) = report.grids[charge_motions.KEYS].lines
    assert 5 <= keys["field, accuracy 10 %"] <= keys["field, accuracy 3 %"] < 64
    charge_motions.growth(report, sizes=2)
    assert len(report.tables["a pose of field"]) == 6


def test_motions_are_smooth_and_keep_off_the_plates():
    for name, T in charge_motions.motions(256).items():
        assert np.abs(np.diff(T[:, 1], axis=0)).max() < 0.02, name
        assert (T[:, 0] == np.identity(4)).all()
        lowest = T[:, 1, 2, 3] - np.abs(T[:, 1, 2, :3]) @ np.array([0.04, 0.06, 0.02])
        assert lowest.min() > 4.9e-3, name


def test_without_the_scenario_the_pace_is_not_measured():
    report = Report("electrostatics")
    charge_motions.pace(report, "no_such_scenario")
    assert [goal.verdict for goal in report.goals] == ["not measured"]
    assert report.tables[charge_motions.PACE][0].note
