"""Logs of messages: several publishers, encoders that wrap, limits, and what lies outside the time."""

import json
from dataclasses import replace

import numpy as np
import pytest

import replay
from replay.errors import ScenarioError
from replay.scenario.load import load_sources
from replay.scenario.recorded_series import Unusable, check_turns, unwrapped
from tests.logs import made_logs
from tests.logs.made_logs import Said
from tests.scenario.swinging_logs import STEP, assert_same_track, load, swinging, told

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


def test_publishers_in_turn_whose_messages_overtake_each_other_are_told_as_such(tmp_path):
    """The stamps of each increase, and the log has all in the order in which they arrived."""
    mine = [replace(s, time=s.stamp + 8_000_000 * (k % 2)) for k, s in enumerate(swinging())]
    late = [replace(s, stamp=s.stamp + STEP // 4, time=s.stamp + STEP // 4, joints={"swing": 2.0}) for s in mine]
    with pytest.raises(ScenarioError, match="is moved by several publishers in turn"):
        load(tmp_path, made_logs.mcap(mine + late))


def test_a_clock_that_is_set_back_is_told_as_such(tmp_path):
    again = [replace(s, time=s.time + 10**10, joints={"swing": s.joints["swing"] + 0.4}) for s in swinging()]
    with pytest.raises(ScenarioError, match=r"times in the log that do not increase: after 1.18 s comes 0 s"):
        load(tmp_path, made_logs.mcap(swinging() + again))


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
