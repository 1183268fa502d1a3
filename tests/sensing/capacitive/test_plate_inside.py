"""A plate in a body, or flush on one that it faces into, saturates; one that touches from outside is as before."""

import itertools

import numpy as np
import pytest

from replay.geometry import primitives
from replay.geometry.mesh import solid_from_triangles
from replay.kinematics.linkage import Joint, JointType, Link, Linkage
from replay.numerics import transforms
from replay.sensing.capacitive import CapacitiveSuite
from replay.sensing.capacitive.sensor import CapacitiveSensor, Plate
from replay.sensing.capacitive.suite import METHODS
from replay.sensing.target import make_target

CUBE = primitives.cube(1.0)
BALL = primitives.sphere(0.5, 1e-3)
SHELL = solid_from_triangles(np.concatenate([CUBE.triangles, 0.6 * CUBE.triangles[:, ::-1]]))
HOLED = solid_from_triangles(CUBE.triangles[1:])
SHEET = solid_from_triangles(CUBE.triangles[:2])
UP, DOWN = np.eye(3), np.diag([1.0, -1.0, -1.0])
ASIDE = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])  # its front looks along +x


def read(solid, places, turn=UP, *, half=(0.1, 0.05), method="tree", side="front", faces="all", offset=0.0):
    """Saturated and touching (n,) of a plate whose centre is at places (n, 3) of the body's frame."""
    base = transforms.from_rpy(np.array([0.3, -0.7, 1.1])) if offset else transforms.identity()
    base[:3, 3] = offset
    plate = transforms.identity(len(places))
    plate[:, :3, :3], plate[:, :3, 3] = turn, places
    free = np.stack([np.broadcast_to(base, plate.shape), transforms.compose(base, plate)], axis=1)
    links = [Link(name, None, transforms.identity(), Joint(name, JointType.FREE)) for name in ("body", "plate")]
    machine = Linkage(links)
    target = make_target("body/s", 0, solid.triangles, closing=solid.closing_of_inside)
    sensor = CapacitiveSensor(
        "c",
        1,
        (Plate("p", transforms.identity(), np.array(half)),),
        coupling=1e-10,
        side=side,
        faces=faces,
    )
    columns = CapacitiveSuite([sensor], [target], method=method).run(machine.forward(np.zeros((len(places), 0)), free))
    assert np.array_equal(columns.saturated, columns.output_voltage == 0.0)
    return columns.saturated[:, 0].tolist(), columns.touching[:, 0].tolist()


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(("side", "faces"), list(itertools.product(("front", "both"), ("all", "facing"))))
@pytest.mark.parametrize("offset", [0.0, 1e3])
def test_the_output_stays_0_while_a_plate_goes_into_a_body(method, side, faces, offset):
    # flush it was 0 V, and 10 mm further in 1.551 V
    heights = np.array([0.51, 0.5, 0.49, 0.2, 0.0, -0.49, -0.5, -0.51])
    places = np.column_stack([np.full((len(heights), 2), 0.07), heights])
    saturated, touching = read(CUBE, places, DOWN, method=method, side=side, faces=faces, offset=offset)
    # at the bottom the plate looks out of the body, on whose face its back lies flush
    assert saturated == [False, True, True, True, True, True, side == "both" and faces == "all", False]
    assert touching == [False, True, True, True, True, True, True, False]


@pytest.mark.parametrize("turn", [UP, DOWN, ASIDE])
def test_a_plate_that_is_partly_in_a_body_is_saturated(turn):
    places = np.array([[0.59, 0.01, 0.0], [0.5, 0.02, 0.0], [0.61, 0.0, 0.0], [0.3, 0.3, 0.3]])
    if turn is ASIDE:  # it goes in with an edge, from above
        places = places[:, [1, 2, 0]]
    for faces in ("all", "facing"):
        assert read(CUBE, places, turn, faces=faces) == ([True, True, False, True],) * 2


def test_a_plate_that_touches_from_outside_is_saturated_by_its_integral_alone():
    back = np.array([[0.0, 0.0, 0.5]])
    assert read(CUBE, back, UP) == ([False], [True])  # its back lies on the face
    edge = np.array([[0.0, 0.0, 0.6]])  # a plate on edge, upon the face: ASIDE turns its x down
    assert read(CUBE, edge, ASIDE) == ([True], [True])  # the face goes on before it: an edge on a face
    tip = primitives.cone(0.1, 0.3, 1e-3)
    top = tip.triangles[..., 2].max()
    for centre in ((0.0, 0.0), (0.03, 0.02)):  # a tip that touches the plate's front at one point
        assert read(tip, np.array([[*centre, top]]), DOWN) == ([False], [True])


def test_a_plate_in_a_cavity_is_outside_and_one_in_the_wall_is_inside():
    places = np.array([[0.0, 0.0, 0.0], [0.4, 0.0, 0.0], [0.0, 0.0, 0.3], [0.0, 0.0, -0.3]])
    # at the cavity's ceiling the plate faces into the wall, at its floor it lies with its back on it
    assert read(SHELL, places, UP, half=(0.05, 0.05)) == ([False, True, True, False], [False, True, True, True])


def test_open_bodies_have_an_inside_and_sheets_have_none():
    middle = np.array([[0.01, 0.02, 0.0]])
    assert read(HOLED, middle) == ([True], [True])
    assert read(SHEET, middle) == ([False], [False])
    for flush, turn in ((0.5, DOWN), (-0.5, UP)):
        height = np.array([[0.1, 0.2, flush]])
        assert read(CUBE, height, turn) == ([True], [True])
    assert read(SHEET, np.array([[0.1, 0.2, -0.5]]), UP) == ([False], [True])


def test_plates_in_a_ball_agree_with_its_radius():
    rng = np.random.default_rng(2)
    places = rng.uniform(-0.7, 0.7, (400, 3))
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    turn[2] *= np.linalg.det(turn)
    half = np.array([0.03, 0.02])
    corners = places[:, None] + np.array([[x, y, 0.0] for x in (-1, 1) for y in (-1, 1)]) * [*half, 0.0] @ turn.T
    distance = np.linalg.norm(corners, axis=2)
    saturated, touching = read(BALL, places, turn, half=half, side="both")
    inside, outside = (distance < 0.498).any(axis=1), np.linalg.norm(places, axis=1) > 0.55
    assert 0.1 < inside.mean() < 0.9
    assert np.array(saturated)[inside].all() and np.array(touching)[inside].all()
    assert not np.array(saturated)[outside].any() and not np.array(touching)[outside].any()
