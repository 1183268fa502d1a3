"""The fast method beside the shared cases, and what must not change a reading."""

from __future__ import annotations

from collections import OrderedDict

import numpy as np
import pytest

from replay.sensing.electrostatics import bem, surveys
from replay.sensing.electrostatics.body import ConductorBody
from replay.sensing.electrostatics.field import FieldSolver
from replay.sensing.electrostatics.suite import PANELS
from replay.sensing.electrostatics.unit import Electrode, Unit
from tests.sensing.electrostatics.made_cases import (
    CASES,
    PICO,
    box,
    icosphere,
    of_case,
    placed,
    rectangle,
    shifted,
)

QUICK = ("s_bare1", "s_bare2", "s_bare3")


def fast(electrodes: list[Electrode]) -> Unit:
    return Unit(electrodes, most_panels=PANELS["field"])


def check_case(name: str) -> None:
    case = CASES[name]
    unit, placement = of_case(case)
    truth = np.array(case["truth"]["dC_pF"])
    behind = case["electrodes"][0]["name"] in ("housing", "back")
    electrodes = list(unit.electrodes)
    if behind:  # what is behind the plates is the last electrode
        electrodes.append(electrodes.pop(0))
        order = [*range(1, len(truth)), 0]
        truth = truth[np.ix_(order, order)]
    found = FieldSolver(fast(electrodes), placement.bodies, behind=behind).read(placement)
    assert found is not None
    plates = len(truth) - behind
    value, error = PICO * found.increase[:plates, :plates], PICO * found.error[:plates, :plates]
    truth = truth[:plates, :plates]
    main = np.diag(truth).max()
    wrong = np.abs(value - truth)
    counts = np.diag(truth) > 0.1 * main
    relative = (np.diag(wrong) / np.diag(truth))[counts]
    assert relative.max() <= 3.5e-2 and np.median(relative) <= 1e-2
    assert (wrong / np.abs(truth))[np.abs(truth) > 0.1 * main].max() <= 3.5e-2
    doubt = np.array(case["truth"]["err_pF"]).max()
    assert (np.diag(wrong) <= np.diag(error) + doubt)[counts].all()


@pytest.mark.parametrize("name", QUICK)
def test_a_shared_case(name: str) -> None:
    check_case(name)


@pytest.mark.soak
@pytest.mark.parametrize("name", sorted(set(CASES) - set(QUICK)))
def test_any_shared_case(name: str) -> None:
    check_case(name)


def test_a_reading_does_not_depend_on_what_was_read_before(monkeypatch: pytest.MonkeyPatch) -> None:
    """Halves and influences are kept from pose to pose; whichever were made first, the bytes are the same."""
    plate = rectangle(0.06, 0.06)
    ball = ConductorBody("ball", (icosphere(0.05, 1),), 0.0)
    poses = []
    for height in (0.12, 0.06, 0.08, 0.055):
        pose = np.eye(4)
        pose[:3, 3] = [0.01, 0.0, height]
        poses.append(placed(ball, poses=[pose]))
    electrodes = [Electrode("plate", (plate,))]
    monkeypatch.setattr(surveys, "_trees", OrderedDict())
    found = [FieldSolver(fast(electrodes), [ball], behind=False).read(pose) for pose in poses]
    surveys._trees.clear()
    back = FieldSolver(fast(electrodes), [ball], behind=False)
    again = [back.read(pose) for pose in reversed(poses)][::-1]
    for each in surveys._trees.values():
        each.make_room(10**9)
    again.append(back.read(poses[-1]))
    found.append(found[-1])
    for a, b in zip(found, again, strict=True):
        assert a is not None and b is not None
        assert a.increase.tobytes() == b.increase.tobytes() and a.error.tobytes() == b.error.tobytes()


def test_shares_of_two_bodies_add_up_and_a_floating_one_reads_less() -> None:
    plate = rectangle(0.06, 0.06)
    unit = fast([Electrode("plate", (plate,))])
    near, far = shifted(rectangle(0.04, 0.04), 0.0, 0.0, 0.03), shifted(icosphere(0.03, 1), 0.08, 0.0, 0.05)
    found = []
    for earth in (np.inf, 0.0):
        bodies = (ConductorBody("near", (near,), earth), ConductorBody("far", (far,)))
        reading = FieldSolver(unit, bodies, behind=False).read(placed(*bodies))
        assert reading is not None
        assert reading.shares.sum(axis=0) == pytest.approx(reading.increase, rel=1e-9)
        found.append(reading.increase[0, 0])
    assert 0.0 < found[1] < 0.8 * found[0]


@pytest.mark.soak
@pytest.mark.parametrize("motion", ["approach", "slide", "tilt"])
def test_motions_are_within_their_error_of_the_reference(motion: str) -> None:
    plates = [shifted(rectangle(0.05, 0.1), x, 0.0, 0.0) for x in (-0.03, 0.03)]
    unit = Unit([Electrode(str(k), (plate,)) for k, plate in enumerate(plates)])
    body = ConductorBody("box", (box(0.08, 0.12, 0.04),), 0.0)
    solver = FieldSolver(fast([*unit.electrodes]), [body], behind=False)
    for s in np.linspace(0.0, 1.0, 20):
        pose = np.eye(4)
        pose[2, 3] = 0.02 + (0.2 * (1.0 - s) if motion == "approach" else 0.02)
        pose[0, 3] = 0.3 * (s - 0.5) if motion == "slide" else 0.0
        if motion == "tilt":
            angle = 0.6 * s
            pose[:3, :3] = [[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]]
            pose[2, 3] = 0.07
        placement = placed(body, poses=[pose])
        quick, reference = solver.read(placement), bem.read(unit, placement)
        assert quick is not None and reference is not None
        wrong = np.abs(quick.increase - reference.increase)
        allowed = np.sqrt(np.outer(*[reference.increase.diagonal()] * 2))
        assert (wrong <= 3.5e-2 * allowed).all()
        assert (wrong <= quick.error + reference.error)[np.diag_indices(2)].all()
