"""Logs of transforms move free links."""

import numpy as np
import pytest

import replay
from replay.errors import ScenarioError
from replay.recording.record import record
from replay.scenario.load import load_sources
from tests.logs import made_logs
from tests.scenario.swinging_logs import STEP, load, swinging, walking


def test_transforms_move_a_free_link(tmp_path):
    log = made_logs.transforms([*walking(), *walking(frame="door", parent="map")])
    scenario = load(tmp_path, log, "free: {person: {child: human, parent: map}}")
    track = scenario.provenance.free_tracks["person"]
    np.testing.assert_array_equal(track.xyz[:, 0], [1.0 + 0.02 * k for k in range(51)])
    block = next(replay.simulate(scenario))
    pose = block.link_poses[:, sorted(scenario.links).index("person")]
    frames = np.arange(len(pose))
    np.testing.assert_allclose(pose[:, 0, 3], 1.0 + 0.02 * frames, atol=1e-12)
    np.testing.assert_allclose(np.arctan2(pose[:, 1, 0], pose[:, 0, 0]), 0.02 * frames, atol=1e-12)
    again = load_sources(scenario.main_source, scenario.sources)
    assert again.sources == scenario.sources
    np.testing.assert_array_equal(again.provenance.free_tracks["person"].xyz, track.xyz)
    assert load(tmp_path, log, "free: {person: {child: /human}}").provenance.free_tracks["person"].xyz.shape == (51, 3)


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ("free: {person: {child: dog}}", "is frame 'dog' in '', which is not in the log; its frames are human in map"),
        ("free: {person: {child: human, parent: odom}}", "is frame 'human' in 'odom', which is not in the log"),
        ("free: {arm: {child: human}}", "is no link with a free joint; such links are person"),
        ("topic: /tf", "holds transforms on topic '/tf', which move free links"),
        ("", "has no topic '/joint_states'; its topics are ['/tf']"),
    ],
)
def test_what_transforms_cannot_do_is_told(tmp_path, more, message):
    with pytest.raises(ScenarioError) as caught:
        load(tmp_path, made_logs.transforms(walking()), more)
    assert message in str(caught.value)


def test_frames_are_composed_along_the_tree(tmp_path):
    """A robot drives in the map and sees a person; its camera is mounted once for all, upside down."""
    begin, turned = 1_700_000_000 * 10**9, (0.0, 1.0, 0.0, 0.0)  # half a turn about y: x and z change their signs
    poses = [(begin, "camera", "robot", (0.0, 0.0, 1.5, *turned))]
    poses += [(begin + STEP * k, "robot", "map", (0.02 * k, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)) for k in range(60)]
    poses += [
        (begin + 7 * 10**6 + STEP * k, "human", "camera", (-2.0, 0.1 * k, 0.5, 0.0, 0.0, 0.0, 1.0)) for k in range(60)
    ]
    log = made_logs.transforms(poses)
    scenario = load(tmp_path, log, "free: {person: {child: human, parent: map}}")
    track = scenario.provenance.free_tracks["person"]
    t = track.seconds
    seen = np.interp(t, 0.007 + 0.02 * np.arange(60), 0.1 * np.arange(60))
    inside = t <= 1.0  # beyond, the first one that ends holds
    expected = np.stack([2.0 + t, seen, np.full(len(t), 1.0)], axis=1)
    np.testing.assert_allclose(track.xyz[inside], expected[inside], atol=1e-12)
    np.testing.assert_allclose(np.abs(track.quat_xyzw @ np.array(turned)), 1.0, atol=1e-12)
    again = load_sources(scenario.main_source, scenario.sources)
    assert again.sources == scenario.sources
    np.testing.assert_array_equal(again.provenance.free_tracks["person"].xyz, track.xyz)
    back = load(tmp_path, log, "free: {person: {child: map, parent: human}}").provenance.free_tracks["person"]
    np.testing.assert_allclose(back.xyz, track.xyz * [1, -1, 1], atol=1e-12)


def test_two_publishers_of_a_frame_are_refused(tmp_path):
    ghost = [(t + 5_000_000, child, parent, (9.0, *pose[1:])) for t, child, parent, pose in walking()]
    with pytest.raises(ScenarioError, match="several publishers in turn"):
        load(tmp_path, made_logs.transforms(sorted(walking() + ghost)), "free: {person: {child: human}}")


def test_joints_and_frames_of_one_log_move_together(tmp_path):
    import io

    from mcap.reader import make_reader
    from mcap.writer import Writer

    stream = io.BytesIO()
    writer = Writer(stream)
    writer.start()
    for log in (made_logs.mcap(swinging()), made_logs.transforms(walking())):
        schemas = {}
        for schema, channel, message in make_reader(io.BytesIO(log)).iter_messages():
            if channel.topic not in schemas:
                number = writer.register_schema(schema.name, schema.encoding, schema.data)
                schemas[channel.topic] = writer.register_channel(channel.topic, channel.message_encoding, number)
            writer.add_message(schemas[channel.topic], message.log_time, message.data, message.log_time)
    camera = writer.register_channel("/camera", "jpeg", 0)
    for k in range(60):
        writer.add_message(camera, k, np.random.default_rng(k).bytes(20_000), k)
    writer.finish()
    scenario = load(tmp_path, stream.getvalue(), "free: {person: {child: human}}")
    assert set(scenario.provenance.tracks) == {"swing"}
    assert set(scenario.provenance.free_tracks) == {"person"}
    assert len(stream.getvalue()) > 1_200_000
    assert len(scenario.sources["log.mcap"]) < 20_000
    first = record(scenario, tmp_path / "first", rrd=False).mcap
    recording = replay.read(first)
    again = load_sources(recording.provenance.root, recording.files)
    assert record(again, tmp_path / "again", rrd=False).mcap.read_bytes() == first.read_bytes()
    assert recording.provenance.originals["log.mcap"]["name"] == "log.mcap"
