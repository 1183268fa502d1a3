"""`/layout` says what every array of a recording has one value for."""

import pytest
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

import replay
from replay.collision.columns import CollisionColumns
from replay.guarding.columns import GuardColumns
from replay.recording import messages
from replay.recording.layout_message import layout_message
from replay.scenario.layout import Layout
from replay.scenario.load import load_sources
from replay.sensing.kinds import KINDS

TEXT = """version: 1
name: cart
rate: 20 Hz
duration: 1 s
links:
  wall: {pose: {xyz: [1, 0, 0]}, shapes: {slab: {type: cuboid, size: [2 cm, 1, 1]}}}
  cart:
    joint: {type: prismatic, axis: [1, 0, 0], lower: 0, upper: 2, velocity: 0.3, acceleration: 1}
    shapes: {box: {type: cube, size: 10 cm}}
motion: {moves: [{to: {cart: 0.2}}]}
sensors: {distance: {tip: {link: cart, pose: {xyz: [6 cm, 0, 0], rpy: [0, 90 deg, 0]}, aperture: 20 deg, range: 2}}}
guards:
  stop: {when: {distance: tip, below: 20 cm}, stop: [cart]}
  far: {when: {pair: [cart, wall], clearance: {below: 60 cm}}, slow: {to: 0.5, joints: [cart]}}
"""


@pytest.mark.parametrize("columns", [CollisionColumns, GuardColumns, *(kind.columns for kind in KINDS.values())])
def test_every_array_is_named(columns):
    assert {field.each for field in columns.fields() if field.each} <= set(messages.LAYOUT_NAMES)


def test_the_message_of_a_recording_lists_what_its_arrays_are_of(tmp_path):
    made = replay.record(load_sources("cart.yaml", {"cart.yaml": TEXT.encode()}), tmp_path, rrd=False)
    with made.mcap.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        found = {channel.topic: message for _, channel, _, message in reader.iter_decoded_messages()}
    names = found["/layout"]
    assert list(names.guards) == ["far", "stop"]
    assert len(found["/guards"].state) == len(names.guards)
    assert list(names.joints) == ["cart"]
    assert len(found["/guards"].rate) == len(names.joints)
    assert list(names.pairs) == ["cart/box|wall/slab"]
    assert list(names.sensors) == ["/distance/tip"]


def test_a_recording_without_guards_has_the_message_that_it_had_before_there_were_any():
    layout = Layout(links=("arm",), joints=("arm",), joint_units=("rad",), pairs=("arm/a|arm/b",))
    assert layout_message(layout) == b"\x0a\x03arm\x12\x03arm\x1a\x0barm/a|arm/b"
