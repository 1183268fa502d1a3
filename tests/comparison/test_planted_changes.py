"""One thing is changed in a run; the diff finds it, names it, and names nothing else."""

import dataclasses

import numpy as np
import pytest

import replay
from replay.comparison.diff import FRAMES, compare
from replay.comparison.difference import DiffVerdict
from tests.comparison import made_up
from tests.comparison.made_up import altered, only_frames, with_names, with_provenance
from tests.comparison.planted import BASELINE, PAIR, changed, rules


def test_a_run_equals_itself_and_its_copy():
    for other in (BASELINE, made_up.recording()):
        found = compare(BASELINE, other)
        assert found.verdict is DiffVerdict.SAME
        assert found.signals == found.missing == found.extra == found.scene == found.provenance == ()
        assert (found.frames.matched, found.compared) == (100, 2 * 2 + 4 * 2 + 4 * 2 + 14 * 2 + 7)


# where one bit is flipped, and the full name of the signal that it is in
PLACES = [
    (lambda r: r.joint_positions[:, 1], "/joint_states/position/turn"),
    (lambda r: r.joint_velocities[:, 0], "/joint_states/velocity/lift"),
    (lambda r: r.link_poses[:, 1, 2, 3], "/tf/translation.z/stand"),
    (lambda r: r.link_quaternions[:, 0, 3], "/tf/rotation/arm"),
    (lambda r: r.collision.clearance[:, 0], f"/collision/clearance/{PAIR}"),
    (lambda r: r.distance.distance[:, 1], "/distance/right/distance"),
    (lambda r: r.distance.point[:, 0, 1], "/distance/left/point.y"),
    (lambda r: r.distance.point_sensor[:, 1, 2], "/distance/right/point_sensor.z"),
    (lambda r: r.distance.normal[:, 0, 2], "/distance/left/normal.z"),
    (lambda r: r.capacitive.capacitance[:, 0], "/capacitive/guard/capacitance"),
    (lambda r: r.capacitive.per_object[:, 0, 1], "/capacitive/guard/per_object/stand/column"),
    (lambda r: r.capacitive.output_voltage[:, 0], "/capacitive/guard/output_voltage"),
    (lambda r: r.capacitive.delta_output[:, 0], "/capacitive/guard/delta_output"),
]


@pytest.mark.parametrize(("place", "name"), PLACES, ids=[name for _, name in PLACES])
@pytest.mark.parametrize("bit", [0, 40, 63])
def test_one_bit_of_one_double_of_one_frame(place, name, bit):
    def flip(recording):
        column = place(recording)
        column[35] = (column[35].view(np.uint64) ^ np.uint64(1 << bit)).view(np.float64)

    before, after = place(BASELINE)[35], place(altered(BASELINE, flip))[35]
    signal = changed(flip)
    assert signal.signal.full_name == name
    assert (signal.frames, signal.outside, signal.first.frame) == (1, 1, 35)
    assert signal.first.time == BASELINE.time[35] / 1e9
    assert (signal.nan, signal.infinite, signal.echo) == (0, 0, 0)
    assert (signal.events, signal.event_count, signal.lone_events) == ((), 0, 0)  # a number has none
    assert (signal.max_shift, signal.max_shift_frames) == (0.0, 0)
    assert signal.worst_abs is not None and signal.worst_abs.at == signal.first
    if "rotation" not in name:
        assert (signal.worst_abs.baseline, signal.worst_abs.candidate) == (before, after)
        assert signal.worst_abs.error == abs(before - after)


def test_nan_in_place_of_a_number_is_found_and_nan_equals_nan_unless_it_may_not():
    def lose(recording):
        recording.distance.distance[50, 0] = np.nan

    signal = changed(lose, rules=rules("*", abs=np.inf, rel=1.0))
    assert (signal.signal.full_name, signal.nan, signal.first.frame) == ("/distance/left/distance", 1, 50)
    found = compare(BASELINE, BASELINE, rules=rules("/distance/left/distance", nan="fail"))
    (signal,) = found.signals
    assert (signal.signal.full_name, signal.nan, signal.first.frame) == ("/distance/left/distance", 20, 0)


def test_an_infinity_in_place_of_a_number_passes_no_tolerance():
    def blow_up(recording):
        recording.capacitive.capacitance[5, 0] = np.inf

    assert changed(blow_up, rules=rules("*", abs=np.inf, rel=1.0)).infinite == 1


def test_zeros_of_either_sign_are_equal_unless_they_may_not_be():
    def negate(recording):
        assert recording.joint_positions[0, 0] == 0.0
        recording.joint_positions[0, 0] = -0.0

    assert compare(BASELINE, altered(BASELINE, negate)).signals == ()
    signal = changed(negate, rules=rules("/joint_states/*", zero="signed", abs=1.0))
    assert (signal.signal.full_name, signal.outside) == ("/joint_states/position/lift", 1)


def test_the_other_quaternion_of_the_same_rotation_is_equal():
    def negate(recording):
        recording.link_quaternions[:, 0] *= -1.0

    assert compare(BASELINE, altered(BASELINE, negate)).verdict is DiffVerdict.SAME


def test_a_rotation_is_compared_by_its_angle():
    def turn(recording):
        half = 0.5e-9
        x, y, z, w = recording.link_quaternions[20, 1].copy()
        recording.link_quaternions[20, 1] = x + half * w, y + half * z, z - half * y, w - half * x  # about x, by 1e-9

    signal = changed(turn)
    assert signal.signal.full_name == "/tf/rotation/stand"
    assert signal.worst_abs.error == pytest.approx(1e-9, rel=1e-6)
    assert compare(BASELINE, altered(BASELINE, turn), rules=rules("*", abs=1.01e-9)).verdict is DiffVerdict.SAME
    assert compare(BASELINE, altered(BASELINE, turn), rules=rules("*", abs=0.99e-9)).verdict is DiffVerdict.DIFFERENT


def test_another_mesh_is_a_change_of_the_scene():
    files = {**BASELINE.provenance.files, "meshes/beam.stl": "f" * 64}
    found = compare(BASELINE, with_provenance(BASELINE, files=files))
    (change,) = found.scene
    assert (change.name, change.candidate) == ("/files/meshes/beam.stl", f"sha256 {'f' * 64}")
    assert found.verdict is DiffVerdict.DIFFERENT
    accepted = compare(BASELINE, with_provenance(BASELINE, files=files), rules=rules("/files/*", ignore=True))
    assert accepted.verdict is DiffVerdict.SAME


def test_library_versions_and_models_are_named_and_leave_the_verdict():
    other = with_provenance(
        BASELINE,
        libraries={**BASELINE.provenance.libraries, "numpy": "9.9"},
        model={"capacitive": "midpoint@1"},
        code="0" * 64,
        files={**BASELINE.provenance.files, "run.yaml": "e" * 64},
    )
    found = compare(BASELINE, other)
    assert found.verdict is DiffVerdict.SAME
    assert {change.name: change.candidate for change in found.provenance} == {
        "model.capacitive": "midpoint@1",
        "code": "0" * 64,
        "libraries.numpy": "9.9",
        "/files/run.yaml": f"sha256 {'e' * 64}",
    }
    assert compare(BASELINE, other, strict_provenance=True).verdict is DiffVerdict.DIFFERENT


def test_a_joint_of_another_unit_is_a_change():
    (change,) = compare(BASELINE, with_names(BASELINE, joint_units=("rad", "rad"))).scene
    assert (change.name, change.baseline, change.candidate) == ("/units/lift", "m", "rad")


def test_frames_are_matched_by_time_and_the_others_counted():
    kept = np.delete(np.arange(100), [7, 8])
    candidate = only_frames(made_up.recording(103), np.append(kept, [100, 101, 102]))
    found = compare(BASELINE, candidate)
    assert found.signals == ()
    frames = found.frames
    assert (frames.matched, frames.missing, frames.extra) == (98, 2, 3)
    assert (frames.first_missing.frame, frames.first_extra.frame) == (7, 98)
    assert frames.first_extra.time == candidate.time[98] / 1e9
    assert found.verdict is DiffVerdict.DIFFERENT
    assert compare(BASELINE, candidate, rules=rules(FRAMES, ignore=True)).verdict is DiffVerdict.SAME


def test_no_frame_in_common_is_said():
    moved = dataclasses.replace(BASELINE, time=BASELINE.time + 1)
    found = compare(BASELINE, moved)
    assert (found.frames.matched, found.frames.missing, found.frames.extra) == (0, 100, 100)
    assert found.signals == ()


def test_frames_are_named_as_the_baseline_counts_them():
    def change(recording):
        recording.joint_positions[50, 0] += 1.0

    later = only_frames(altered(BASELINE, change), np.arange(10, 100))
    (signal,) = compare(BASELINE, later).signals
    assert signal.first.frame == 50


def test_every_difference_is_reported_and_not_only_the_first():
    def many(recording):
        recording.joint_positions[10:40, 0] *= 1.0 + 1e-9
        recording.joint_positions[20, 0] += 1e-3
        recording.joint_velocities[90, 1] = 0.0
        recording.collision.undecided[5:7, 1] = True

    found = compare(BASELINE, altered(BASELINE, many), rules=rules("/joint_states/position/*", rel=1e-8))
    assert {signal.signal.full_name: signal.outside for signal in found.signals} == {
        "/joint_states/position/lift": 1,
        "/joint_states/velocity/turn": 1,
        "/collision/undecided/arm/beam|stand/column": 2,
    }
    position = next(signal for signal in found.signals if signal.signal.field == "position")
    assert (position.frames, position.first.frame, position.worst_abs.at.frame) == (30, 20, 20)


def test_public_diff_takes_recordings_and_files(tmp_path):
    baseline = made_up.write(BASELINE, tmp_path / "a.mcap")
    assert replay.diff(baseline, str(baseline)).verdict is DiffVerdict.SAME
    assert replay.diff(BASELINE, baseline).signals == ()
    same_readings = with_provenance(BASELINE, libraries={"numpy": "9.9"})
    found = replay.diff(baseline, made_up.write(same_readings, tmp_path / "b.mcap"))
    assert found.verdict is DiffVerdict.SAME
    assert found.provenance
    assert found.compared == 59
    grown = replay.diff(baseline, made_up.write(BASELINE, tmp_path / "c.mcap", size=1.5))
    assert [change.name for change in grown.scene] == ["/scene/arm/beam", "/scene/stand/base", "/scene/stand/column"]
    assert grown.verdict is DiffVerdict.DIFFERENT
