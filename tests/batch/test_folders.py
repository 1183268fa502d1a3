"""What is found in folders, whatever the case of names and behind whichever links; and names that are one elsewhere."""

import os
import unicodedata

import pytest

from replay.batch.baseline import LOG
from replay.batch.folders import look_through
from replay.batch.judged import REPORTS
from replay.batch.reports import HISTORY
from replay.batch.select import Selection, find_scenarios, left_out, load_all
from replay.comparison.run_folder import RUN
from replay.errors import InvalidValue, ScenarioError

SCENARIO = "version: 1\nname: {name}\nrate: 10\nduration: 1\nlinks: {{box: {{}}}}\n"
POINTER = "version https://git-lfs.github.com/spec/v1\noid sha256:4d7a21\nsize 12345\n"


def write(path, name):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(SCENARIO.format(name=name), encoding="utf-8")
    return path


def test_upper_case_endings_are_found(tmp_path):
    files = [write(tmp_path / name, name[0]) for name in ("a.yaml", "b.YML", "c.Yaml", "d.yml")]
    (tmp_path / "e.yaml.bak").write_text("version: 1\n")
    assert find_scenarios([tmp_path]) == files


def test_linked_folders_are_looked_through_once(tmp_path):
    folder = tmp_path / "night"
    inside = write(folder / "real" / "b.yaml", "b")
    far = write(tmp_path / "elsewhere" / "deep" / "a.yaml", "a")
    (folder / "again").symlink_to("real")  # sorted before the folder that it leads to
    (folder / "far").symlink_to("../elsewhere")
    (folder / "far_too").symlink_to("../elsewhere/deep")
    (tmp_path / "elsewhere" / "back").symlink_to(folder)
    assert look_through(folder).files == [folder / "far" / "deep" / far.name, inside]
    assert look_through(folder).left_out == []
    (alias := tmp_path / "alias").symlink_to(folder)
    assert look_through(alias).files == [alias / "far" / "deep" / "a.yaml", alias / "real" / "b.yaml"]


def test_what_is_left_out_is_said(tmp_path):
    folder = tmp_path / "night"
    inside = write(folder / "a.yaml", "a")
    (folder / "share").symlink_to("/nowhere/at/all")
    (folder / "up").symlink_to("..")
    os.mkfifo(folder / "pipe.yaml")
    assert find_scenarios([folder]) == [inside]
    assert [line.removeprefix(f"{folder}/") for line in left_out([folder, inside])] == [
        "pipe.yaml is left out: it is a pipe or a device",
        "share is left out: it is a link to nothing that is there",
        "up is left out: it is a link to a folder that it stands in",
    ]


def test_a_file_that_cannot_be_read_is_told_and_not_left_out(tmp_path):
    write(tmp_path / "good.yaml", "good")
    (tmp_path / "gone.yaml").symlink_to("nothing.yaml")
    (tmp_path / "large.yaml").write_text(POINTER)
    found = Selection.of([tmp_path], [], None)
    assert [scenario.name for scenario in found.chosen] == ["good"]
    assert {name: str(error).partition(": ")[2] for name, error in found.invalid.items()} == {
        "gone": "is a link to a file that does not exist",
        "large": "is a Git LFS pointer, not the file that it stands for; get that with: git lfs pull",
    }
    with pytest.raises(ScenarioError, match="Git LFS pointer"):
        load_all([tmp_path])
    with pytest.raises(InvalidValue, match="holds no scenario"):
        (tmp_path / "empty").mkdir()
        find_scenarios([tmp_path / "empty"])


@pytest.mark.parametrize(
    ("one", "other", "words"),
    [
        ("Arm", "arm", "'arm' differs from 'Arm'"),
        ("Über", "über", "only in upper and lower case"),
        ("é", unicodedata.normalize("NFD", "é"), r"'e\u0301' differs from '\xe9'"),
        ("É", unicodedata.normalize("NFD", "é"), "only in upper and lower case"),
        ("ﬁt", "FIt", ""),  # a ligature is another letter, and the same when case is folded fully
        ("a", "a", "'a' is taken by"),
    ],
)
def test_names_that_are_one_folder_elsewhere_are_refused(tmp_path, one, other, words):
    write(tmp_path / "x.yaml", one)
    write(tmp_path / "y.yaml", other)
    for attempt in (lambda: load_all([tmp_path]), lambda: Selection.of([tmp_path], [], None)):
        with pytest.raises(ScenarioError) as caught:
            attempt()
        assert words in str(caught.value) and str(tmp_path / "y.yaml") in str(caught.value)


def test_names_that_differ_otherwise_are_taken(tmp_path):
    for number, name in enumerate(("a", "a1", "a-1", "ä", "a.1")):
        write(tmp_path / f"{number}.yaml", name)
    assert len(load_all([tmp_path])) == 5


def test_of_a_file_that_is_too_large_for_yaml_no_more_is_read(tmp_path):
    write(tmp_path / "a.yaml", "a")
    for name in ("data.yaml", "scenario.yaml"):
        with (tmp_path / name).open("wb") as file:
            file.write(b"version: 1\n" * name.startswith("scenario"))
            file.truncate(1 << 40)
    assert [path.name for path in find_scenarios([tmp_path])] == ["a.yaml", "scenario.yaml"]
    selection = Selection.of([tmp_path], (), None)
    assert [scenario.name for scenario in selection.chosen] == ["a"]
    assert "at most 1073741824 are read" in str(selection.failed[0].error)


@pytest.mark.parametrize("name", [RUN, *REPORTS, HISTORY, LOG, "Run.JSON"])
def test_a_scenario_is_not_called_as_a_file_that_stands_beside_its_folder(tmp_path, name):
    write(tmp_path / "a.yaml", "a")
    write(tmp_path / "b.yaml", name)
    selection = Selection.of([tmp_path], (), None)
    assert [scenario.name for scenario in selection.chosen] == ["a"]
    (result,) = selection.failed
    assert result.name == "b"
    assert "is the name of a file that stands beside the folders of scenarios" in result.error
