"""Scenes: what a scenario becomes before the first frame."""

from pathlib import Path

import numpy as np
import pytest

from replay.collision import pairs
from replay.errors import ScenarioError
from replay.geometry.primitives import cube
from replay.kinematics.motion import sample
from replay.scenario import scene as scene_module
from replay.scenario.load import load, load_model, load_sources
from replay.scenario.model import Scenario
from replay.scenario.scene import build
from replay.simulation import Layout

FULL = Path(__file__).parent / "data" / "full.yaml"
HEAD = "version: 1\nname: a\nrate: 10\nduration: 1\n"


@pytest.fixture(scope="module")
def full():
    return build(load(FULL))


def build_text(text, **files):
    sources = {f"{name}.stl": data for name, data in files.items()}
    return build(load_sources("f.yaml", {"f.yaml": (HEAD + text).encode(), **sources}))


def test_everything_is_listed_once_sorted_by_name(full):
    assert isinstance(full.layout, Layout)
    assert full.layout.links == ("arc", "detector", "doctor", "gear", "patient", "slide", "stand", "wedge", "world")
    assert full.layout.joints == ("arc_rotation", "gear", "lift", "slide", "turn")
    assert full.layout.joint_units == ("rad", "rad", "m", "m", "rad")
    shapes = tuple(shape.name for shape in full.shapes)
    assert shapes == tuple(sorted(shapes)) and len(shapes) == 12
    assert full.layout.shapes == tuple(name for name in shapes if name != "wedge/mesh")
    assert full.layout.objects == full.layout.shapes == tuple(target.name for target in full.targets)
    assert full.layout.pairs == tuple(sorted(full.layout.pairs))
    assert (full.layout.distance_sensors, full.layout.capacitive_sensors) == (("corner",), ("guard",))


def test_pairs_leave_out_what_is_joined_disabled_or_does_not_collide(full):
    assert "doctor/b|patient/body" in full.layout.pairs
    assert "arc/c|stand/column" not in full.layout.pairs  # joined
    assert "arc/c|patient/body" not in full.layout.pairs  # disabled
    assert not any("wedge/flag" in name for name in full.layout.pairs)  # collide: false
    assert not any(name.count("wedge/") == 2 for name in full.layout.pairs)  # one link
    assert [pair.name for pair in full.pairs] == list(full.layout.pairs)
    assert [full.bodies[pair.a].name + "|" + full.bodies[pair.b].name for pair in full.pairs] == list(full.layout.pairs)


def test_shapes_stand_in_their_links_frame(full):
    by_name = {shape.name: shape for shape in full.shapes}
    tip = by_name["wedge/tip"].solid.vertices  # a cone of height 10 cm whose z became -y by rpy 90 deg about x
    assert tip[np.argmin(tip[:, 1])] == pytest.approx([0.0, -0.05, 0.0], abs=1e-15)
    mesh = by_name["wedge/mesh"].solid.vertices
    assert mesh == pytest.approx(np.array([[0, 0, 0], [0, 0, 0.3], [0, 0.2, 0], [0.1, 0, 0]]))
    patient = by_name["patient/body"].solid
    assert len(patient.triangles) == 1000 and patient.watertight
    assert by_name["stand/column"].color == (0xC8, 0xCC, 0xD0, 255)
    assert full.layout.links[by_name["doctor/b"].link] == "doctor"


def test_sensors_are_placed_and_know_what_they_ignore(full):
    (corner,) = full.distance_sensors
    assert (corner.link, corner.range, corner.min_range) == (full.linkage.link_index("detector"), 1.5, 0.0)
    assert corner.ignored_links == {full.linkage.link_index("arc")}
    (guard,) = full.capacitive_sensors
    assert guard.plates[0].half_size.tolist() == [0.025, 0.1]
    assert (guard.coupling, guard.supply, guard.side, guard.faces) == (1e-11, 2.5, "front", "all")


def test_the_script_drives_the_linkage_as_written(full):
    seconds = full.seconds(0, full.frames)
    states = sample(full.linkage, full.script, seconds)
    assert states.positions.shape == (301, 5)
    turn = full.layout.joints.index("turn")
    assert states.positions[:, turn] == pytest.approx(np.pi / 2)  # no script: holds its initial position
    arc = full.layout.joints.index("arc_rotation")
    assert states.positions[120, arc] == pytest.approx(np.deg2rad(30.0))
    lift = full.layout.joints.index("lift")
    assert states.positions[-1, lift] == pytest.approx(0.1)
    poses = full.linkage.forward(states.positions, states.free_poses)
    doctor = poses.world[:, full.linkage.link_index("doctor")]
    assert doctor[30, :3, 3] == pytest.approx([1.5, 0.0, 0.0])
    assert doctor[-1, :3, 0] == pytest.approx([0.0, 1.0, 0.0])
    assert full.time_ns(0, 3).tolist() == [0, 16666667, 33333333]


def test_a_quaternion_and_the_same_angles_are_the_same_pose():
    scene = build_text(
        "links: {a: {pose: {quat_xyzw: [0, 0, 1, 1]}}, b: {pose: {rpy: [0, 0, 90 deg]}}, c: {pose: {xyz: [1, 2, 3]}}}\n"
    )
    a, b, c = (link.T_parent_joint for link in scene.linkage.links)
    assert a == pytest.approx(b, abs=1e-15)
    assert c[:3, 3].tolist() == [1.0, 2.0, 3.0] and (c[:3, :3] == np.eye(3)).all()


def test_only_what_is_asked_for_is_prepared():
    scene = build_text("links: {a: {shapes: {s: {type: cube, size: 1}}}, b: {shapes: {s: {type: cube, size: 1}}}}\n")
    assert (len(scene.pairs), scene.targets, scene.layout.objects) == (1, (), ())
    scene = build_text(
        "links: {a: {}, b: {shapes: {s: {type: cube, size: 1}}}}\ncollision: {pairs: none}\n"
        "sensors: {distance: {eye: {link: a, aperture: 1}}}\n"
    )
    assert (scene.bodies, scene.pairs, len(scene.targets), scene.layout.objects) == ((), (), 1, ())


def test_equal_meshes_are_read_once(monkeypatch):
    read = []
    original = scene_module.load_mesh
    monkeypatch.setattr(scene_module, "load_mesh", lambda *a, **k: read.append((a, k["scale"])) or original(*a, **k))
    mesh = "{type: mesh, file: w.stl, scale: 1}"
    text = f"links: {{a: {{shapes: {{s: {mesh}, t: {mesh}}}}}, b: {{shapes: {{s: {mesh.replace('1', '2')}}}}}}}\n"
    build_text(text, w=(FULL.parent / "meshes" / "wedge.stl").read_bytes())
    assert read == [(("w.stl",), (1.0, 1.0, 1.0)), (("w.stl",), (2.0, 2.0, 2.0))]


def test_every_mesh_that_cannot_be_used_is_told_with_its_place():
    mesh = "{type: mesh, file: w.stl, scale: 1}"
    with pytest.raises(ScenarioError) as caught:
        build_text(f"links:\n  a: {{shapes: {{s: {mesh}}}}}\n  b: {{shapes: {{s: {mesh}}}}}\n", w=b"solid nothing\n")
    assert len(caught.value.problems) == 2
    assert str(caught.value).startswith("f.yaml:6:38: links.a.shapes.s.file = 'w.stl' cannot be used: ")


def test_a_mesh_without_its_file_is_refused():
    mesh = {"type": "mesh", "file": "w.stl", "scale": 1}
    data = {"version": 1, "name": "a", "rate": 1, "duration": 1, "links": {"a": {"shapes": {"s": mesh}}}}
    with pytest.raises(ScenarioError, match=r"links\.a\.shapes\.s\.file cannot be used: is not at hand"):
        build(Scenario.model_validate(data))


def test_notes_on_meshes_name_the_file():
    wedge = (FULL.parent / "meshes" / "wedge.stl").read_text()
    first = wedge.index("facet")
    opened = wedge[:first] + wedge[wedge.index("facet", wedge.index("endfacet") + 8) :]
    scene = build_text("links: {a: {shapes: {s: {type: mesh, file: w.stl, scale: 1}}}}\n", w=opened.encode())
    assert len(scene.notes) == 1 and scene.notes[0].startswith("w.stl: not watertight: 3 edges are open; ")


def test_convex_pieces_say_what_they_cost(tmp_path, monkeypatch):
    # a hollow box: a part in its cavity read contact, and nothing said why
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    box = cube(1.0).triangles
    rows = "".join(f"v {x} {y} {z}\n" for x, y, z in np.concatenate([box, 0.6 * box[:, ::-1]]).reshape(-1, 3))
    rows += "".join(f"f {k} {k + 1} {k + 2}\n" for k in range(1, 73, 3))
    text = "links: {a: {shapes: {s: {type: mesh, file: m.obj, scale: 1}}}, b: {shapes: {s: {type: cube, size: 0.1}}}}\n"
    sources = {"f.yaml": (HEAD + text + "model: {collision: {pieces: convex}}\n").encode(), "m.obj": rows.encode()}
    scene = build(load_sources("f.yaml", sources))
    assert scene.notes == (
        "a/s collides as 1 convex piece: +28 % of its volume, up to 0 m beyond its surface, up to 0 m of it missed, "
        "a closed cavity filled",
    )


def test_a_model_replaces_the_scenarios_own(full):
    assert full.model == full.scenario.model
    thesis = load_model("thesis2015")
    assert build(load(FULL), model=thesis).model == thesis


def test_expectations_know_the_scenes_names_and_places(full):
    outcomes = full.expectation_check().finish()
    assert [outcome.expectation for outcome in outcomes] == [
        "detector* | patient*: contact never",
        "detector* | patient*: contact begins between 1 s and 2 s",
        "detector* | patient*: bounds sometimes",
        "detector* | patient*: clearance >= 0.02 m",
        "corner: distance >= 0.1 m",
        "corner: distance <= 0.8 m",
        "corner: detected sometimes",
        "guard: output >= 0.5 V",
        "guard: output <= 2.5 V",
        "guard: saturated never",
        "wedge/ball | doctor: bounds never",
    ]
    lines = [outcome.place.line for outcome in outcomes]
    assert lines == sorted(lines) and Path(outcomes[0].place.file).name == "full.yaml"


def test_more_pairs_than_results_can_hold_are_refused_with_a_way_out(monkeypatch):
    monkeypatch.setattr(pairs, "MOST_PAIRS", 1)
    links = "".join(f"  l{k}: {{joint: {{type: free}}, shapes: {{s: {{type: cube, size: 1}}}}}}\n" for k in range(3))
    with pytest.raises(ScenarioError, match=r"collision.pairs.* makes 3 pairs: .*disable pairs that cannot meet"):
        build_text(f"links:\n{links}")
