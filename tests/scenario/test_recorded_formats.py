"""One motion in every format of logs and every kind of disorder: read as its source, or refused with the reason."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from mcap.records import Schema
from mcap_ros2.decoder import DecoderFactory

import replay
from replay.errors import ScenarioError
from replay.logs.ros_schema import types_of
from replay.logs.ros_wire import decode_cdr, decode_ros1
from replay.scenario.notes import notes
from tests.logs import made_logs, other_writers
from tests.logs.made_logs import MESSAGES, ROS, Said

SCENARIO = """
version: 1
name: again
rate: 50 Hz
duration: 2 s
links:
  base: {}
  arm: {parent: base, joint: {name: swing, type: revolute, axis: [0, 1, 0]}}
  wheel: {parent: base, joint: {name: turn, type: continuous}}
  rail: {parent: base, joint: {name: lift, type: prismatic, axis: [0, 0, 1]}}
motion: {recorded: {file: FILE}}
"""
EPOCH = 1_700_000_000_123_456_789
FORMATS = (
    *MESSAGES,
    "db3",
    "db3 without definitions",
    "db3, written ahead",
    "bag",
    "bag, bz2",
    "folder of db3",
    "folder of mcap",
    "folder of db3, packed by file",
    "folder of db3, packed by message",
    "csv",
    "csv, semicolons and decimal commas",
    "csv, nanoseconds",
    "ros1, by mcap_ros1",
    "cdr, by mcap_ros2",
    "protobuf, by mcap_protobuf",
    "bag, by rosbags",
    "folder by rosbags, sqlite3",
    "folder by rosbags, mcap",
    "folder by rosbags, sqlite3, packed by file",
    "folder by rosbags, sqlite3, packed by message",
    "csv, quoted tabs",
    "csv, by pyarrow",
)
OTHERS = {
    "ros1, by mcap_ros1": lambda _, said: other_writers.mcap_ros1(said),
    "cdr, by mcap_ros2": lambda _, said: other_writers.mcap_ros2(said),
    "protobuf, by mcap_protobuf": lambda _, said: other_writers.mcap_protobuf(said),
    "bag, by rosbags": other_writers.rosbag1_bag,
    "csv, quoted tabs": lambda _, said: other_writers.quoted_tabs(said),
    "csv, by pyarrow": lambda _, said: other_writers.arrow_csv(said),
}
DISORDERS = ("none", "order", "subsets", "repeats", "wraps", "zero stamps", "gap outside", "gap inside", "publishers")


def source(rng, n=130):
    """A motion at about 50 Hz with uneven stamps; the recorder gets each message a little later."""
    stamps = EPOCH + np.cumsum(rng.integers(17_000_000, 23_000_000, n))
    t = (stamps - stamps[0]) / 1e9
    a, b, c = rng.uniform(0.5, 2.0, 3)
    joints = {"swing": a * np.sin(b * t), "turn": 2.9 + 3 * b * t, "lift": 0.3 + 0.2 * np.cos(c * t)}
    return [
        Said(int(stamp), int(stamp) + int(rng.integers(10_000, 900_000)), {j: float(v[k]) for j, v in joints.items()})
        for k, stamp in enumerate(stamps)
    ]


def disordered(said, disorder, rng):
    """What the log holds instead."""
    if disorder == "order":
        return [said[k] for k in rng.permutation(len(said))]
    if disorder == "subsets":  # each message tells some joints, as several drivers on one topic do
        return [replace(s, joints=dict(itertools.islice(s.joints.items(), k % 3 and 1, 3))) for k, s in enumerate(said)]
    if disorder == "repeats":
        return [s for s in said for _ in range(int(rng.integers(1, 4)))]
    if disorder == "zero stamps":
        return [*(replace(s, stamp=0) for s in said[:3]), *said[3:]]
    if disorder == "gap outside":
        return [s for k, s in enumerate(said) if k < 115 or k > 125] + [shifted(said[-1], 60)]
    if disorder == "gap inside":
        return [s for k, s in enumerate(said) if k < 20 or k > 90]
    if disorder == "publishers":
        other = [replace(s, stamp=s.stamp + 9_000_000, time=s.time + 9_000_000, joints={"lift": 0.9}) for s in said]
        return sorted(said + other, key=lambda s: s.stamp)
    return said


def shifted(said, seconds):
    return replace(said, stamp=said.stamp + seconds * 10**9, time=said.time + seconds * 10**9)


def wrapped(said):
    return [replace(s, joints=s.joints | {"turn": float(np.angle(np.exp(1j * s.joints["turn"])))}) for s in said]


def files(folder, kind, said):
    """The files of a log, and what the scenario says of it."""
    if kind in OTHERS:
        ending = {"bag": "bag", "csv": "csv"}.get(kind.partition(",")[0], "mcap")
        return {f"log.{ending}": OTHERS[kind](folder, said)}, f"log.{ending}"
    if kind.startswith("folder by rosbags, "):
        parts = other_writers.rosbag2_folder(folder, said, kind.removeprefix("folder by rosbags, "))
        return {f"drive/{name}": data for name, data in parts.items()}, "drive"
    if kind in MESSAGES:
        return {"log.mcap": made_logs.mcap(said, kind)}, "log.mcap"
    if kind.startswith("db3"):
        return {"log.db3": made_logs.db3(said, defined="without" not in kind, ahead="ahead" in kind)}, "log.db3"
    if kind.startswith("bag"):
        return {"log.bag": made_logs.bag(folder, said, "BZ2" if "bz2" in kind else None)}, "log.bag"
    if kind.startswith("folder"):
        parts = made_logs.bag_folder(said, kind.removeprefix("folder of "))
        return {f"drive/{name}": data for name, data in parts.items()}, "drive"
    if "semicolons" in kind:
        return {"log.csv": made_logs.csv(said, ";", ",")}, "log.csv"
    unit = "ns" if "nanoseconds" in kind else "s"
    return {"log.csv": made_logs.csv(said, unit=unit)}, f"log.csv, time: {{unit: {unit}}}"


def loaded(folder, kind, said):
    written, file = files(folder, kind, said)
    for name, data in written.items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_bytes(data)
    (folder / "again.yaml").write_text(SCENARIO.replace("FILE", file))
    return replay.load(folder / "again.yaml")


def truth(said, joint):
    """Times [s] from the first sample on and positions, as far as the scenario looks."""
    first = said[0].stamp
    found = [(s.stamp - first, s.joints[joint]) for s in said if joint in s.joints]
    count = next((k + 1 for k, (time, _) in enumerate(found) if time >= 2 * 10**9), len(found))
    time, position = zip(*found[:count], strict=True)
    return np.array(time) / 1e9, np.array(position)


REFUSED = {
    "gap inside": "gap of",
    "publishers": "is moved by several publishers",
    ("csv", "order"): "times in the log that do not increase",
    ("csv", "publishers"): None,  # a table has one author: a joint that goes to and fro, does
}


def refusal(kind, disorder):
    family = kind.partition(",")[0]
    return REFUSED[family, disorder] if (family, disorder) in REFUSED else REFUSED.get(disorder)


CASES = list(itertools.product(FORMATS, DISORDERS))


@pytest.mark.parametrize(("kind", "disorder"), CASES, ids=[f"{a}-{b}" for a, b in CASES])
def test_a_log_reads_as_its_source_or_is_refused_with_the_true_reason(tmp_path, kind, disorder):
    rng = np.random.default_rng(CASES.index((kind, disorder)))
    said = source(rng)
    log = disordered(said, disorder, rng)
    reason = refusal(kind, disorder)
    if reason is not None:
        with pytest.raises(ScenarioError, match=reason):
            loaded(tmp_path, kind, log)
        return
    scenario = loaded(tmp_path, kind, wrapped(log) if disorder == "wraps" else log)
    expected = [s for s in log if s.stamp] if disorder == "zero stamps" else said
    if disorder in ("subsets", "gap outside") or (disorder, kind[:3]) == ("publishers", "csv"):
        expected = log
    for joint, track in scenario.provenance.tracks.items():
        seconds, positions = truth(expected, joint)
        np.testing.assert_array_equal(track.seconds, seconds)
        if disorder == "wraps" and joint == "turn":
            steps = np.diff(track.positions)
            np.testing.assert_allclose(steps, np.diff(positions), atol=1e-14)
        else:
            np.testing.assert_array_equal(track.positions, positions)
    told = [str(note) for note in notes(scenario)]
    assert any("stamped 0" in note for note in told) == (disorder == "zero stamps"), told
    assert set(scenario.provenance.tracks) == {"swing", "turn", "lift"}


@pytest.mark.parametrize("seed", range(64))
def test_disorders_that_come_together_do_no_harm_either(tmp_path, seed):
    rng = np.random.default_rng(1000 + seed)
    kind = FORMATS[seed % len(FORMATS)]
    ways = {way for way in ("subsets", "gap outside", "zero stamps", "repeats", "order", "wraps") if rng.random() < 0.6}
    said = source(rng)
    for way in ("subsets", "gap outside"):
        said = disordered(said, way, rng) if way in ways else said
    if "zero stamps" in ways:
        log, said = disordered(said, "zero stamps", rng), said[3:]
    else:
        log = said
    log = wrapped(log) if "wraps" in ways else log
    log = disordered(log, "repeats", rng) if "repeats" in ways else log
    log = disordered(log, "order", rng) if "order" in ways and not kind.startswith("csv") else log
    tracks = loaded(tmp_path, kind, log).provenance.tracks
    assert set(tracks) == {"swing", "turn", "lift"}
    for joint, track in tracks.items():
        seconds, positions = truth(said, joint)
        np.testing.assert_array_equal(track.seconds, seconds)
        if "wraps" in ways and joint == "turn":
            np.testing.assert_allclose(np.diff(track.positions), np.diff(positions), atol=1e-14)
        else:
            np.testing.assert_array_equal(track.positions, positions)


@pytest.mark.parametrize("kind", FORMATS)
def test_a_recording_keeps_an_excerpt_that_reads_as_the_log(tmp_path, kind):
    said = source(np.random.default_rng(3), n=600)
    loaded(tmp_path, kind, said)
    path = tmp_path / "again.yaml"
    path.write_text(path.read_text().replace("{file: ", "{start: 5 s, file: "))
    whole = replay.load(path)
    name = "drive" if kind.startswith("folder") else next(n for n in whole.sources if n != "again.yaml")
    origin = whole.provenance.originals[name]
    excerpt = whole.sources[name]
    assert origin["name"] == name
    assert len(excerpt) < 0.5 * sum(file.stat().st_size for file in tmp_path.rglob("*.*") if file.is_file())
    again = replay.scenario.load.load_sources(whole.main_source, whole.sources)
    assert again.sources == whole.sources
    assert again.provenance.originals == whole.provenance.originals
    for joint, track in whole.provenance.tracks.items():
        np.testing.assert_array_equal(again.provenance.tracks[joint].seconds, track.seconds)
        np.testing.assert_array_equal(again.provenance.tracks[joint].positions, track.positions)


def test_the_encoders_of_these_tests_are_those_of_ros():
    """Against two other libraries: mcap_ros2 reads our CDR, rosbags writes the same bytes of CDR and ROS 1."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    said = source(np.random.default_rng(1))[5]
    said = replace(said, frame_id="Grundgestell")
    types = types_of(ROS, made_logs.definition("ros2msg").decode())
    ours = decode_cdr(types, ROS, made_logs.cdr(said))
    for order in "<>":
        schema = Schema(1, made_logs.definition("ros2msg"), "ros2msg", ROS)
        theirs = DecoderFactory().decoder_for("cdr", schema)(made_logs.cdr(said, order))
        assert decode_cdr(types, ROS, made_logs.cdr(said, order)) == ours
        assert (theirs.name, theirs.position, theirs.header.frame_id) == (
            ours["name"],
            ours["position"],
            ours["header"]["frame_id"],
        )
        store = get_typestore(Stores.ROS2_HUMBLE)
        message = store.deserialize_cdr(made_logs.cdr(said, order), ROS)
        assert bytes(store.serialize_cdr(message, ROS, little_endian=order == "<")) == made_logs.cdr(said, order)
    for sized in ("", "texts", "struct texts"):
        for order in "<>":
            assert decode_cdr(types, ROS, made_logs.xcdr2(said, order, sized)) == ours
    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(made_logs.definition("ros1msg").decode(), ROS))
    message = store.deserialize_ros1(made_logs.ros1(said), ROS)
    assert bytes(store.serialize_ros1(message, ROS)) == made_logs.ros1(said)
    one = decode_ros1(
        types_of("sensor_msgs/JointState", made_logs.definition("ros1msg").decode()), ROS, made_logs.ros1(said)
    )
    assert (one["name"], one["position"]) == (ours["name"], ours["position"])


@pytest.mark.parametrize("language", ["ros1msg", "ros2msg"])
def test_what_a_definition_leaves_out_is_ross_own(language):
    said = source(np.random.default_rng(4))[3]
    short = made_logs.definition(language).decode().partition("====")[0]
    decode, encode = (decode_ros1, made_logs.ros1) if language == "ros1msg" else (decode_cdr, made_logs.cdr)
    message = decode(types_of(ROS, short, ros1=language == "ros1msg"), ROS, encode(said))
    assert dict(zip(message["name"], message["position"], strict=True)) == said.joints


@pytest.mark.parametrize("kind", ["cdr", "xcdr2, delimited", "ros1"])
def test_a_message_that_its_definition_does_not_use_up_is_none(tmp_path, kind):
    said = source(np.random.default_rng(2))
    encode = MESSAGES[kind][3]
    types = types_of(ROS, made_logs.definition("ros1msg" if kind == "ros1" else "ros2msg").decode())
    decode = decode_ros1 if kind == "ros1" else decode_cdr
    whole = encode(said[0])
    assert decode(types, ROS, whole)
    for data in [whole[:k] for k in range(len(whole))] + [whole + b"\0" * 4]:
        with pytest.raises(ValueError, match=r"[a-z]"):
            decode(types, ROS, data)
