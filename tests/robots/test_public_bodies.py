"""The collision bodies of public robots against pinocchio's reader: how many, where, how large."""

import importlib.util

import numpy as np
import pytest

from replay.errors import RobotError
from replay.geometry.mesh_file import read_faces
from replay.robots import checking
from replay.robots.importing import Options, run
from replay.robots.xml_text import parse
from tests.robots.public import descriptions

SINGLE = 1e-5
"""Of a mesh's size: both readers keep corners in single precision, and multiply matrices in it."""


@pytest.mark.soak
@pytest.mark.skipif(importlib.util.find_spec("pinocchio") is None, reason="pinocchio (extra `soak`) is not installed")
@pytest.mark.parametrize("description", descriptions(), ids=lambda path: "/".join(path.parts[-3:]))
def test_public_robots_have_the_bodies_that_pinocchio_reads(description, tmp_path):
    """COLLADA is not turned, as pinocchio leaves it. A robot that either reader refuses is not compared."""
    import pinocchio

    try:
        done = run(description, tmp_path / "part.yaml", Options(up_axis="ignore", copy_meshes=True))
    except RobotError as error:
        assert error.reason and "\n" not in str(error)
        return
    folders = [str(folder) for folder in description.parents[:6]]
    try:
        model = pinocchio.buildModelFromUrdf(str(description), mimic=True)
        kind = pinocchio.GeometryType.COLLISION
        geometry = pinocchio.buildGeomFromUrdf(model, str(description), kind, package_dirs=folders)
    except (ValueError, RuntimeError):  # what it does not read, or does not find
        pytest.skip("pinocchio does not read it")
    passed_over = {change.place.removeprefix("link ") for change in done.changes if "dropped" in change.what}  # is told
    passed_over.update(read_otherwise(description))
    links = checking.valid(done.file.read_text(), done.file, {}).links
    theirs = {}
    for body in geometry.geometryObjects:
        theirs.setdefault(model.frames[body.parentFrame].name, []).append(body)
    for link, called in done.part.called.items():
        if link in passed_over:
            continue
        bodies, shapes = theirs.get(link, []), list(links[called].shapes.values())
        assert len(bodies) == len(shapes), link
        frame = model.frames[model.getFrameId(link, pinocchio.FrameType.BODY)].placement
        for body, shape in zip(bodies, shapes, strict=True):
            placed = frame.inverse() * body.placement
            np.testing.assert_allclose(shape.pose.transform(), placed.homogeneous, atol=1e-12, err_msg=link)
            body.geometry.computeLocalAABB()
            box = body.geometry.aabb_local
            wanted = np.array([box.min_, box.max_])
            size = float(np.abs(wanted).max())
            np.testing.assert_allclose(ends(shape, tmp_path), wanted, rtol=0, atol=SINGLE * size, err_msg=link)


def read_otherwise(description):
    """Yield links of which pinocchio's reader takes nothing since their inertia is not whole, or makes capsules."""
    for link in parse(description, description.read_bytes(), root="robot").all("link"):
        inertial = link.first("inertial")
        halved = inertial is not None and (inertial.first("inertia") is None or inertial.first("mass") is None)
        if halved or link.first("collision_checking") is not None:  # an element of the project hpp
            yield link.text("name")


def ends(shape, folder):
    """Return the lowest and the highest corner (2, 3) of what a shape is, in its own frame."""
    match shape.type:
        case "mesh":
            points = read_faces(folder / shape.file)[0] * np.array(shape.scales)
            return np.array([points.min(axis=0), points.max(axis=0)])
        case "cuboid":
            half = 0.5 * np.array(shape.size)
        case "sphere":
            half = np.full(3, shape.radius)
        case "cylinder":
            half = np.array([shape.radius, shape.radius, 0.5 * shape.height])
        case "capsule":
            half = np.array([shape.radius, shape.radius, 0.5 * shape.height + shape.radius])
    return np.array([-half, half])
