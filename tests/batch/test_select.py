"""Which scenarios paths and filters stand for."""

import pytest

from replay.batch.select import find_scenarios, load_all, select
from replay.errors import InvalidValue, ScenarioError

SCENARIO = "version: 1\nname: {name}\nrate: 10\nduration: 1\ntags: [{tags}]\nlinks: {{box: {{}}}}\n"


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "table.yaml").write_text("links: {table: {}}\n")
    (tmp_path / "b.yaml").write_text(SCENARIO.format(name="near", tags="nightly, arm"))
    (tmp_path / "parts" / "a.yml").write_text(SCENARIO.format(name="far", tags="arm"))
    (tmp_path / "notes.txt").write_text("version: 1\n")
    (tmp_path / ".venv").mkdir()
    (tmp_path / ".venv" / "foreign.yaml").write_text("version: 3\n")
    return tmp_path


def test_a_folder_stands_for_its_scenarios_but_not_for_their_parts(folder):
    assert find_scenarios([folder]) == [folder / "b.yaml", folder / "parts" / "a.yml"]
    assert find_scenarios([folder / "b.yaml", folder]) == [folder / "b.yaml", folder / "parts" / "a.yml"]


AS_WRITTEN = {
    "with a mark": SCENARIO.encode("utf-8-sig"),
    "for old machines": SCENARIO.replace("\n", "\r").encode(),
    "a document": b"%YAML 1.2\n--- # of ours\n" + SCENARIO.encode(),
    "quoted": SCENARIO.replace("version", '"version"').encode(),
    "json": b'# as a tool wrote it\n{"name": "near", "version": 1}',
    "a line": b"{name: near, version: 1}",
    "UTF-16": SCENARIO.encode("utf-16"),
}


@pytest.mark.parametrize("way", AS_WRITTEN)
def test_a_scenario_of_a_folder_is_found_however_it_is_written(tmp_path, way):
    (tmp_path / "a.yaml").write_bytes(AS_WRITTEN[way])
    (tmp_path / "part.yaml").write_bytes(b"#" * 100_000 + b"\n{links: {tool: {shapes: {}}}}")
    assert find_scenarios([tmp_path]) == [tmp_path / "a.yaml"]


def test_paths_that_stand_for_nothing_are_refused(folder):
    with pytest.raises(InvalidValue, match="is not there"):
        find_scenarios([folder / "none.yaml"])
    (folder / "empty").mkdir()
    with pytest.raises(InvalidValue, match="holds no scenario"):
        find_scenarios([folder / "empty"])


def test_selection_by_name_glob_and_tag(folder):
    scenarios = load_all([folder])
    names = lambda patterns: [scenario.name for scenario in select(scenarios, patterns)]  # noqa: E731
    assert names([]) == ["near", "far"]
    assert names(["n*"]) == ["near"]
    assert names(["tag:arm"]) == ["near", "far"]
    assert names(["tag:night*", "far"]) == ["near", "far"]
    assert names(["nothing"]) == []


def test_problems_of_all_files_are_listed_together_and_names_are_unique(folder):
    (folder / "c.yaml").write_text(SCENARIO.format(name="near", tags=""))
    (folder / "d.yaml").write_text("version: 1\nname: bad\nrate: -1\nduration: 1\nlinks: {box: {}}\n")
    with pytest.raises(ScenarioError) as caught:
        load_all([folder])
    text = str(caught.value)
    assert "'near' is taken by" in text
    assert "rate" in text
    assert len(caught.value.problems) == 2


def test_a_mistake_in_a_part_that_several_include_is_said_once(folder):
    (folder / "parts" / "table.yaml").write_text("links: {table: {size: 1}}\n")
    for name in ("near", "far"):
        text = SCENARIO.format(name=name, tags="") + "include: [parts/table.yaml]\n"
        (folder / f"{name}.yaml").write_text(text)
    with pytest.raises(ScenarioError) as refused:
        load_all([folder / "near.yaml", folder / "far.yaml"])
    assert str(refused.value).count("links.table.size: unknown key") == 1
