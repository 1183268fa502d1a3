"""Where the files of a description are looked for, and what the part calls them."""

from pathlib import Path

import numpy
import pytest

from replay.errors import RobotError
from replay.robots.importing import Options, run
from replay.robots.meshes import _in_python_package
from replay.robots.packages import Packages
from replay.robots.xml_text import XmlElement
from tests.robots import made
from tests.robots.test_part import STL

AT = XmlElement("mesh", {}, "r.urdf", 7)


def put(path):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(STL)
    return path


def found(folder, written, given=(), **environment):
    packages = Packages(folder / "r.urdf", dict(given), {name: str(path) for name, path in environment.items()})
    return packages.find(written, AT)


@pytest.mark.parametrize(
    ("description", "mesh"),
    [
        ("robot/urdf", "robot/meshes/a.stl"),  # the package is the folder of that name above
        ("other/urdf", "robot/meshes/a.stl"),  # it is beside
        ("install/bringup/share/bringup", "install/robot/share/robot/meshes/a.stl"),  # an install tree of ROS 2
        ("share/bringup/urdf", "share/robot/meshes/a.stl"),  # or one that was merged
        ("ws/src/bringup", "ws/src/robot/meshes/a.stl"),
    ],
)
def test_packages_are_found_in_the_descriptions_own_tree(description, mesh, tmp_path):
    path = put(tmp_path / mesh)
    (tmp_path / description).mkdir(parents=True, exist_ok=True)
    here = found(tmp_path / description, "package://robot/meshes/a.stl")
    assert here.path == path and not here.assumed


def test_packages_are_found_by_their_manifest_and_where_ros_says(tmp_path):
    path = put(tmp_path / "x" / "folder" / "meshes" / "a.stl")
    (tmp_path / "x" / "folder" / "package.xml").write_text("<package><name>robot</name></package>")
    (tmp_path / "y" / "urdf").mkdir(parents=True)
    written = "package://robot/meshes/a.stl"
    assert found(tmp_path / "x" / "folder" / "urdf", written).path == path
    assert found(tmp_path / "y" / "urdf", written, ROS_PACKAGE_PATH=tmp_path / "x").path == path
    installed = put(tmp_path / "opt" / "share" / "robot" / "meshes" / "a.stl")
    assert found(tmp_path / "y" / "urdf", written, AMENT_PREFIX_PATH=tmp_path / "opt").path == installed
    assert (
        found(tmp_path / "y" / "urdf", written, {"robot": tmp_path / "x" / "folder"}).path == path
    )  # given ones first


def test_files_of_python_packages_are_called_by_their_package():
    """Not one of a folder beside the packages that is none, nor one outside."""
    site = Path(numpy.__file__).parents[1]
    assert _in_python_package(site / "numpy" / "testing" / "a.stl") == "package://numpy/testing/a.stl"
    assert _in_python_package(site / "cmeel.prefix" / "a.stl") is None
    assert _in_python_package(site / "no_such_package" / "a.stl") is None
    assert _in_python_package(site / "a.stl") is None
    assert _in_python_package(site.parent / "numpy" / "a.stl") is None


def test_a_tree_that_lost_the_name_of_its_package_is_told(tmp_path):
    path = put(tmp_path / "moved" / "meshes" / "a.stl")
    here = found(tmp_path / "moved" / "urdf", "package://robot/meshes/a.stl")
    assert here.path == path and here.assumed == f"package robot is taken to be {tmp_path / 'moved'}"


@pytest.mark.parametrize(
    ("written", "mesh", "taken"),
    [
        (
            "package://lab/models/robot/meshes/a.stl",
            "robot/meshes/a.stl",
            "package lab/models/robot is taken to be {}/robot",
        ),
        ("package://collision/a.stl", "robot/meshes/x/collision/a.stl", "{}/robot/meshes/x/collision"),
    ],
)
def test_a_tree_that_was_moved_in_part_is_told(written, mesh, taken, tmp_path):
    path = put(tmp_path / mesh)
    here = found(tmp_path / "robot" / "urdf", written)
    assert here.path == path and here.assumed.endswith(taken.format(tmp_path))


def test_a_path_from_the_folder_of_many_robots_on_is_found_and_told(tmp_path):
    mesh = put(tmp_path / "all" / "robot" / "meshes" / "a.stl")
    here = tmp_path / "all" / "robot" / "urdf"
    here.mkdir()
    told = found(here, "robot/meshes/a.stl")
    assert (told.path, told.assumed) == (mesh, f"robot/ is taken to be {tmp_path / 'all' / 'robot'}")


def test_a_path_from_a_folder_above_the_description_on_is_found_and_told(tmp_path):
    mesh = put(tmp_path / "robot" / "meshes" / "a.stl")
    here = tmp_path / "robot" / "urdf"
    here.mkdir()
    told = found(here, "meshes/a.stl")
    assert (told.path, told.assumed) == (mesh, f"meshes/ is taken to be {tmp_path / 'robot' / 'meshes'}")
    near = put(here / "meshes" / "a.stl")  # what is beside the description comes first
    assert (found(here, "meshes/a.stl").path, found(here, "meshes/a.stl").assumed) == (near, "")
    put(tmp_path / "b.stl")
    for other in ("../b.stl", "b.stl", "x/../../b.stl"):
        with pytest.raises(RobotError, match="is not to be found; looked for"):
            found(here, other)
    nearer = put(here / "robot" / "meshes" / "a.stl")
    assert found(here, "robot/meshes/a.stl").path == nearer and not found(here, "robot/meshes/a.stl").assumed
    for written in ("robot/meshes/b.stl", "other/meshes/a.stl"):
        with pytest.raises(RobotError, match="is not to be found; looked for "):
            found(here, written)


def test_a_folder_that_is_there_twice_is_no_package(tmp_path):
    for kind in "xy":
        put(tmp_path / "robot" / "meshes" / kind / "collision" / "a.stl")
    with pytest.raises(RobotError, match=r"is in each of .*; say in which with --package collision=DIR"):
        found(tmp_path / "robot" / "urdf", "package://collision/a.stl")


def test_what_is_not_found_says_where_it_was_looked_for(tmp_path):
    (tmp_path / "robot").mkdir()
    with pytest.raises(RobotError) as caught:
        found(tmp_path / "robot" / "urdf", "package://robot/a.stl")
    looked = f"looked for {tmp_path}/robot/a.stl; give its folder with --package robot=DIR"
    assert str(caught.value) == f"r.urdf:7: 'package://robot/a.stl' is not to be found: {looked}"
    (tmp_path / "r.urdf").write_text(made.robot(made.link("a")))
    for wrong in ("robot", "robot=", "=x", f"robot={tmp_path}/nowhere"):
        with pytest.raises(RobotError, match="--package"):
            run(tmp_path / "r.urdf", tmp_path / "p.yaml", Options(packages=[wrong]))


@pytest.mark.parametrize(
    "written",
    ["a" * 300 + ".stl", f"package://{'a' * 300}/a.stl", f"package://robot/{'a' * 300}.stl", "a/" * 3000 + "a.stl"],
)
def test_names_that_no_file_can_have_are_refused(written, tmp_path):
    (tmp_path / "robot").mkdir()
    with pytest.raises(RobotError, match=r"r\.urdf:7: 'a?.* cannot be looked for: File name too long") as caught:
        found(tmp_path / "robot", written)
    assert len(str(caught.value)) < 400


@pytest.mark.parametrize("written", ["circle.stl", "circle.stl/a.stl", "package://robot/circle.stl"])
def test_links_that_go_in_a_circle_are_no_mesh(written, tmp_path):
    (tmp_path / "robot").mkdir()
    (tmp_path / "robot" / "circle.stl").symlink_to("circle.stl")
    with pytest.raises(RobotError, match="is not to be found"):
        found(tmp_path / "robot", written)


def test_a_mesh_that_may_not_be_read_is_one_line(tmp_path, monkeypatch):
    put(tmp_path / "a.stl")
    (tmp_path / "r.urdf").write_text(made.robot(made.link("a", '<mesh filename="a.stl"/>')))

    whole = Path.open

    def refused(path, *mode):
        if path.suffix == ".stl":
            raise PermissionError(13, "Permission denied", str(path))
        return whole(path, *mode)

    monkeypatch.setattr("pathlib.Path.open", refused)
    with pytest.raises(RobotError, match=r"'a\.stl' cannot be read: Permission denied"):
        run(tmp_path / "r.urdf", tmp_path / "p.yaml", Options())


def test_meshes_are_named_in_place_or_copied(tmp_path):
    put(tmp_path / "robot" / "meshes" / "a.stl")
    mesh = '<mesh filename="package://robot/meshes/a.stl"/>'
    (tmp_path / "robot" / "r.urdf").write_text(made.robot(made.link("a", mesh)))
    parts = tmp_path / "parts"
    done = run(tmp_path / "robot" / "r.urdf", parts / "p.yaml", Options())
    assert "file: ../robot/meshes/a.stl" in done.file.read_text().replace('"', "") and not done.meshes
    assert f"must stand in {tmp_path}, or above" in str(done.changes[0])
    done = run(tmp_path / "robot" / "r.urdf", parts / "p.yaml", Options(copy_meshes=True))
    assert "file: p/a.stl" in done.file.read_text() and (parts / "p" / "a.stl").read_bytes() == STL
    done = run(tmp_path / "robot" / "r.urdf", tmp_path / "p.yaml", Options())
    assert "file: robot/meshes/a.stl" in done.file.read_text() and not done.changes
