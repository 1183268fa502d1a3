"""Where the links of an imported robot are, against an independent reader and, where it is installed, pinocchio."""

import importlib.util

import numpy as np
import pytest

from replay.errors import RobotError
from replay.robots import checking
from replay.robots.importing import Options, run
from replay.scenario.script import linkage
from tests.robots import made
from tests.robots.public import descriptions, semantics
from tests.robots.reader import Reader, disabled

BOUND = 1e-12
"""Of the reach of the robot; 170 robots of public packages are within 3e-15."""


def imported(description, folder, **options):
    done = run(description, folder / "part.yaml", Options(**options))
    return done, linkage(checking.valid(done.file.read_text(), done.file, {}))


def poses(machine, samples):
    positions = checking.random_positions(machine, samples)
    free = np.broadcast_to(np.eye(4), (samples, len(machine.free_names), 4, 4)).copy()
    return positions, machine.forward(positions, free).world


@pytest.mark.parametrize("seed", range(8))
def test_links_are_where_an_independent_reader_has_them(seed, tmp_path):
    path = tmp_path / "r.urdf"
    path.write_text(made.urdf(seed))
    _, machine = imported(path, tmp_path)
    reader = Reader(path)
    positions, world = poses(machine, 10)
    assert machine.link_names == tuple(sorted(reader.links))
    for sample, q in enumerate(positions):
        given = dict(zip(machine.joint_names, q, strict=True))
        for name in machine.followers:
            assert given[name] == pytest.approx(reader.position(name, given), abs=1e-14)
        for k, name in enumerate(machine.link_names):
            np.testing.assert_allclose(world[sample, k], reader.pose(name, given), rtol=0, atol=BOUND)


def test_a_chain_of_joints_that_follow_adds_up(tmp_path):
    """c follows b, which follows a: where a is 0.4, c is 2 (0.5 0.4 + 0.2) + 0.1 = 0.9, and not 2 0.2 + 0.3 = 0.7."""
    path = tmp_path / "r.urdf"
    turn = '<axis xyz="0 0 1"/><limit lower="-3" upper="3" velocity="1" effort="1"/>'
    path.write_text(
        made.robot(
            *(made.link(name) for name in ("base", "x", "y", "z")),
            made.joint("a", "base", "x", "revolute", turn),
            made.joint("b", "base", "y", "revolute", turn + '<mimic joint="a" multiplier="0.5" offset="0.2"/>'),
            made.joint("c", "base", "z", "revolute", turn + '<mimic joint="b" multiplier="2" offset="0.1"/>'),
        )
    )
    _, machine = imported(path, tmp_path)
    np.testing.assert_allclose(machine.followed(np.array([[0.4, 0.0, 0.0]])), [[0.4, 0.4, 0.9]], rtol=1e-15)


@pytest.mark.soak
@pytest.mark.parametrize("description", descriptions(), ids=lambda path: "/".join(path.parts[-3:]))
def test_public_robots_are_read_as_pinocchio_reads_them_or_refused(description, tmp_path):
    """Link poses, and the SRDF pairs of those that have one; a refusal names the file and says why."""
    beside = semantics(description)
    try:
        done, machine = imported(description, tmp_path, srdf=beside)
    except RobotError as error:
        assert error.reason and "\n" not in str(error)
        return
    positions, world = poses(machine, 100)
    if beside is not None:
        bodies = {name for name, entry in done.part.links.items() if "shapes" in entry}
        wanted = {pair for pair in disabled(beside) if pair <= bodies}
        kept = {frozenset((a, b)) for a, b, reason in done.part.disabled if reason != "rigid to each other"}
        rigid = {frozenset((a, b)) for a, b, reason in done.part.disabled if reason == "rigid to each other"}
        assert kept == wanted and not rigid & wanted
    if importlib.util.find_spec("pinocchio") is None or machine.free_names:
        reader = Reader(description)
        for sample in range(0, 100, 10):
            given = dict(zip(machine.joint_names, positions[sample], strict=True))
            for k, name in enumerate(machine.link_names):
                link = next(link for link, called in done.part.called.items() if called == name)
                np.testing.assert_allclose(world[sample, k], reader.pose(link, given), rtol=0, atol=BOUND)
        return
    import pinocchio

    try:
        model = pinocchio.buildModelFromUrdf(str(description), mimic=True)
    except ValueError:  # what it does not read, such as joints that follow over branches
        return
    data = model.createData()
    reach = max(1.0, float(np.abs(world[..., :3, 3]).max()))
    for sample in range(100):
        q = pinocchio.neutral(model)
        for name, joint in zip(model.names, model.joints, strict=True):
            if name in machine.joint_names and joint.nq and name not in machine.followers:
                value = positions[sample, machine.joint_names.index(name)]
                q[joint.idx_q : joint.idx_q + joint.nq] = value if joint.nq == 1 else [np.cos(value), np.sin(value)]
        pinocchio.framesForwardKinematics(model, data, q)
        for link, called in done.part.called.items():
            expected = data.oMf[model.getFrameId(link, pinocchio.FrameType.BODY)].homogeneous
            found = world[sample, machine.link_names.index(called)]
            np.testing.assert_allclose(found, expected, rtol=0, atol=BOUND * reach)
