"""Mesh files inside installed Python packages, found without importing them."""

import sys

import pytest

from replay.errors import ScenarioError
from replay.scenario.load import load

HEAD = "version: 1\nname: a\nrate: 60 Hz\nduration: 1 s\n"


@pytest.fixture
def body_package(tmp_path, monkeypatch):
    folder = tmp_path / "site" / "body_package_of_this_test"
    (folder / "data" / "all.stl").mkdir(parents=True)
    (folder / "__init__.py").write_text("raise RuntimeError('imported')\n")
    (folder / "data" / "body.stl").write_bytes(b"mesh")
    (folder / "data" / "out.stl").symlink_to(__file__)
    monkeypatch.syspath_prepend(tmp_path / "site")
    return folder.name


def load_mesh_of(tmp_path, file):
    path = tmp_path / "main.yaml"
    path.write_text(f"{HEAD}links: {{x: {{shapes: {{m: {{type: mesh, file: '{file}', scale: 1}}}}}}}}\n")
    return load(path)


def test_a_package_is_found_and_not_imported(tmp_path, body_package):
    name = f"package://{body_package}/data/body.stl"
    scenario = load_mesh_of(tmp_path, name)
    assert scenario.sources[name] == b"mesh"
    assert body_package not in sys.modules


@pytest.mark.parametrize(
    ("file", "reason"),
    [
        ("package://{}/data/bodi.stl", "does not exist in the package '{}'; did you mean 'body.stl'?"),
        ("package://{}/data/all.stl", "is a folder; name a file"),
        ("package://{}/data/out.stl", "is a link that leads out of the package '{}'"),
        ("package://{}/data", "must end in .stl, .obj, .ply or .glb; save the mesh as one of these"),
        ("package://{}/../x.stl", "is not of the form package://PYTHON_PACKAGE/path/inside/it"),
        ("package://nobody_has_this/x.stl", "needs the Python package 'nobody_has_this', which is not installed; "
         "install what brings it or, where 'nobody_has_this' is a ROS package, copy the file into the scenario's "
         "folder and write its path"),
        ("package://this/x.stl", "names 'this', which is a single module without files"),
        ("package://x.y/x.stl", "is not of the form package://PYTHON_PACKAGE/path/inside/it"),
    ],
)  # fmt: skip
def test_what_is_not_there_says_what_works(tmp_path, body_package, file, reason):
    file, reason = file.format(body_package), reason.format(body_package)
    with pytest.raises(ScenarioError) as caught:
        load_mesh_of(tmp_path, file)
    assert str(caught.value) == f"{tmp_path}/main.yaml:5:44: links.x.shapes.m.file = {file!r} {reason}"


def test_names_that_no_file_can_have_are_refused(tmp_path, body_package):
    (tmp_path / "circle.stl").symlink_to("circle.stl")
    (tmp_path / "site" / body_package / "circle.stl").symlink_to("circle.stl")
    for file, reason in (
        ("a" * 300 + ".stl", "cannot be read: File name too long"),
        (f"package://{body_package}/{'a' * 300}.stl", "cannot be read: File name too long"),
        ("circle.stl", "cannot be read: Too many levels of symbolic links"),
        ("circle.stl/x.stl", "cannot be read: Too many levels of symbolic links"),
        (f"package://{body_package}/circle.stl", "does not exist in the package"),
    ):
        with pytest.raises(ScenarioError, match=f"main.yaml:5:44: .*{reason}"):
            load_mesh_of(tmp_path, file)


def test_the_phantoms_say_how_to_get_them(tmp_path, monkeypatch):
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(ScenarioError, match="get it with: pip install --no-deps pyskindose"):
        load_mesh_of(tmp_path, "package://pyskindose/x.stl")
