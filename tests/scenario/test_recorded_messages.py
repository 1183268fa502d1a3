"""Logs of messages: several publishers, transforms, encoders that wrap, limits, and what lies outside the time."""

import json
from dataclasses import replace

import numpy as np
import pytest

import replay
from replay.errors import ScenarioError
from replay.recording.record import record
from replay.scenario.load import load_sources
from replay.scenario.notes import notes
from replay.scenario.recorded_series import Unusable, check_turns, unwrapped
from tests.logs import made_logs
from tests.logs.made_logs import Said

SCENARIO = """
version: 1
name: again
rate: 50 Hz
duration: 1 s
links:
  base: {}
  arm: {parent: base, joint: {name: swing, type: KIND, axis: [0, 1, 0]LIMITS}}
  person: {parent: base, joint: {type: free}}
motion: {recorded: {file: log.mcap MORE}}
"""
STEP = 20_000_000


def swinging(n=60, begin=1_700_000_000 * 10**9, **more):
    times = begin + STEP * np.arange(n)
    return [Said(int(t), int(t), {"swing": float(np.sin(k * 0.05))}, **more) for k, t in enumerate(times)]


def load(folder, log, more="", kind="revolute", limits=""):
    (folder / "log.mcap").write_bytes(log)
    text = SCENARIO.replace(" MORE", f", {more}" if more else "").replace("KIND", kind)
    (folder / "again.yaml").write_text(text.replace("LIMITS", f", {limits}" if limits else ""))
    return replay.load(folder / "again.yaml")


def told(scenario):
    return [str(note).partition(": ")[2] for note in notes(scenario)]


def assert_same_track(a, b):
    a, b = (scenario.provenance.tracks["swing"] for scenario in (a, b))
    np.testing.assert_array_equal(a.seconds, b.seconds)
    np.testing.assert_array_equal(a.positions, b.positions)


OTHERS = {  # what tells the second publisher, and the way out
    "channel": ({"channel": 1}, "channels 1, 2; choose one by motion.recorded.channel", "channel: 1"),
    "frame": ({"frame_id": "ghost"}, "frame_id '', 'ghost'; choose one by motion.recorded.frame_id", "frame_id: ''"),
    "nothing": ({}, "channel and frame_id do not tell them apart: record one alone", ""),
}


@pytest.mark.parametrize("shift", [0, 7_000_000])
@pytest.mark.parametrize("other", OTHERS)
def test_two_publishers_are_recognised_and_one_can_be_chosen(tmp_path, other, shift):
    mark, message, choice = OTHERS[other]
    mine = swinging()
    theirs = [replace(s, stamp=s.stamp + shift, time=s.time + shift, joints={"swing": 2.0}, **mark) for s in mine]
    log = made_logs.mcap(sorted(mine + theirs, key=lambda s: s.time))
    with pytest.raises(ScenarioError, match="is moved by several publishers") as caught:
        load(tmp_path, log)
    assert message in str(caught.value)
    if choice:
        assert_same_track(load(tmp_path, log, choice), load(tmp_path, made_logs.mcap(mine)))


def test_a_channel_or_frame_that_is_not_there_is_told(tmp_path):
    log = made_logs.mcap(swinging())
    with pytest.raises(ScenarioError, match=r"has no channel 7 on that topic; its channels are 1"):
        load(tmp_path, log, "channel: 7")
    with pytest.raises(ScenarioError, match=r"with frame_id 'tool'"):
        load(tmp_path, log, "frame_id: tool")


@pytest.mark.parametrize("ratio", [1, 3, 10])
@pytest.mark.parametrize("seed", range(10))
def test_turns_are_recognised_at_any_ratio_of_rates(seed, ratio):
    rng = np.random.default_rng(seed)
    t, u = np.arange(600) * 0.01, (np.arange(600 // ratio) + rng.uniform(0.1, 0.9)) * 0.01 * ratio
    motions = [
        rng.uniform(0.1, 2) * np.sin(rng.uniform(0.2, 5) * x + rng.uniform(0, 6)) + k for k, x in enumerate((t, u))
    ]
    order = np.argsort(np.concatenate([t, u]))
    time = np.round(np.concatenate([t, u])[order] * 1e9).astype(np.int64)
    with pytest.raises(Unusable, match="several publishers in turn"):
        check_turns(("joint",), time, np.concatenate(motions)[order])


@pytest.mark.parametrize("seed", range(10))
def test_one_publisher_takes_no_turns(seed):
    rng = np.random.default_rng(seed)
    t = np.arange(800) * 10 ** rng.uniform(-3, -1)
    time = np.round(t * 1e9).astype(np.int64)
    for value in (
        np.sin(rng.uniform(0.1, 5) * t),
        rng.normal(0, 10 ** rng.uniform(-5, -1), 800),  # noise
        np.round(rng.normal(0, 0.7, 800)) * 5e-3,  # an encoder between two steps
        np.cumsum(rng.normal(0, 0.05, 800)),
        np.repeat(rng.normal(0, 1, 40), 20),  # steps
        np.where(rng.uniform(size=800) < 0.01, 0.0, 1.0),  # dropouts
    ):
        check_turns(("joint",), time, value)
    by_hand = np.tile([0.0, 1.0], 20)
    check_turns(("joint",), (np.arange(40) * 5 * 10**8).astype(np.int64), by_hand)


def test_a_message_that_two_channels_carry_is_one(tmp_path):
    mine = swinging()
    log = made_logs.mcap([replace(s, channel=channel) for s in mine for channel in (0, 1)])
    assert_same_track(load(tmp_path, log), load(tmp_path, made_logs.mcap(mine)))


@pytest.mark.parametrize("unit", ["rad", "deg"])
def test_a_continuous_joint_goes_the_short_way_round(tmp_path, unit):
    turn = 2 * np.pi if unit == "rad" else 360.0
    truth = np.linspace(0.0, 2.3 * turn, 60)
    said = [replace(s, joints={"swing": float(p % turn)}) for s, p in zip(swinging(), truth, strict=True)]
    more = f"joints: {{swing: {{name: swing, unit: {unit}}}}}"
    scenario = load(tmp_path, made_logs.mcap(said), more, kind="continuous")
    positions = scenario.provenance.tracks["swing"].positions
    expected = truth[: len(positions)] if unit == "rad" else np.radians(truth[: len(positions)])
    np.testing.assert_allclose(positions, expected, atol=1e-13)
    assert not told(scenario)
    scenario = load(tmp_path, made_logs.mcap(said), more)
    (note,) = told(scenario)
    assert "jumps by -6." in note
    assert "if its encoder wraps there, the joint is of type continuous" in note


def test_the_short_way_is_exact_and_leaves_alone_what_counts_turns():
    np.testing.assert_array_equal(unwrapped(np.array([357.0, 359, 1, 3, 359]), 360.0), [357, 359, 361, 363, 359])
    np.testing.assert_array_equal(unwrapped(np.array([-179.0, 179, 178, -178]), 360.0), [-179, -181, -182, -178])
    np.testing.assert_array_equal(unwrapped(np.array([0.0, 200, 400, 600]), 360.0), [0, 200, 400, 600])
    np.testing.assert_array_equal(unwrapped(np.array([10.0, 5, -715, -720]), 360.0), [10, 5, 5, 0])
    np.testing.assert_array_equal(unwrapped(np.array([1.0]), 360.0), [1.0])


@pytest.mark.parametrize(
    ("position", "more", "works"),
    [
        (-1e-5, "", True),
        (-2e-4, "", False),
        (-2e-4, "limit_tolerance: 3e-4", True),
        (-2e-4, "limit_tolerance: 0.02 deg", True),
        (-2e-4, "limit_tolerance: 1 m", False),  # of a joint that turns
        (-1e-5, "limit_tolerance: 0", False),
    ],
)
def test_what_was_measured_may_be_a_little_beyond_a_limit(tmp_path, position, more, works):
    said = [replace(s, joints={"swing": abs(s.joints["swing"])}) for s in swinging()]
    said[0] = replace(said[0], joints={"swing": position})
    log, limits = made_logs.mcap(said), "lower: 0, upper: 2"
    if not works:
        with pytest.raises(ScenarioError, match="is below the lower limit 0 rad"):
            load(tmp_path, log, more, limits=limits)
        return
    scenario = load(tmp_path, log, more, limits=limits)
    assert scenario.provenance.tracks["swing"].positions[0] == position
    (note,) = told(scenario)
    assert f"is beyond a limit by up to {-position:.3g} rad, within limit_tolerance" in note
    assert next(replay.simulate(scenario)).joint_positions[0, 0] == position


def test_what_lies_outside_the_scenarios_time_does_not_matter(tmp_path):
    said = swinging()
    wild = [shifted(replace(said[-1], joints={"swing": value}), k + 3) for k, value in enumerate((np.nan, 9.0, 70.0))]
    late = [shifted(s, 100) for s in said]
    limits = "lower: -2, upper: 2"
    scenario = load(tmp_path, made_logs.mcap(said + wild), limits=limits)
    assert_same_track(scenario, load(tmp_path, made_logs.mcap(said), limits=limits))
    both = load(tmp_path, made_logs.mcap([*said, *wild, *late]), "start: 100 s", limits=limits)
    assert_same_track(both, load(tmp_path, made_logs.mcap(said), limits=limits))
    with pytest.raises(ScenarioError, match="finite number"):
        load(tmp_path, made_logs.mcap([*said, *wild, *late]), "start: 2 s", limits=limits)


def shifted(said, seconds):
    return replace(said, stamp=said.stamp + seconds * 10**9, time=said.time + seconds * 10**9)


@pytest.mark.parametrize("kind", ["cdr", "protobuf", "json"])
def test_a_simulated_clock_may_begin_at_zero(tmp_path, kind):
    said = [replace(s, stamp=s.stamp - 1_700_000_000 * 10**9) for s in swinging(n=900)]
    assert said[0].stamp == 0
    whole = load(tmp_path, made_logs.mcap(said, kind))
    assert not told(whole)
    assert whole.provenance.tracks["swing"].seconds[0] == 0.0
    later = load(tmp_path, made_logs.mcap(said, kind), "start: 10 s")
    again = load_sources(later.main_source, later.sources)
    assert again.sources == later.sources
    assert not told(again)
    assert_same_track(again, later)


@pytest.mark.parametrize("seed", range(60))
def test_an_excerpt_of_a_log_in_any_disorder_reads_as_the_log(tmp_path, seed):
    rng = np.random.default_rng(seed)
    times = int(rng.choice([0, 10**9, 10**18])) + np.cumsum(rng.integers(5_000_000, 40_000_000, rng.integers(2, 400)))
    times -= times[0] * (rng.random() < 0.3)
    said = [Said(int(t), int(t) + 7, {"swing": float(np.sin(k * 0.02)), "x": 1.0}) for k, t in enumerate(times)]
    if rng.random() < 0.3:  # no stamps at all
        said = [replace(s, stamp=0) for s in said]
    if rng.random() < 0.3:  # and before the clock
        said = [replace(s, stamp=0, time=s.time - 6) for s in said[: rng.integers(1, 4)]] + said
    if rng.random() < 0.5:
        said = [s for s in said for _ in range(rng.integers(1, 3))]
    if rng.random() < 0.5:
        said = [said[k] for k in rng.permutation(len(said))]
    if rng.random() < 0.5:
        said = [replace(s, joints={k: v for k, v in s.joints.items() if rng.random() < 0.7}) for s in said]
    more = f"start: {rng.choice([0, 0.5, 2.0]) * rng.random():.6f}"
    try:
        whole = load(tmp_path, made_logs.mcap(said, str(rng.choice([*made_logs.MESSAGES]))), more)
    except ScenarioError as error:
        assert any(
            rule in str(error)
            for rule in ("do not increase", "stamped 0", "last sample", "not in the log", "no joint of", "gap")
        )
        return
    again = load_sources(whole.main_source, whole.sources)
    assert again.sources == whole.sources
    assert_same_track(again, whole)


@pytest.mark.parametrize("first", [12_500_000_000, 1_700_000_000 * 10**9])
def test_samples_before_the_clock_was_there_are_left_out(tmp_path, first):
    said = [replace(s, stamp=s.stamp - 1_700_000_000 * 10**9 + first) for s in swinging()]
    early = [replace(s, stamp=0, time=s.time - 10**8, joints={"swing": 3.0}) for s in said[:4]]
    scenario = load(tmp_path, made_logs.mcap([*early, *said]))
    assert_same_track(scenario, load(tmp_path, made_logs.mcap(said)))
    scenario = load(tmp_path, made_logs.mcap([*early, *said]))
    (note,) = told(scenario)
    assert "begins with 4 samples stamped 0" in note


def test_protobufs_json_tells_times_as_dates(tmp_path):
    said = swinging()
    log = made_logs.mcap(said, "protobuf's json")
    assert json.loads(made_logs.protobuf_json(said[1]))["timestamp"] == "2023-11-14T22:13:20.020Z"
    assert_same_track(load(tmp_path, log), load(tmp_path, made_logs.mcap(said)))


def walking(n=60, frame="human", parent="map", begin=1_700_000_000 * 10**9):
    poses = []
    for k in range(n):
        half = 0.01 * k
        sign = -1.0 if k % 2 else 1.0  # a quaternion and its negative are one rotation
        quaternion = (0.0, 0.0, sign * np.sin(half), sign * np.cos(half))
        poses.append((begin + STEP * k, frame, parent, (1.0 + 0.02 * k, 2.0, 0.5, *quaternion)))
    return poses


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
