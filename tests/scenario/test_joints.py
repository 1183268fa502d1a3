"""Poses, where joints begin, joints that follow others, and a link that is called world."""

import io

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

import replay
from replay.errors import ScenarioError
from replay.scenario.load import load_sources
from replay.scenario.notes import notes
from replay.scenario.script import linkage

HEAD = "version: 1\nname: f\nrate: 10 Hz\nduration: 2 s\n"
LINKS = """links:
  lift: {joint: {type: prismatic, lower: 0.2, upper: 1, velocity: 1, acceleration: 1}}
  arm: {joint: {type: revolute, velocity: 1, acceleration: 1}}
  hand: {parent: arm, joint: {type: revolute, upper: 0.5, mimic: {joint: arm, multiplier: 0.5, offset: 0.1}}}
  tip: {parent: hand, joint: {type: prismatic, mimic: {joint: hand, multiplier: 2, offset: 0.1}}}
poses: {up: {lift: 0.6, arm: 0.4}, home: {lift: 0.3}}
"""


def loaded(text, **sources):
    return load_sources("f.yaml", {"f.yaml": (HEAD + text).encode(), **sources})


def initial(text):
    return {joint.name: pytest.approx(joint.initial, rel=1e-15) for joint in linkage(loaded(text)).joints}


def test_joints_begin_where_their_own_entry_the_pose_or_their_limits_say():
    assert initial(LINKS) == {"lift": 0.2, "arm": 0.0, "hand": 0.1, "tip": 0.3}
    begun = LINKS + "motion: {initial: up}\n"
    assert initial(begun) == {"lift": 0.6, "arm": 0.4, "hand": 0.3, "tip": 0.7}
    assert initial(begun.replace("upper: 1,", "upper: 1, initial: 0.9,"))["lift"] == 0.9


def test_a_leader_begins_where_its_followers_may_be():
    links = (
        "  a: {joint: {type: revolute}}\n  b: {joint: {type: revolute, lower: 1, mimic: {joint: a, multiplier: -2}}}\n"
    )
    assert initial(f"links:\n{links}") == {"a": -0.5, "b": 1.0}


def test_moves_go_to_poses_and_followers_are_recorded(tmp_path):
    scenario = loaded(LINKS + "motion: {initial: home, moves: [{to: up}]}\n")
    replay.record(scenario, tmp_path, rrd=False)
    recording = replay.read(tmp_path / "f.mcap")
    columns = dict(zip(recording.layout.joints, recording.joint_positions.T, strict=True))
    assert columns["lift"][[0, -1]].tolist() == pytest.approx([0.3, 0.6])
    assert columns["arm"][[0, -1]].tolist() == pytest.approx([0.0, 0.4])
    np.testing.assert_allclose(columns["hand"], 0.5 * columns["arm"] + 0.1, rtol=0, atol=1e-15)
    np.testing.assert_allclose(columns["tip"], 2 * columns["hand"] + 0.1, rtol=0, atol=1e-15)


def test_a_limit_of_a_follower_is_told_where_its_leader_moves():
    with pytest.raises(ScenarioError) as caught:
        loaded(LINKS + "motion:\n  moves:\n    - {to: {arm: 1}}\n")
    assert str(caught.value) == (
        "f.yaml:13:7: motion.moves[0] breaks a limit: joint 'hand': position = 0.6 rad at t = 2 s is above the upper "
        "limit 0.5 rad, which follows 'arm'"
    )
    with pytest.raises(ScenarioError, match=r"links\.arm\.joint breaks a limit: joint 'hand'"):
        loaded(LINKS.replace("acceleration: 1}}\n  hand", "acceleration: 1, initial: 1}}\n  hand"))


def test_included_files_may_hold_poses(tmp_path):
    part = LINKS.replace("poses: {up", "poses: {up: {lift: 0.5}, away")
    scenario = loaded("include: [part.yaml]\nposes: {mine: {arm: 1}}\n", **{"part.yaml": part.encode()})
    assert list(scenario.poses) == ["up", "away", "home", "mine"]
    with pytest.raises(ScenarioError, match=r"poses\.up is defined twice"):
        loaded("include: [part.yaml]\nposes: {up: {arm: 1}}\n", **{"part.yaml": part.encode()})


def test_a_log_that_holds_a_follower_is_compared_with_what_it_follows():
    log = b"time,arm,hand,tip\n0,0,0.1,0.3\n1,0.2,0.23,0.5\n2,0.4,0.3,0.7\n"
    scenario = loaded(LINKS + "motion: {recorded: {file: log.csv}}\n", **{"log.csv": log})
    told = [note.message for note in notes(scenario)]
    file, follows = "motion.recorded.file = 'log.csv' holds joint", ", which follows 'arm': the largest deviation is"
    assert told == [f"{file} 'hand'{follows} 0.03 rad at 1 s", f"{file} 'tip'{follows} 1.11e-16 m at 2 s"]
    assert list(scenario.provenance.tracks) == ["arm"]
    again = load_sources("f.yaml", scenario.sources)  # from the excerpt
    assert [note.message for note in notes(again)] == told
    with pytest.raises(ScenarioError, match=r"recorded\.joints\.hand is a joint that follows 'arm'"):
        loaded(LINKS + "motion: {recorded: {file: log.csv, joints: {hand: {name: hand}}}}\n", **{"log.csv": log})


def test_a_link_may_be_called_world(tmp_path):
    links = "links:\n  world: {pose: {xyz: [0, 0, 1]}}\n  arm: {parent: world, joint: {type: revolute}}\n"
    replay.record(loaded(links), tmp_path, rrd=False)
    path = tmp_path / "f.mcap"
    recording = replay.read(path)
    assert recording.layout.links == ("arm", "world")
    np.testing.assert_array_equal(recording.link_poses[0, 1, :3, 3], [0, 0, 1])
    reader = make_reader(io.BytesIO(path.read_bytes()), decoder_factories=[DecoderFactory()])
    transforms = next(reader.iter_decoded_messages(topics=["/tf"]))[3].transforms
    assert [(t.parent_frame_id, t.child_frame_id) for t in transforms] == [("world_", "arm"), ("world_", "world")]
