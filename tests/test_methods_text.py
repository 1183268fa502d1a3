"""The texts about the code are true of it: what they cite, name and point to is there, and no method goes untold."""

import functools
import importlib
import re
from pathlib import Path

import pytest

import replay
from replay.cli.main import COMMANDS
from replay.numerics.columns import Columns
from replay.scenario.methods import METHOD_REVISIONS
from replay.sensing.kinds import KINDS
from tests.test_architecture import ROOMS

PACKAGE = Path(replay.__file__).parent
ROOT = PACKAGE.parent
METHODS = PACKAGE / "METHODS.md"
TEXTS = [METHODS, PACKAGE / "README.md", ROOT / "tests" / "README.md"]
ENDINGS = ("py", "md", "yaml", "json", "jsonl", "proto")
SOURCES = [*PACKAGE.rglob("*.py"), *(ROOT / "tests").rglob("*.py")]
CITING = [*SOURCES, *TEXTS, ROOT / "README.md", *(ROOT / "schemas").iterdir(), *(ROOT / "scenarios").rglob("*.yaml")]

text = pytest.mark.parametrize("path", TEXTS, ids=lambda path: str(path.relative_to(ROOT)))


def sections() -> dict[str, str]:
    """Return the text of each section of METHODS by its number, those below it included."""
    parts = re.split(r"^##+ (\d+(?:\.\d+)*)\.? ", METHODS.read_text(encoding="utf-8"), flags=re.MULTILINE)
    own = dict(zip(parts[1::2], parts[2::2], strict=True))
    return {number: "".join(own[k] for k in own if k == number or k.startswith(f"{number}.")) for number in own}


def quoted(path: Path) -> list[str]:
    """Return what stands between backticks, code blocks left out."""
    prose = re.sub(r"^```.*?^```$", "", path.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE)
    return re.findall(r"`([^`]+)`", prose)


def is_there(name: str) -> bool:
    """Return whether a file or folder of that name is in the source tree; one without a folder may be anywhere."""
    if any((base / name).exists() for base in (ROOT, PACKAGE)):
        return True
    if Path(name).name in names_that_are_written():
        return True
    return "/" not in name and any(path.name == name for path in SOURCES)


@functools.cache
def names_that_are_written() -> frozenset[str]:
    """Return the names of files that the code writes: texts in its sources that end as files do."""
    pattern = r'"(?:\{\w+\})?([\w-]+\.(?:' + "|".join([*ENDINGS, "html", "xml", "parquet"]) + '))"'
    return frozenset(name for path in PACKAGE.rglob("*.py") for name in re.findall(pattern, path.read_text()))


def resolves(dotted: str) -> bool:
    """Return whether a dotted name below `replay` is a module, or something in one."""
    names = dotted.removeprefix("replay.").split(".")
    for split in range(len(names), -1, -1):
        try:
            found = importlib.import_module(".".join(["replay", *names[:split]]))
        except ModuleNotFoundError:
            continue
        for name in names[split:]:
            if not hasattr(found, name):
                return False
            found = getattr(found, name)
        return True
    return False


@functools.cache
def words_of_the_code() -> frozenset[str]:
    return frozenset(word for source in SOURCES if source != Path(__file__) for word in words_in(source))


def words_in(source: Path) -> list[str]:
    return re.findall(r"\w+", source.read_text(encoding="utf-8"))


def test_every_section_that_is_cited_exists():
    known = sections()
    cited = [
        (number, str(path.relative_to(ROOT)))
        for path in CITING
        for number in re.findall(r"\bMETHODS (\d+(?:\.\d+)*)", path.read_text(encoding="utf-8"))
    ]
    assert len(cited) > 5
    assert [place for place in cited if place[0] not in known] == []


def test_every_version_of_a_method_is_described():
    known = sections()
    rows = dict(re.findall(r"^\| `([\w.]+)` \| (\d+(?:\.\d+)*) \|", METHODS.read_text(encoding="utf-8"), re.MULTILINE))
    foreign = {kind.name for kind in KINDS.values() if not type(kind).__module__.startswith("replay.")}
    assert rows.keys() == {version for version in METHOD_REVISIONS if version.partition(".")[0] not in foreign}
    for version, section in rows.items():
        word = version.rpartition(".")[2]
        assert f"`{word}`" in known[section], f"METHODS {section} does not say what {version} is"


@text
def test_every_file_and_folder_that_a_text_names_is_there(path):
    pattern = rf"(?<![\w./-])[\w-]+(?:/[\w-]+)*\.(?:{'|'.join(ENDINGS)})\b"
    named = set(re.findall(pattern, path.read_text(encoding="utf-8")))
    named |= {word for word in quoted(path) if re.fullmatch(r"[\w-]+/([\w-]+/)*", word)}
    assert len(named) > 10
    placeholders = {name for name in named if Path(name).stem.isupper() and not is_there(name)}
    assert placeholders <= {"cli/NAME.py", "NEW.yaml", "PART.yaml"}
    assert sorted(name for name in named - placeholders if not is_there(name)) == []


@text
def test_every_name_of_the_code_that_a_text_gives_is_one(path):
    words = set(quoted(path))
    dotted = {
        word
        for word in words
        if re.fullmatch(r"[a-z_]\w*(\.\w+)+", word)
        and word.rpartition(".")[2] not in ENDINGS
        and word not in METHOD_REVISIONS
        and word not in names_that_are_written()
    }
    assert sorted(name for name in dotted if not resolves(name)) == []
    assert sorted({word for word in words if re.fullmatch(r"[A-Za-z_]\w*", word)} - words_of_the_code()) == []


@text
def test_every_command_and_target_that_a_text_gives_is_one(path):
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    for word in quoted(path):
        first, _, rest = word.partition(" ")
        if first == "replay" and rest:
            assert rest.split()[0] in COMMANDS, word
        if first == "make" and rest:
            assert re.search(rf"^{rest.split()[0]}:.*##", makefile, re.MULTILINE), word


def test_the_rooms_are_listed_in_the_order_of_imports():
    found = re.findall(r"^\| `(\w+)(?:/|\.py)` \|", (PACKAGE / "README.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert tuple(found) == ROOMS


def test_a_name_that_is_none_is_noticed():
    assert resolves("collision.gjk.distance")
    assert resolves("replay.read")
    assert resolves(f"numerics.columns.{Columns.__name__}")
    assert not resolves("collision.gjk.distances_of_all")
    assert not resolves("collision.no_such_module.thing")
    assert is_there("geometry/mesh.py")
    assert not is_there("geometry/no_such_file.py")
