"""Why a reading is what it is: what is told agrees with the recording and with what is computed otherwise."""

import numpy as np
import pytest

import replay
from replay.cli.exit_codes import ExitCode
from replay.cli.main import run
from replay.collision import gjk
from replay.collision.closest_triangles import closest_triangles
from replay.logs.mcap_records import Op
from replay.recording.provenance import sha256
from replay.recording.slim import attached_files
from tests.batch import scenes
from tests.fuzz import damage


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    folder = tmp_path_factory.mktemp("explain")
    paths = replay.record(scenes.with_meshes(), folder)
    return paths.mcap


def explained(recorded, capsys, signal, at):
    assert run(["explain", str(recorded), signal, "--at", str(at)]) is ExitCode.FINE
    return capsys.readouterr().out


def test_a_distance_is_told_with_its_object_triangle_and_all_methods(recorded, capsys):
    found = replay.read(recorded)
    k, row = found.layout.distance_sensors.index("eye"), 15
    text = explained(recorded, capsys, "/distance/eye/distance", 1.5)
    assert f"/distance/eye/distance at frame {row} (1.5 s)" in text
    assert found.distance.status[row, k] == 1
    name = found.layout.shapes[found.distance.shape[row, k]]
    assert f"  shape {name}\n" in text
    assert f"its triangle {found.distance.triangle[row, k]} in world" in text
    own = f"{100 * found.distance.distance[row, k]:.4g}"[:5]
    (line,) = [line for line in text.splitlines() if "distance.exact@3:" in line]
    assert line.split(": ")[1].startswith(own)
    assert "distance.rays@2: " in text and "distance.thesis@2: " in text


def test_a_capacitance_is_told_with_its_shares(recorded, capsys):
    found = replay.read(recorded)
    k = found.layout.capacitive_sensors.index("guard")
    row = int(np.flatnonzero(~found.capacitive.saturated[:, k])[0])
    text = explained(recorded, capsys, "/capacitive/guard", found.time[row] / 1e9)
    shares = found.capacitive.per_object[row, k]
    largest = found.layout.objects[int(np.argmax(shares))]
    listed = text.partition("share:\n")[2].splitlines()
    assert listed[0].split()[0] == largest and f"({shares.max() / shares.sum():.1%})" in listed[0]
    assert "capacitive.tree@" in text and "capacitive.exact@" in text
    assert "capacitive.bem@2: takes seconds; --slow asks it too" in text


def test_a_pair_is_told_with_its_closest_triangles_and_all_versions(recorded, capsys):
    found = replay.read(recorded)
    pair = next(p for p in found.layout.pairs if "slide/ball" in p and "ring/body" in p)
    text = explained(recorded, capsys, f"/collision/clearance/{pair}", 0)
    assert "closest: triangle" in text
    versions = [line for line in text.splitlines() if line.startswith("    collision.")]
    assert len(versions) == 9 and all("clearance" in line for line in versions)
    exact = next(line for line in versions if "pieces.exact" in line).split("clearance ")[1]
    assert f"surfaces there are {exact} apart" in text


def test_a_sensor_or_a_pair_may_be_named_alone(recorded, capsys):
    pair = replay.read(recorded).layout.pairs[0]
    for names in (("/distance/eye", "distance/eye", "eye"), (f"/collision/{pair}", f"collision/{pair}", pair)):
        first, *others = (explained(recorded, capsys, name, 1).splitlines()[1:] for name in names)
        assert others == [first, first]


def test_what_is_not_there_is_told(recorded, capsys):
    for signal, at, message in [
        ("/distance/nothing", "0", "is no sensor or pair of the recording; there is, for example"),
        ("/distance/eye", "99", "is no moment of the recording, which ends at 2 s"),
    ]:
        assert run(["explain", str(recorded), signal, "--at", at]) is ExitCode.INVALID
        assert message in capsys.readouterr().err


def with_scenario(recording, name, text):
    """A recording with another text attached, and the digest of that stated."""
    records, summary = damage.parse(recording.read_bytes())
    (before,) = (content for op, content in records if op == Op.ATTACHMENT and damage.text(name) in content)
    old = attached_files(recording)[2][name]
    assert before.count(old) == 1 and len(text) == len(old)
    records = [(op, before.replace(old, text) if content is before else content) for op, content in records]
    for k, (op, content) in enumerate(records):
        if op == Op.METADATA:
            records[k] = op, content.replace(sha256(old).encode(), sha256(text).encode())
    return damage.build(records, summary)


@pytest.mark.parametrize(
    ("old", "new"),
    [("{eye: {link", "{ear: {link"), ("guest", "ghost"), ("ball:", "bull:"), ("slide", "glide"), ("guard:", "guide:")],
)
def test_a_recording_that_holds_another_scenario_is_refused(recorded, tmp_path, capsys, old, new):
    text = scenes.MESHES.encode()
    path = tmp_path / "other.mcap"
    path.write_bytes(with_scenario(recorded, "meshes.yaml", text.replace(old.encode(), new.encode())))
    for signal in ("/distance/eye", "/capacitive/guard", "/collision/ring/body|slide/ball"):
        assert run(["explain", str(path), signal, "--at", "1"]) is ExitCode.INVALID
        assert "other.mcap: holds another scenario than it was made of" in capsys.readouterr().err


@pytest.mark.parametrize("seed", range(3))
def test_the_closest_triangles_are_those_of_all_pairs(seed):
    random = np.random.default_rng(seed)
    a, b = random.normal(size=(2, 20, 3, 3)) * 0.3
    a += [random.uniform(0.5, 3.0), 0.0, 0.0]
    found = closest_triangles(a, b)
    every = np.array([[gjk.distance(one, other).distance for other in b] for one in a])
    assert found.gap == pytest.approx(every.min(), rel=1e-12, abs=1e-15)
    assert every[found.triangles] == pytest.approx(every.min(), rel=1e-12, abs=1e-15)
    if found.gap > 0.0:
        assert np.linalg.norm(found.points[0] - found.points[1]) == pytest.approx(found.gap, rel=1e-9)


def test_a_long_triangle_is_closest_by_its_tip():
    small = np.array([[0.0, 0.0, 0.0], [0.0, 0.1, 0.0], [0.0, 0.0, 0.1]])
    long = np.array([[-7.0, 0.0, 0.0], [5.0, 1.0, 0.0], [5.0, -1.0, 0.0]])
    found = closest_triangles(np.stack([small - [6.0, 0.0, 0.0], long]), small[None] - [20.0, 0.0, 0.0])
    assert found.gap == pytest.approx(13.0, rel=1e-12) and found.triangles == (1, 0)
    np.testing.assert_allclose(found.points, [[-7.0, 0.0, 0.0], [-20.0, 0.0, 0.0]], atol=1e-12)
