"""The rooms of the house and the direction of imports between them."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import replay
from replay.sensing.kinds import KINDS

PACKAGE = Path(replay.__file__).parent
ROOMS = (
    "errors",
    "lfs_pointer",
    "limits",
    "json_text",
    "numerics",
    "language",
    "geometry",
    "logs",
    "kinematics",
    "alignment",
    "collision",
    "sensing",
    "guarding",
    "scenario",
    "guarded",
    "simulation",
    "robots",
    "recording",
    "comparison",
    "batch",
    "bench",
    "cli",
)
ENTRANCES = ("__init__", "__main__")
STRANGERS = {("collision", "sensing"), ("sensing", "collision"), ("logs", "scenario"), ("kinematics", "logs")}
STRANGERS |= {("alignment", other) for other in ("language", "geometry", "logs", "kinematics")}


def room_of(path: Path) -> str:
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


def imported_rooms(path: Path) -> set[str]:
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        modules: list[str] = []
        if isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            modules = [node.module or ""]
            if node.module == "replay":
                modules = [f"replay.{alias.name}" for alias in node.names]
        elif isinstance(node, ast.Import):
            modules = [alias.name for alias in node.names]
        found |= {name.split(".")[1] for name in modules if name.startswith("replay.")}
    return found


@pytest.mark.parametrize("path", sorted(PACKAGE.rglob("*.py")), ids=lambda path: str(path.relative_to(PACKAGE)))
def test_a_room_imports_only_from_rooms_above_it(path):
    room = room_of(path)
    if room in ENTRANCES:
        return
    assert room in ROOMS, f"{path} stands in no room"
    for other in imported_rooms(path) & set(ROOMS):
        assert ROOMS.index(other) <= ROOMS.index(room), f"{path}: {room} must not import {other}"
        assert (room, other) not in STRANGERS, f"{path}: {room} and {other} do not know each other"


def test_import_replay_loads_nothing_heavy():
    heavy = ("numpy", "numba", "rerun", "trimesh", "scipy", "matplotlib", "pydantic")
    code = f"import sys, replay; print([m for m in {heavy} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_every_public_name_resolves():
    for name in replay.__all__:
        assert getattr(replay, name) is not None
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        _ = replay.nothing
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        _ = replay.geometry.nothing


@pytest.mark.parametrize(
    "name",
    [
        "geometry.bounds.fit_sphere",
        "geometry.bounds.fit_aabb",
        "geometry.bounds.fit_obb",
        "collision.gjk.intersect",
        "collision.gjk.distance",
        "sensing.distance.closest_in_cone",
        "sensing.capacitive.plate_integral",
        "sensing.capacitive.output_voltage",
    ],
)
def test_functions_of_the_contract_resolve_after_import_replay_alone(name):
    done = subprocess.run(
        [sys.executable, "-c", f"import replay; print(callable(replay.{name}))"],
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.strip() == "True"


OF_A_KIND = ("scenario/calibration.py",)  # fits one kind's constants to a measured curve


def names_in(path: Path) -> set[str]:
    """Return attributes, imported modules and texts that are more than part of a sentence."""
    tree = ast.parse(path.read_text())
    found = {node.attr for node in ast.walk(tree) if isinstance(node, ast.Attribute)}
    found |= {node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom) and node.module}
    return found | {
        node.value for node in ast.walk(tree) if isinstance(node, ast.Constant) and isinstance(node.value, str)
    }


@pytest.mark.parametrize("room", ["language", "scenario", "simulation", "recording", "comparison", "batch"])
def test_rooms_know_no_kind_of_sensor_by_name(room):
    paths = [PACKAGE / f"{room}.py"] if room == "simulation" else sorted((PACKAGE / room).rglob("*.py"))
    for path in paths:
        if str(path.relative_to(PACKAGE)) in OF_A_KIND:
            continue
        for kind in KINDS:
            forms = {kind, f"/{kind}", f"/{kind}/", f"{kind}_sensors"}
            named = {n for n in names_in(path) if n in forms or n.startswith(f"replay.sensing.{kind}")}
            assert not named, f"{path} knows {named}; loop over sensing.kinds instead"


@pytest.mark.parametrize("kind", KINDS)
def test_kinds_of_sensors_do_not_know_each_other(kind):
    others = [other for other in KINDS if other != kind]
    for path in sorted((PACKAGE / "sensing" / kind).rglob("*.py")):
        named = {n for n in names_in(path) for other in others if n.startswith(f"replay.sensing.{other}")}
        assert not named, f"{path} imports {named}"
