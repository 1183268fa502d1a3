"""What is written is read back: by our reader bit by bit, and by the libraries of others."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import NonSeekingReader, make_reader
from mcap_protobuf.decoder import DecoderFactory

from replay.errors import InvalidValue, RecordingError, RecordingExistsError
from replay.logs import mcap_writer
from replay.numerics import transforms
from replay.recording import provenance
from replay.recording.reader import Recording, read
from replay.recording.writer import McapWriter
from replay.simulation import FrameBlock
from tests.recording import synthetic

FRAMES = 600


def write(path: Path, frames: int = FRAMES, **options: bool) -> Path:
    writer = McapWriter(path, synthetic.described(frames), synthetic.scene(), synthetic.FILES, **options)
    for block in synthetic.blocks(frames):
        writer.write(block)
    writer.commit()
    return path


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write(tmp_path_factory.mktemp("recording") / "made_up.mcap")


def assert_same(recording: Recording, blocks: list[FrameBlock]) -> None:
    """Every number of `recording` is that of the first of `blocks`, bit by bit."""
    frames = len(recording.time)
    for group in (None, "collision", "distance", "capacitive"):
        fields = ("time", "joint_positions", "joint_velocities")
        if group:
            fields = tuple(field.name for field in getattr(recording, group).fields())
        for field in fields:
            parts = [getattr(getattr(block, group) if group else block, field) for block in blocks]
            got = getattr(getattr(recording, group) if group else recording, field)
            if parts[0] is None:  # a column of other methods
                assert got is None, (group, field)
                continue
            expected = np.concatenate(parts)[:frames]
            assert (got.dtype, got.shape) == (expected.dtype, expected.shape), (group, field)
            assert got.tobytes() == expected.tobytes(), (group, field)


def test_every_number_comes_back_bit_by_bit(path: Path) -> None:
    recording = read(path)
    blocks = list(synthetic.blocks(FRAMES))
    assert len(recording.time) == FRAMES
    assert_same(recording, blocks)
    poses = np.concatenate([block.link_poses for block in blocks])
    assert recording.link_poses[..., :3, 3].tobytes() == poses[..., :3, 3].tobytes()
    assert recording.link_quaternions.tobytes() == transforms.to_quaternion(poses).tobytes()
    assert np.abs(recording.link_poses - poses).max() < 4e-15
    assert recording.files == synthetic.FILES
    assert recording.provenance == synthetic.described(FRAMES)
    assert recording.loss is None and recording.lost_frames == 0


def test_events_are_the_changes_of_the_columns(path: Path) -> None:
    recording = read(path)
    assert recording.collision is not None and recording.distance is not None and recording.capacitive is not None
    states = {
        "bounds": (recording.layout.pairs, recording.collision.level >= 1),
        "contact": (recording.layout.pairs, recording.collision.level == 2),
        "undecided": (recording.layout.pairs, recording.collision.undecided),
        "detection": (recording.layout.distance_sensors, recording.distance.status > 0),
        "too close": (recording.layout.distance_sensors, recording.distance.status == 2),
        "saturation": (recording.layout.capacitive_sensors, recording.capacitive.saturated),
    }
    for kind, (names, expected) in states.items():
        replayed = np.zeros_like(expected)
        for event in recording.events:
            if event.kind == kind:
                before = recording.time[max(event.frame - 1, 0)]
                assert before <= event.earliest <= event.time <= recording.time[event.frame]
                if kind not in ("bounds", "contact"):
                    assert (event.earliest, event.time) == (before, recording.time[event.frame])
                column = names.index(event.subject)
                assert replayed[event.frame, column] != event.begins, "an event must change something"
                replayed[event.frame :, column] = event.begins
        assert np.array_equal(replayed, expected), kind
    moments = [(event.kind, event.subject, event.begins, event.earliest, event.time) for event in recording.events]
    for block in synthetic.blocks(FRAMES):
        found = block.collision.crossings
        for k in range(len(found.pair)):
            kind, subject = ("bounds", "contact")[found.level[k] - 1], recording.layout.pairs[found.pair[k]]
            assert (kind, subject, bool(found.begins[k]), found.earliest[k], found.latest[k]) in moments
    assert [event.frame for event in recording.events] == sorted(event.frame for event in recording.events)


@pytest.mark.parametrize("seeking", [True, False])
def test_the_plain_reader_and_the_foxglove_schemas_read_it(path: Path, seeking: bool) -> None:
    blocks = list(synthetic.blocks(FRAMES))
    with path.open("rb") as stream:
        reader = (make_reader if seeking else NonSeekingReader)(
            stream, validate_crcs=True, decoder_factories=[DecoderFactory()]
        )
        counts: dict[str, int] = {}
        for schema, channel, message, decoded in reader.iter_decoded_messages():
            assert schema is not None
            topic = channel.topic
            frame = counts.get(topic, 0)
            counts[topic] = frame + 1
            block, k = blocks[frame // 256] if topic not in ("/events",) else blocks[0], frame % 256
            if topic == "/joint_states":
                assert schema.name == "foxglove.JointStates" and message.sequence == frame
                stamp = decoded.timestamp.seconds * 1_000_000_000 + decoded.timestamp.nanos
                assert stamp == message.log_time == block.time[k]
                values = np.array([joint.position for joint in decoded.joints])
                assert values.tobytes() == block.joint_positions[k].tobytes()
            elif topic == "/tf":
                names = [(t.parent_frame_id, t.child_frame_id) for t in decoded.transforms]
                assert names == [("world", link) for link in synthetic.LAYOUT.links]
                t = decoded.transforms[1].translation
                assert [t.x, t.y, t.z] == block.link_poses[k, 1, :3, 3].tolist()
                assert all(t.rotation.w >= 0 for t in decoded.transforms)
            elif topic == "/collision":
                for field in ("level", "clearance", "evaluated", "undecided"):
                    row = getattr(block.collision, field)[k]
                    assert np.array(getattr(decoded, field), dtype=row.dtype).tobytes() == row.tobytes()
            elif topic == "/scene":
                assert [entity.frame_id for entity in decoded.entities] == list(synthetic.LAYOUT.links)
                mesh = decoded.entities[0].triangles[0]
                corners = np.array([[p.x, p.y, p.z] for p in mesh.points])[list(mesh.indices)].reshape(-1, 3, 3)
                assert np.array_equal(corners, synthetic.scene().bodies[0].triangles)
            elif topic == "/layout":
                assert list(decoded.pairs) == list(synthetic.LAYOUT.pairs)
                assert list(decoded.sensors) == list(synthetic.LAYOUT.topics())
        once = ("/events", "/scene", "/layout")
        assert {topic: n for topic, n in counts.items() if topic not in once} == dict.fromkeys(
            ["/tf", "/collision", "/joint_states", "/capacitive/guard", "/distance/left", "/distance/right ä"], FRAMES
        )
        if seeking:
            summary = reader.get_summary()
            assert summary is not None and summary.statistics is not None
            assert summary.statistics.message_count == sum(counts.values())
            assert len(summary.chunk_indexes) == summary.statistics.chunk_count
            attached = {a.name: a.data for a in reader.iter_attachments()}
            assert attached == synthetic.FILES
            values = next(m for m in reader.iter_metadata() if m.name == "replay").metadata
            assert json.loads(values["layout"])["pairs"] == list(synthetic.LAYOUT.pairs)


def test_the_same_run_gives_the_same_bytes_anywhere(path: Path, tmp_path: Path) -> None:
    code = (
        "import sys; from pathlib import Path; from tests.recording.test_round_trip import write; "
        "write(Path(sys.argv[1]))"
    )
    root = Path(__file__).parents[2]
    environment = {
        **os.environ,
        "PYTHONPATH": str(root),
        "PYTHONHASHSEED": "77",
        "TZ": "Asia/Tokyo",
        "LC_ALL": "C",
        "HOME": str(tmp_path),
    }
    target = tmp_path / "elsewhere" / "another.mcap"
    subprocess.run([sys.executable, "-c", code, str(target)], check=True, env=environment, cwd=tmp_path)
    assert target.read_bytes() == path.read_bytes()
    assert str(root).encode() not in path.read_bytes()


def test_scenes_without_sensors_pairs_or_joints_come_back(tmp_path: Path) -> None:
    empty = synthetic.LAYOUT.__class__(links=("only",))
    block = next(synthetic.blocks(3))
    bare = FrameBlock(empty, 0, block.time, np.zeros((3, 0)), np.zeros((3, 0)), block.link_poses[:, :1], None)
    described = provenance.describe("bare", "a.yaml", {}, frames=3, layout=empty, model={})
    writer = McapWriter(tmp_path / "bare.mcap", described, synthetic.scene().__class__("", "", ("only",), ()), {})
    writer.write(bare)
    writer.commit()
    recording = read(tmp_path / "bare.mcap")
    assert recording.joint_positions.shape == (3, 0)
    assert recording.collision is None and recording.distance is None and recording.capacitive is None
    assert list(recording.events) == []


def test_blocks_too_large_for_a_chunk_are_cut(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, path: Path) -> None:
    monkeypatch.setattr(mcap_writer, "_CHUNK_BYTES", 20_000)
    cut = write(tmp_path / "cut.mcap")
    assert cut.read_bytes() != path.read_bytes()
    assert_same(read(cut), list(synthetic.blocks(FRAMES)))
    part = tmp_path / "cut.part"
    part.write_bytes(cut.read_bytes()[:-100_000])
    salvaged = read(part, salvage=True)
    assert len(salvaged.time) == 256
    assert_same(salvaged, list(synthetic.blocks(FRAMES)))


def test_what_may_not_be_written_is_refused(path: Path, tmp_path: Path) -> None:
    with pytest.raises(RecordingExistsError, match="--overwrite"):
        write(path)
    before = path.read_bytes()
    assert write(path, overwrite=True).read_bytes() == before
    writer = McapWriter(tmp_path / "none.mcap", synthetic.described(0), synthetic.scene(), {})
    with pytest.raises(InvalidValue):
        writer.commit()
    writer.discard()
    assert list(tmp_path.iterdir()) == []


def test_a_recording_of_another_format_says_so(path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(provenance, "READABLE_FORMATS", (3, 4))
    with pytest.raises(RecordingError, match="format 2; this version of replay reads 3 and 4"):
        read(path)
