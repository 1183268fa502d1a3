"""What bodies change at a unit: the shared cases, and what must hold whatever the mesh."""

from __future__ import annotations

import numpy as np
import pytest

from replay.errors import InvalidValue
from replay.sensing.electrostatics import bem
from replay.sensing.electrostatics.body import ConductorBody
from replay.sensing.electrostatics.placement import PosedBodies
from replay.sensing.electrostatics.unit import Electrode, Unit
from tests.sensing.electrostatics.made_cases import CASES, PICO, icosphere, of_case, placed, rectangle, shifted

QUICK = ("s_bare2", "s_bare3")


def check_case(name: str) -> None:
    case = CASES[name]
    unit, placement = of_case(case)
    found = bem.read(unit, placement)
    assert found is not None
    truth, doubt = np.array(case["truth"]["dC_pF"]), np.array(case["truth"]["err_pF"])
    value, error = PICO * found.increase, PICO * found.error
    diagonal = np.diag(truth)
    counts = diagonal > 0.02 * diagonal.max()
    assert (np.abs(np.diag(value) - diagonal) <= 6e-3 * diagonal + np.diag(doubt))[counts].all()
    assert (np.abs(value - truth) <= error + doubt)[np.diag_indices(len(truth))][counts].all()
    main = np.max(diagonal[1:]) if len(diagonal) > 1 else diagonal[0]
    large = np.abs(truth) > 0.1 * main
    assert np.abs(value / truth - 1.0)[large].max() < 1.5e-2
    alone = PICO * unit.matrix
    assert np.diag(alone) == pytest.approx(np.diag(case["truth"]["C0_pF"]), rel=3e-3)


@pytest.mark.parametrize("name", QUICK)
def test_a_shared_case(name: str) -> None:
    check_case(name)


@pytest.mark.soak
@pytest.mark.parametrize("name", sorted(set(CASES) - set(QUICK)))
def test_any_shared_case(name: str) -> None:
    check_case(name)


def two_plates() -> Unit:
    return Unit(
        [Electrode(name, (shifted(rectangle(0.06, 0.06), x, 0.0, 0.0),)) for name, x in (("a", -0.04), ("b", 0.04))]
    )


def test_a_floating_body_is_neutral_and_every_increase_symmetric_and_above_0() -> None:
    unit = two_plates()
    placement = placed(ConductorBody("ball", (shifted(icosphere(0.03, 2), 0.01, 0.0, 0.06),), 0.0), gap=0.03)
    found = bem.level(unit, placement, 1.5)
    assert found is not None
    response = found[0]
    assert np.abs(response.charges.sum(axis=1)).max() < 1e-12 * np.abs(response.charges).sum(axis=1).min()
    assert (response.increase == response.increase.T).all()
    assert np.linalg.eigvalsh(response.increase).min() > 0.0


def test_a_floating_sphere_around_a_sphere_changes_nothing_and_a_grounded_one_what_the_closed_form_says() -> None:
    unit = Unit([Electrode("ball", (icosphere(0.01, 2),))])
    shell = icosphere(0.03, 2)
    floating, grounded = (
        bem.level(unit, placed(ConductorBody("shell", (shell,), earth)), 1.5) for earth in (0.0, np.inf)
    )
    assert floating is not None and grounded is not None
    increase = grounded[0].increase[0, 0]
    assert increase == pytest.approx(0.01 * 0.03 / 0.02 - 0.01, rel=3e-2)  # of spheres; these have facets
    assert abs(floating[0].increase[0, 0]) < 3e-5 * increase


def test_nothing_is_felt_behind_a_grounded_shell() -> None:
    unit = Unit([Electrode("ball", (icosphere(0.01, 1),))])
    shell = ConductorBody("shell", (icosphere(0.03, 2),))
    outside = ConductorBody("outside", (shifted(icosphere(0.02, 1), 0.08, 0.0, 0.0),))
    alone, both = (bem.level(unit, placed(*bodies), 1.5) for bodies in ((shell,), (shell, outside)))
    assert alone is not None and both is not None
    assert both[0].increase[0, 0] == pytest.approx(alone[0].increase[0, 0], rel=1e-4)
    assert abs(both[0].shares[1, 0, 0]) < 1e-3 * both[0].increase[0, 0]


def test_earth_goes_from_floating_to_grounded_and_shares_add_up() -> None:
    unit = two_plates()
    shapes = (shifted(icosphere(0.03, 2), 0.0, 0.0, 0.06), rectangle(0.05, 0.05, 0.12))
    found = [
        bem.level(unit, placed(ConductorBody("both", shapes, earth)), 1.5) for earth in (0.0, 0.01, 1.0, 1e6, np.inf)
    ]
    readings = [each[0] for each in found if each is not None]
    values = [reading.increase[0, 0] for reading in readings]
    assert values == sorted(values) and values[0] < 0.9 * values[-1]
    assert values[3] == pytest.approx(values[4], rel=1e-4)
    for reading in readings:
        assert reading.shares.sum(axis=0) == pytest.approx(reading.increase, rel=1e-12)


def test_bodies_that_touch_are_one_conductor() -> None:
    unit = two_plates()
    halves = [shifted(rectangle(0.04, 0.08, 0.03), x, 0.0, 0.0) for x in (-0.02, 0.02)]
    one = bem.level(unit, placed(ConductorBody("whole", (np.concatenate(halves),), 0.0)), 1.5)
    parts = tuple(ConductorBody(str(k), (half,), 0.0) for k, half in enumerate(halves))
    two = bem.level(unit, PosedBodies(parts, [np.eye(4)] * 2, np.zeros(2, np.int64), 5e-3), 1.5)
    apart = bem.level(unit, placed(*parts), 1.5)
    assert one is not None and two is not None and apart is not None
    assert two[0].increase == pytest.approx(one[0].increase, rel=3e-2)  # of two meshes of one coarse level
    assert apart[0].increase[0, 0] < 0.8 * two[0].increase[0, 0]


def test_a_shape_that_is_there_twice_counts_once() -> None:
    unit = two_plates()
    plate = rectangle(0.06, 0.06, 0.03)
    once = bem.level(unit, placed(ConductorBody("once", (plate,))), 1.5)
    twice = bem.level(
        unit, placed(ConductorBody("twice", (plate, plate[::-1], np.concatenate([plate, plate[:, ::-1]])))), 1.5
    )
    assert once is not None and twice is not None
    assert twice[0].increase == pytest.approx(once[0].increase, rel=1e-12)


def test_more_unknowns_than_fit_are_refused_with_their_number(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bem, "MOST_UNKNOWNS", 50)
    with pytest.raises(InvalidValue, match=r"unknowns of method bem = \d+: must be at most 50"):
        bem.read(two_plates(), placed(ConductorBody("ball", (shifted(icosphere(0.03, 2), 0.0, 0.0, 0.06),))))
