"""The identity of the code: what a change of it has to be noticed for, and what may change while a run is resumed."""

import shutil
from pathlib import Path

import pytest

import replay
from replay.recording.provenance import code_identity, identity_of

PACKAGE = Path(replay.__file__).parent
ROOMS = sorted({path.relative_to(PACKAGE).parts[0] for path in PACKAGE.rglob("*.py")})


@pytest.fixture
def package(tmp_path):
    copy = tmp_path / "replay"
    shutil.copytree(PACKAGE, copy, ignore=shutil.ignore_patterns("__pycache__"))
    return copy


def test_the_identity_is_the_same_wherever_the_package_is(package):
    (package / "cli" / "__pycache__").mkdir()
    (package / "numerics" / "__pycache__").mkdir()
    (package / "numerics" / "__pycache__" / "left.py").write_text("behind = 1\n")
    (package / "README.md").write_text("no code")
    assert identity_of(package) == code_identity()


@pytest.mark.parametrize("room", ROOMS)
def test_the_identity_depends_on_every_room_but_bench_and_cli(package, room):
    file = package / room
    if file.is_dir():
        file = max(file.rglob("*.py"), key=lambda path: len(path.parts))
    file.write_text(file.read_text() + "# a change\n")
    assert (identity_of(package) == code_identity()) == (room in ("bench", "cli"))


def test_the_identity_depends_on_names_of_files_and_where_they_stand(package):
    (package / "numerics" / "gauss.py").rename(package / "numerics" / "bench.py")
    moved = identity_of(package)
    (package / "numerics" / "cli").mkdir()
    (package / "numerics" / "bench.py").rename(package / "numerics" / "cli" / "bench.py")
    assert len({code_identity(), moved, identity_of(package)}) == 3


@pytest.mark.parametrize("room", ["bench", "cli"])
def test_an_edit_of_a_room_without_results_resumes(package, room):
    (package / room / "new.py").write_text("x = 1\n")
    assert identity_of(package) == code_identity()
    shutil.rmtree(package / room)
    assert identity_of(package) == code_identity()
