"""Fragments merged into a scenario."""

import pytest

from replay.errors import ScenarioError
from replay.scenario.load import load, load_sources

HEAD = "version: 1\nname: a\nrate: 60 Hz\nduration: 1 s\n"


def load_files(**files):
    """Load main.yaml of the given files; a double underscore in a name is a folder."""
    return load_sources("main.yaml", {f"{k.replace('__', '/')}.yaml": text.encode() for k, text in files.items()})


def problems(**files):
    with pytest.raises(ScenarioError) as caught:
        load_files(**files)
    return [str(problem) for problem in caught.value.problems]


def test_sections_are_merged_entry_by_entry_and_lists_in_order():
    scenario = load_files(
        main=f"""{HEAD}include: [parts/arm.yaml, eye.yaml]
links: {{floor: {{shapes: {{slab: {{type: cube, size: 1}}}}}}}}
collision: {{disable: [{{pair: [arm, floor], reason: second}}]}}
motion: {{moves: [{{to: {{arm: 1}}}}]}}
expect: [{{distance: eye, min: 1}}]
""",
        parts__arm="""include: [hand.yaml]
links: {arm: {joint: {type: revolute, velocity: 1, acceleration: 1}, shapes: {bar: {type: cube, size: 1}}}}
motion: {moves: [{to: {arm: 0.5}}]}
collision: {margin: 1 cm, disable: [{pair: [arm, hand], reason: first}]}
""",
        parts__hand="links: {hand: {shapes: {palm: {type: cube, size: 1}}}}\n",
        eye="sensors: {distance: {eye: {link: hand, aperture: 1}}}\nmodel: {distance: {method: thesis}}\n",
    )
    assert list(scenario.links) == ["hand", "arm", "floor"]
    assert [entry.reason for entry in scenario.collision.disable] == ["first", "second"]
    assert [move.to["arm"].value for move in scenario.motion.moves] == [0.5, 1.0]
    assert scenario.collision.margin == 0.01
    assert scenario.model.distance.method == "thesis"
    assert list(scenario.sources) == ["main.yaml", "parts/arm.yaml", "parts/hand.yaml", "eye.yaml"]


def test_a_name_defined_twice_is_an_error_at_both_places():
    assert problems(
        main=f"{HEAD}include: [b.yaml]\nlinks: {{x: {{}}}}\nmodel: thesis2015\ncollision: {{margin: 1}}\n",
        b="links: {x: {}}\nmodel: thesis2015\ncollision: {margin: 1}\n",
    ) == [
        "main.yaml:6:9: links.x is defined twice; the first is at b.yaml:1:9",
        "main.yaml:7:1: model is defined twice; the first is at b.yaml:2:1",
        "main.yaml:8:13: collision.margin is defined twice; the first is at b.yaml:3:13",
    ]


def test_a_problem_in_a_fragment_is_placed_in_the_fragment():
    assert problems(
        main=f"{HEAD}include: [b.yaml]\nlinks: {{x: {{}}}}\n",
        b="name: c\nlinks:\n  y: {parent: z}\nsensors: {distance: {d: {link: x, aperture: 5 m}}}\n",
    ) == [
        "b.yaml:1:1: name does not belong in an included file; it may hold include, links, poses, motion, collision, "
        "sensors, guards, model, expect",
        "b.yaml:3:15: links.y.parent = 'z' is no link; links are y, x",
        "b.yaml:4:45: sensors.distance.d.aperture = '5 m' is a length where an angle belongs; write a number [rad] or "
        "text such as '30 deg' (units: rad, deg, mrad)",
    ]


def test_circles_and_depth_are_cut():
    assert problems(main=f"{HEAD}links: {{a: {{}}}}\ninclude: [b.yaml]\n", b="include: [main.yaml]\n") == [
        "b.yaml:1:11: include[0] = 'main.yaml' includes itself: main.yaml -> b.yaml -> main.yaml"
    ]
    chain = {f"f{k}": f"include: [f{k + 1}.yaml]\n" for k in range(20)}
    found = problems(main=f"{HEAD}links: {{a: {{}}}}\ninclude: [f0.yaml]\n", **chain)
    assert found == ["f7.yaml:1:11: include[0] = 'f8.yaml' is included more than 8 files deep"]


def test_a_fragment_that_two_files_include_counts_once():
    both = "include: [c.yaml]\n"
    scenario = load_files(main=f"{HEAD}include: [a.yaml, b.yaml]\n", a=both, b=both, c="links: {x: {}}\n")
    assert list(scenario.links) == ["x"]


def test_a_mesh_is_looked_for_beside_the_file_that_names_it(tmp_path):
    (tmp_path / "machine").mkdir()
    (tmp_path / "machine" / "part.stl").write_bytes(b"mesh")
    part = "links: {x: {shapes: {m: {type: mesh, file: part.stl, scale: 1}}}}\n"
    (tmp_path / "machine" / "part.yaml").write_text(part)
    (tmp_path / "main.yaml").write_text(f"{HEAD}include: [machine/part.yaml]\n")
    scenario = load(tmp_path / "main.yaml")
    assert scenario.provenance.meshes == {("x", "m"): "machine/part.stl"}
    assert scenario.sources["machine/part.stl"] == b"mesh"


@pytest.mark.parametrize("written", ["../out.yaml", "sub/../../out.yaml", "link.yaml", "linked/out.yaml"])
def test_no_path_leads_out_of_the_folder_tree(tmp_path, written):
    (tmp_path / "out.yaml").write_text("links: {x: {}}\n")
    inside = tmp_path / "inside"
    inside.mkdir()
    (inside / "link.yaml").symlink_to(tmp_path / "out.yaml")
    (inside / "linked").symlink_to(tmp_path)
    (inside / "main.yaml").write_text(f"{HEAD}include: [{written}]\nlinks: {{a: {{}}}}\n")
    with pytest.raises(ScenarioError, match=r"main.yaml:5:11: include\[0\] = .* leads? out of the scenario's folder"):
        load(inside / "main.yaml")


def test_a_link_that_stays_inside_is_followed(tmp_path):
    (tmp_path / "real.yaml").write_text("links: {x: {}}\n")
    (tmp_path / "link.yaml").symlink_to("real.yaml")
    (tmp_path / "main.yaml").write_text(f"{HEAD}include: [link.yaml]\n")
    assert list(load(tmp_path / "main.yaml").links) == ["x"]
