"""One thing is changed in a recorded file of a shipped scenario; every report names it exactly, and nothing else."""

import json
import re
from html import unescape
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from google.protobuf.descriptor_pb2 import FileDescriptorSet

import replay
from replay.cli.exit_codes import ExitCode
from replay.cli.main import run
from replay.comparison import wording
from replay.comparison.difference import DiffVerdict
from replay.comparison.rules import Rule, Rules, Tolerance
from replay.comparison.runs import read_pair
from replay.logs.mcap_records import Schema
from replay.recording.reader import read
from tests.batch import scenes
from tests.comparison import edited
from tests.comparison.edited import Edit

BASELINES = Path(__file__).parents[1] / "baselines"
PARKING, GUARD, HEAD = (
    BASELINES / name / f"{name}.mcap" for name in ("carm_parking", "carm_bodyguard", "carm_head_contact")
)
CORNER = "/distance/corner_head_left"
PAIR = "detector/panel|patient/body"


def flipped(bit):
    return lambda value: (np.float64(value).view(np.uint64) ^ np.uint64(1 << bit)).view(np.float64)


READING = float(read(PARKING, topics=[CORNER]).distance.distance[300, 0])
TOUCHING = read(HEAD, topics=["/collision"])
CONTACT = int(np.argmax(TOUCHING.collision.level[:, TOUCHING.layout.pairs.index(PAIR)] == 2))


def without(*topics):
    return lambda topic: None if topic in topics else topic


def lose_sensor(known):
    known["layout"]["distance_sensors"].remove("corner_head_left")


def rename_sensor(known):
    sensors = known["layout"]["distance_sensors"]
    sensors[sensors.index("corner_head_left")] = "corner_kopf"


def to_kopf(topic):
    return topic.replace("corner_head_left", "corner_kopf")


def other_mesh(known):
    (name,) = (name for name in known["files"] if name.endswith(".stl"))
    known["files"][name] = "f" * 64


def reports(folder, a, b, *more):
    """Return exit code and all reports of a diff: text, JSON, HTML, JUnit."""
    html, junit = folder / "diff.html", folder / "junit.xml"
    command = ["diff", str(a), str(b), *map(str, more)]
    code = run([*command, "--html", str(html), "--junit", str(junit)])
    return code, command, html.read_text(), junit


def check(folder, capsys, a, b, line, *more, finding, verdict="different"):
    """Check that a line is in every report, and that JSON holds one finding: of a kind, with a name.

    Args:
        finding: (kind, name): the list of the JSON report that holds it, and its name there.
    """
    capsys.readouterr()
    code, command, html, junit = reports(folder, a, b, *more)
    text = capsys.readouterr().out
    assert code is (ExitCode.DIFFERENT if verdict == "different" else ExitCode.FINE)
    assert line in text
    run([*command, "--format", "json"])
    (case,) = json.loads(capsys.readouterr().out)["cases"]
    assert case["verdict"] == verdict
    kinds = ("provenance", "scene", "missing", "extra", "signals")
    kind, name = finding
    (item,) = case[kind]
    assert name == (item["signal"]["full_name"] if kind == "signals" else item.get("name") or item["topic"])
    assert [other for other in kinds if case[other]] == [kind]
    shown = unescape(re.sub("<[^>]+>", "", html))
    values = [name, *(wording.shown(item.get(side)) for side in ("baseline", "candidate"))]
    for part in [line] if kind in ("signals", "missing", "extra") else values:
        assert part in shown
    failures = ElementTree.parse(junit).getroot().findall(".//failure")
    assert len(failures) == (verdict == "different")
    assert all(line in failure.text for failure in failures)
    return case


@pytest.mark.parametrize(
    ("source", "edit", "name", "line"),
    [
        (
            PARKING,
            Edit(CORNER, "distance", 300, flipped(0)),
            f"{CORNER}/distance",
            f"at frame 300 (5 s): {READING!r} -> {float(flipped(0)(READING))!r} m",
        ),
        (
            HEAD,
            Edit("/tf", "transforms[2].rotation.w", 300, flipped(0)),
            "/tf/rotation/detector",
            "1 of 361 frames differ; first frame 300 (5 s)",
        ),
        (
            GUARD,
            Edit("/capacitive/side_foot", "output_voltage", 17, flipped(52)),
            "/capacitive/side_foot/output_voltage",
            "1 of 301 frames differ; first frame 17 (0.283333333 s)",
        ),
        (
            PARKING,
            Edit(CORNER, "distance", 300, lambda value: np.nan),
            f"{CORNER}/distance",
            "1 frame with NaN in place of a number, or the reverse",
        ),
        (
            HEAD,
            Edit("/collision", "level", CONTACT, lambda value: 1, TOUCHING.layout.pairs.index(PAIR)),
            f"/collision/level/{PAIR}",
            f"contact begins 1 frame later (+16.67 ms): frame {CONTACT} ({TOUCHING.time[CONTACT] / 1e9:.10g} s) -> ",
        ),
    ],
    ids=["bit", "bit of a rotation", "bit of a voltage", "NaN", "contact a frame later"],
)
def test_one_value_of_one_frame(tmp_path, capsys, source, edit, name, line):
    target = edited.write(source, tmp_path / "b.mcap", [edit])
    case = check(tmp_path, capsys, source, target, line, finding=("signals", name))
    assert case["signals"][0]["frames"] == 1


def test_topics_of_the_same_bytes_are_not_read(tmp_path):
    target = edited.write(PARKING, tmp_path / "b.mcap", [Edit(CORNER, "distance", 300, flipped(0))])
    pair = read_pair(PARKING, target)
    for recording in (pair.baseline, pair.candidate):
        assert recording.layout.distance_sensors == ("corner_head_left",)
        assert recording.layout.links == recording.layout.pairs == recording.layout.joints == ()
    assert pair.equal == 966 - 14
    assert replay.diff(PARKING, target).compared == 966
    none_may_be_nan = Rules((Rule(("/distance/corner_foot_left/*",), Tolerance(nan="fail"), "it always sees"),))
    found = replay.diff(PARKING, target, rules=none_may_be_nan)
    assert {item.signal.topic for item in found.signals} == {CORNER, "/distance/corner_foot_left"}
    assert replay.diff(PARKING, PARKING, rules=none_may_be_nan).verdict is DiffVerdict.DIFFERENT


def test_a_negative_zero_is_equal_unless_it_may_not_be(tmp_path, capsys):
    negative = Edit("/joint_states", "joints[0].position", 0, lambda value: -0.0)
    target = edited.write(PARKING, tmp_path / "b.mcap", [negative])
    assert run(["diff", str(PARKING), str(target)]) is ExitCode.FINE
    rules = tmp_path / "rules.yaml"
    rules.write_text("rules_version: 1\nrules: [{signal: '*', zero: signed, reason: signs matter here}]\n")
    line = "worst abs 0 rad at frame 0 (0 s): 0.0 -> -0.0 rad"
    name = "/joint_states/position/angulation"
    check(tmp_path, capsys, PARKING, target, line, "--rules", rules, finding=("signals", name))


@pytest.mark.parametrize("nothing", [[], [Edit(CORNER, "distance", 0, lambda value: value)]])
def test_a_file_written_again_is_the_same(tmp_path, capsys, nothing):
    assert run(["diff", str(PARKING), str(edited.write(PARKING, tmp_path / "b.mcap", nothing))]) is ExitCode.FINE
    assert capsys.readouterr().out == "same: carm_parking: all 966 signals equal in 361 frames\n"


@pytest.mark.parametrize(
    ("source", "changes", "finding", "line"),
    [
        (
            PARKING,
            {"rename": without(CORNER), "provenance": lose_sensor},
            ("missing", CORNER),
            f"missing: topic {CORNER} (14 signals)",
        ),
        (
            HEAD,
            {"rename": without("/collision")},
            ("missing", "/collision"),
            "missing: topic /collision (848 signals)",
        ),
        (HEAD, {"rename": without("/scene")}, ("scene", "/scene"), "/scene: 27 bodies -> -"),
        (
            HEAD,
            {"provenance": other_mesh},
            ("scene", "/files/package://pyskindose/phantom_data/adult_male_reduced_1000t.stl"),
            "/files/package://pyskindose/phantom_data/adult_male_reduced_1000t.stl: "
            "sha256 3f087b0f05cf... -> sha256 ffffffffffff...",
        ),
    ],
    ids=["topic", "collisions", "scene", "mesh"],
)
def test_what_is_missing_or_another(tmp_path, capsys, source, changes, finding, line):
    target = edited.write(source, tmp_path / "b.mcap", **changes)
    check(tmp_path, capsys, source, target, line, finding=finding)


def without_field(message, field):
    """Return how a schema loses a field of a message type, as when an older version wrote it."""

    def change(schema):
        files = FileDescriptorSet.FromString(schema.data)
        for file in files.file:
            for kind in file.message_type:
                kept = [one for one in kind.field if kind.name != message or one.name != field]
                del kind.field[:]
                kind.field.extend(kept)
        return Schema(schema.name, schema.encoding, files.SerializeToString())

    return change


def test_a_field_that_a_schema_has_lost_is_a_difference_and_a_new_one_is_told(tmp_path, capsys):
    fewer = edited.write(PARKING, tmp_path / "b.mcap", schema=without_field("SceneEntity", "frame_locked"))
    name = "/schemas/scene/entities.frame_locked"
    check(tmp_path, capsys, PARKING, fewer, f"{name}: field 5, bool -> -", finding=("scene", name))
    line = f"{name}: - -> field 5, bool"
    check(tmp_path, capsys, fewer, PARKING, line, finding=("provenance", name), verdict="same")


@pytest.mark.parametrize("joint", ["angulation", "table_lift"])
def test_a_joint_in_another_unit_is_a_difference_although_its_topic_is_the_same_bytes(tmp_path, capsys, joint):
    units = {}

    def swap(known):
        layout = known["layout"]
        at = layout["joints"].index(joint)
        units["before"] = layout["joint_units"][at]
        layout["joint_units"][at] = units["after"] = "m" if units["before"] == "rad" else "rad"

    other = edited.write(PARKING, tmp_path / "b.mcap", provenance=swap)
    line = f"/units/{joint}: {units['before']} -> {units['after']}"
    check(tmp_path, capsys, PARKING, other, line, finding=("scene", f"/units/{joint}"))


def test_a_library_version_is_named_and_leaves_the_verdict(tmp_path, capsys):
    target = edited.write(PARKING, tmp_path / "b.mcap", provenance=lambda known: known["libraries"].update(numpy="9.9"))
    before = read(PARKING).provenance.libraries["numpy"]
    line = f"libraries.numpy: {before} -> 9.9"
    check(tmp_path, capsys, PARKING, target, line, finding=("provenance", "libraries.numpy"), verdict="same")


def test_a_body_whose_file_is_elsewhere_is_told_and_leaves_the_verdict(tmp_path):
    before = next(name for name in read(PARKING).provenance.files if name.endswith(".stl"))

    def move(known):
        known["files"]["bodies/patient.stl"] = known["files"].pop(before)

    found = replay.diff(PARKING, edited.write(PARKING, tmp_path / "b.mcap", provenance=move))
    assert found.verdict is DiffVerdict.SAME and not found.scene
    assert {change.name for change in found.provenance} == {f"/files/{before}", "/files/bodies/patient.stl"}


def test_a_renamed_sensor_is_missing_and_extra_and_recognised(tmp_path, capsys):
    target = edited.write(PARKING, tmp_path / "b.mcap", rename=to_kopf, provenance=rename_sensor)
    code, _, html, junit = reports(tmp_path, PARKING, target)
    assert code is ExitCode.DIFFERENT
    lines = capsys.readouterr().out.splitlines()
    assert lines == [
        "different: carm_parking: 14 signals missing, 14 signals extra",
        f"  worst: topic {CORNER} is gone; 1 more reading",
        f"  missing: topic {CORNER} (14 signals); /distance/corner_kopf has exactly the same readings: renamed?",
        f"  extra: topic /distance/corner_kopf (14 signals); {CORNER} has exactly the same readings: renamed?",
    ]
    for line in lines[2:]:
        assert line.strip() in html
        assert line.strip() in junit.read_text()


@pytest.mark.parametrize("topics", [("/tf",), (CORNER,), ("/tf", "/events", CORNER)])
def test_a_file_that_lacks_topics_which_it_says_it_has_is_refused_by_their_names(tmp_path, capsys, topics):
    target = edited.write(PARKING, tmp_path / "b.mcap", rename=without(*topics))
    assert run(["diff", str(PARKING), str(target)]) is ExitCode.INVALID
    error = capsys.readouterr().err.strip()
    named = ", ".join(repr(topic) for topic in sorted(topics))
    assert error == f"replay: error: {target}: damaged: topics are missing: {named}"


def test_one_extra_pair_of_real_runs(tmp_path, capsys):
    """A pair that a scenario lets collide in one version only; everything else is computed the same."""
    path = scenes.write(tmp_path, "s")
    text = path.read_text()
    path.write_text(
        text.replace(
            "\nlinks:\n", "\nlinks:\n  post: {shapes: {pole: {type: cube, size: 0.1, pose: {xyz: [0, 3, 0]}}}}\n"
        )
    )
    both = path.read_text()
    path.write_text(both + "collision: {disable: [{pair: [arm, post], reason: never meet}]}\n")
    assert run(["run", str(path), "-o", str(tmp_path / "a"), "--no-rrd"]) is ExitCode.FINE
    path.write_text(both)
    assert run(["run", str(path), "-o", str(tmp_path / "b"), "--no-rrd"]) is ExitCode.FINE
    files = [tmp_path / side / "s" / "s.mcap" for side in "ab"]
    capsys.readouterr()
    assert run(["diff", *map(str, files)]) is ExitCode.DIFFERENT
    lines = capsys.readouterr().out.splitlines()
    assert [line for line in lines if not line.startswith(("  provenance", "    "))] == [
        "different: s: 6 signals extra, 1 difference of provenance",
        "  worst: /collision arm/rod|post/pole is new",
        "  extra: /collision arm/rod|post/pole (6 signals)",
    ]
