"""Nearly forty kinds of causes planted over many scenarios: grouped and named rightly, what nothing explains first."""

from pathlib import Path

import numpy as np
import pytest

import replay
from replay.batch.baseline import Baseline
from replay.batch.case import CaseOrder, CaseStatus, run_case
from replay.batch.groups import groups
from replay.batch.judge import Judge
from replay.batch.judged import RegressVerdict
from replay.comparison.effects import Severity
from replay.comparison.rules_file import read_rules
from replay.recording.provenance import code_identity
from replay.scenario.load import load_sources
from tests.comparison import edited

RULES = Path(__file__).parents[2] / "scenarios" / "rules.yaml"
PART = """
links:
  person: {joint: {type: free}, shapes: {body: {type: cylinder, radius: 20 cm, height: 1.8}}}
"""
TEXT = """
version: 1
name: NAME
rate: 20 Hz
duration: 1 s
include: [person.yaml]
links:
  bench: {pose: {xyz: [1.5, 0, 0.2]}, shapes: {top: {type: mesh, file: top.stl, scale: 1}}}
  forearm:
    joint: {type: revolute, axis: [0, 1, 0], lower: -100 deg, upper: 100 deg, velocity: 2, acceleration: 5}
    shapes: {tube: {type: cylinder, radius: 5 cm, height: 1, pose: {xyz: [0, 0, 0.5]}}}
  lift: {pose: {xyz: [-3, 0, 0]}, joint: {type: prismatic}, shapes: {deck: {type: cuboid, size: [0.5, 0.5, 0.1]}}}
  cart: {pose: {xyz: [-3, 0, 2]}, joint: {type: prismatic, deceleration: 2}, shapes: {box: {type: cube, size: 20 cm}}}
motion:
  moves: [{to: {forearm: 60 deg}}]
  points:
    lift: [{time: 0, position: 0}, {time: 0.5, position: 10 cm}, {time: 1, position: 20 cm}]
    cart: [{time: 0, position: 0}, {time: 1, position: -1}]
  free: {person: [{time: 0, xyz: [1.2, 0.6, 0.4]}]}
sensors:
  distance:
    tip: {link: forearm, pose: {xyz: [0, 0, 1], rpy: [0, 90 deg, 0]}, aperture: 20 deg, range: 3}
    down: {link: cart, pose: {xyz: [0, 0, -0.11], rpy: [180 deg, 0, 0]}, aperture: 15 deg, range: 3,
      signal: {noise: {std: 1 mm, seed: 7}}}
  capacitive: {guard: {link: forearm, coupling: 10 pF,
    plates: {p: {size: [10 cm, 10 cm], pose: {xyz: [0.08, 0, 0.5], rpy: [0, 90 deg, 0]}}}}}
guards: {gap: {when: {distance: down, below: 1.2 m}, stop: [cart]}}
collision: {margin: 5}
expect:
  - {pair: [forearm, person], clearance: {min: 2 cm}}
"""

TIP = "    tip: {link: forearm, pose: {xyz: [0, 0, 1], rpy: [0, 90 deg, 0]}, aperture: 20 deg, range: 3}\n"


def slab(thickness):
    """Return an STL file of a box."""
    import trimesh

    return trimesh.creation.box((0.6, 0.6, thickness)).export(file_type="stl")


def change(*texts):
    """Return an edit of the scenario's text: old, new, old, new, ..."""

    def edit(files):
        text = files["main.yaml"]
        for old, new in zip(texts[::2], texts[1::2], strict=True):
            assert old in text
            text = text.replace(old, new)
        return {**files, "main.yaml": text}

    return edit


def file(name, content):
    return lambda files: {**files, name: content}


def another_mesh(files):
    """Return a scenario whose mesh is another file with other triangles."""
    import trimesh

    board = trimesh.creation.cylinder(0.3, 0.1, sections=8).export(file_type="stl")
    kept = {name: content for name, content in files.items() if name != "top.stl"}
    return {**change("file: top.stl", "file: board.stl")(kept), "board.stl": board}


def moved_files(files):
    """Return a scenario whose files have other names."""
    main = change("file: top.stl", "file: meshes/bench.stl", "include: [person.yaml]", "include: [people/one.yaml]")
    return {**main(files), "meshes/bench.stl": files["top.stl"], "people/one.yaml": files["person.yaml"]}


def library(known):
    known["libraries"]["numpy"] = "1.0"


def new_library(known):
    del known["libraries"]["numpy"]


def code(known):
    known["code"] = "0" * 64


def version(known):
    known["version"] = "0.0.9"


CAUSES = {
    "person/body radius 20 -> 21 cm": file("person.yaml", PART.replace("20 cm", "0.21")),
    "person/body height 1.8 -> 1.7 m": file("person.yaml", PART.replace("1.8", "170 cm")),
    "forearm/tube radius 5 -> 6 cm": change("radius: 5 cm", "radius: 60 mm"),
    "forearm/tube pose.xyz[2] 50 -> 55 cm": change("xyz: [0, 0, 0.5]}}}", "xyz: [0, 0, 0.55]}}}"),
    "forearm/tube type cylinder -> capsule": change("{type: cylinder, radius: 5 cm", "{type: capsule, radius: 5 cm"),
    "bench/top mesh top.stl (z from -5 -> -10 cm, z to 5 -> 10 cm, volume 36 -> 72 l)": file("top.stl", slab(0.2)),
    "bench/top scale 1 -> 1.1": change("scale: 1}", "scale: 1.1}"),
    "links.bench.pose.xyz[0] 1.5 -> 1.45 m": change("xyz: [1.5, 0, 0.2]", "xyz: [145 cm, 0, 0.2]"),
    "links.forearm.joint.velocity 2 -> 1 rad/s": change("velocity: 2", "velocity: 1"),
    "links.forearm.joint.upper 100 -> 50 deg; motion.moves[0].to.forearm 60 -> 50 deg": change(
        "upper: 100 deg", "upper: 50 deg", "forearm: 60 deg", "forearm: 50 deg"
    ),
    "motion.moves[0].to.forearm 60 -> 70 deg": change("forearm: 60 deg", "forearm: 70 deg"),
    "motion.free.person[0].xyz[1] 60 -> 50 cm": change("[1.2, 0.6, 0.4]", "[1.2, 0.5, 0.4]"),
    "sensors.distance.tip.aperture 20 -> 30 deg": change("aperture: 20 deg", "aperture: 30 deg"),
    "sensors.capacitive.guard.coupling 10 -> 12 pF": change("coupling: 10 pF", "coupling: 12 pF"),
    "sensors.capacitive.guard.plates.p.size[1] 10 -> 8 cm": change("[10 cm, 10 cm]", "[10 cm, 80 mm]"),
    "links.post added": change("links:\n", "links:\n  post: {shapes: {rod: {type: cube, size: 20 cm}}}\n"),
    "expect[0].clearance.min 0.02 -> 3 m": change("min: 2 cm", "min: 3"),
    "rate 20 -> 40 Hz": change("rate: 20 Hz", "rate: 40 Hz"),
    "model.distance exact@3 -> rays@2": change("collision:", "model: {distance: {method: rays}}\ncollision:"),
    "sensors.distance.tip.pose.xyz[2] 1 -> 1.05 m": change("{xyz: [0, 0, 1], rpy", "{xyz: [0, 0, 105 cm], rpy"),
    "sensors.distance.tip.pose turned by 45 deg": change(
        "xyz: [0, 0, 1], rpy: [0, 90 deg, 0]", "xyz: [0, 0, 1], quat_xyzw: [0, 0.3826834, 0, 0.9238795]"
    ),
    "sensors.distance.tip removed": change(TIP, ""),
    "sensors.distance.down.signal.noise.seed 7 -> 8": change("seed: 7", "seed: 8"),
    "guards.gap.when.below 1.2 -> 1 m": change("below: 1.2 m", "below: 100 cm"),
    "links.cart.joint.deceleration 2 -> 4 m/s^2": change("deceleration: 2", "deceleration: 4"),
    "motion.points.lift[1].position 10 -> 12 cm": change("position: 10 cm", "position: 120 mm"),
    "motion.points.lift[1] added": change("{time: 0.5,", "{time: 0.25, position: 8 cm}, {time: 0.5,"),
    "links.lift.joint.type prismatic -> fixed; motion.points.lift removed": change(
        "joint: {type: prismatic}, ",
        "",
        "    lift: [{time: 0, position: 0}, {time: 0.5, position: 10 cm}, {time: 1, position: 20 cm}]\n",
        "",
    ),
    "bench/top mesh top.stl -> board.stl (triangles 12 -> 32, volume 36 -> 25.5 l)": another_mesh,
    "links.bench renamed desk": change("  bench: {", "  desk: {"),
    "person/head added": file("person.yaml", PART.replace("1.8}", "1.8}, head: {type: sphere, radius: 12 cm}")),
    "collision.disable[0] added": change("margin: 5", "margin: 5, disable: [{pair: [bench, person], reason: far}]"),
    "expect[0] added": change("expect:\n", "expect:\n  - {pair: [bench, person], contact: always}\n"),
    "forearm/tube radius 5 -> 6 cm; sensors.capacitive.guard.coupling 10 -> 12 pF": change(
        "radius: 5 cm", "radius: 6 cm", "coupling: 10 pF", "coupling: 12 pF"
    ),
    f"library numpy 1.0 -> {np.__version__}": library,
    f"library numpy - -> {np.__version__}": new_library,
    f"unexplained: nothing but the code changed (code 00000000 -> {code_identity()[:8]})": code,
    f"unexplained: nothing but the code changed (replay 0.0.9 -> {replay.__version__})": version,
}
"""Names of groups, and what is done to a scenario's files, or to what the baseline's recording says of itself."""
OF_FILES = list(CAUSES)[:-4]
NONE = {
    "units": change("aperture: 20 deg, range: 3}", "aperture: 0.3490658503988659, range: 300 cm}", "10 pF", "0.01 nF"),
    "comments": change("links:\n", "# what there is\nlinks:  # by name\n"),
    "files": moved_files,
    "words": change("version: 1\n", "version: 1\ndescription: another\ntags: [new]\n"),
}
"""What is no change, however much of the text differs."""
SEVERITIES = {
    "expect[0].clearance.min 0.02 -> 3 m": Severity.BROKEN,
    "expect[0] added": Severity.BROKEN,
    "person/body radius 20 -> 21 cm": Severity.CLEARANCE,
    "links.bench.pose.xyz[0] 1.5 -> 1.45 m": Severity.CLEARANCE,
    "sensors.distance.tip.pose.xyz[2] 1 -> 1.05 m": Severity.READING,
    "sensors.capacitive.guard.coupling 10 -> 12 pF": Severity.READING,
    "sensors.distance.down.signal.noise.seed 7 -> 8": Severity.READING,
    "motion.points.lift[1] added": Severity.CLEARANCE,
    f"library numpy 1.0 -> {np.__version__}": Severity.READING,
}
"""How much some of the causes matter."""


def recorded(name, files, folder):
    scenario = load_sources("main.yaml", {n: t if isinstance(t, bytes) else t.encode() for n, t in files.items()})
    return scenario, run_case(CaseOrder(scenario, folder / name, rrd=False), lambda *_: None)


def nudged():
    """Return an edit that changes a reading a little, as another library or another code may."""
    return edited.Edit("/capacitive/guard", "output_voltage", 3, lambda value: value + 1e-3)


def planted(folder, count):
    """Return scenarios judged, `count` for each cause, and the cause of each by name."""
    files = {"person.yaml": PART, "top.stl": slab(0.1)}
    rules = read_rules(RULES)
    judge = Judge(
        folder / "out", Baseline(folder / "base"), rules, missing="fail", overlays=0, again=lambda name: f"again {name}"
    )
    judged, causes = [], {}
    for number in range(count):
        for k, (cause, edit) in enumerate({**CAUSES, **NONE}.items()):
            name = f"s{number:02d}_{k:02d}"
            before = {"main.yaml": TEXT.replace("NAME", name), **files}
            _, result = recorded(name, before, folder / "base")
            assert result.status is CaseStatus.PASSED, result.error
            after = before
            if cause in (*OF_FILES, *NONE):
                after = edit(before)
            else:
                path = folder / "base" / name / f"{name}.mcap"
                edited.write(path, path, [nudged()], provenance=edit)
            scenario, result = recorded(name, after, folder / "out")
            judged.append(judge.judge(scenario, result))
            causes[name] = cause
    return judged, causes


def check(folder, count):
    judged, causes = planted(folder, count)
    assert {item.name for item in judged if item.verdict is RegressVerdict.SAME} == {
        n for n in causes if causes[n] in NONE
    }
    found = groups(judged)
    assert {group.name: len(group.members) for group in found} == dict.fromkeys(CAUSES, count)
    for group in found:
        assert {causes[item.name] for item in group.members} == {group.name}
    assert [group.explained for group in found] == [False, False, *[True] * (len(CAUSES) - 2)]
    order = [(group.severity, -group.members[0].size) for group in found[2:]]
    assert order == sorted(order)
    assert {name: next(group for group in found if group.name == name).severity for name in SEVERITIES} == SEVERITIES
    by_cause = {group.name: group.members[0] for group in found}
    return by_cause


def test_scenarios_are_grouped_and_named_by_what_was_changed(tmp_path):
    by_cause = check(tmp_path, 2)
    radius = by_cause["person/body radius 20 -> 21 cm"]
    assert radius.severity is Severity.CLEARANCE
    assert "(limit 2 cm): forearm/tube | person/body" in radius.message
    assert by_cause["sensors.capacitive.guard.coupling 10 -> 12 pF"].message.startswith("output +")
    assert by_cause["sensors.distance.tip.aperture 20 -> 30 deg"].message == "detection no longer ends at 0.8 s: tip"
    assert by_cause["motion.moves[0].to.forearm 60 -> 70 deg"].finding.count > 2
    page = (tmp_path / "out" / radius.name / "report.html").read_text()
    assert "-  person: {joint: {type: free}, shapes: {body: {type: cylinder, radius: 20 cm" in page
    assert "person/body radius 20 -&gt; 21 cm" in page


@pytest.mark.soak
def test_scenarios_are_grouped_and_named_by_what_was_changed_in_a_night_of_three_hundred(tmp_path):
    check(tmp_path, 8)
