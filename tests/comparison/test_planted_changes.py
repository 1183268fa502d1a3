"""One thing is changed in a run; the diff finds it, names it, and names nothing else."""

import dataclasses

import numpy as np
import pytest

import replay
from replay.comparison.diff import FRAMES, compare
from replay.comparison.difference import DiffVerdict, Fate
from replay.comparison.rules import Rule, Rules, Tolerance
from replay.recording.events import Events, Transition
from tests.comparison import made_up
from tests.comparison.made_up import altered, only_frames, with_names, with_provenance

BASELINE = made_up.recording()
PAIR = "arm/beam|stand/base"


def rules(pattern, **tolerance):
    return Rules((Rule((pattern,), Tolerance(**tolerance), "test"),))


def changed(change, **options):
    """Return the difference, whose verdict must be "different" and whose only finding is one signal."""
    found = compare(BASELINE, altered(BASELINE, change), **options)
    assert found.verdict is DiffVerdict.DIFFERENT
    assert not (found.missing or found.extra or found.scene or found.provenance or found.frames.missing)
    (signal,) = found.signals
    return signal


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
    assert signal.worst_abs is not None and signal.worst_abs.at == signal.first
    if "rotation" not in name:
        assert (signal.worst_abs.baseline, signal.worst_abs.candidate) == (before, after)
        assert signal.worst_abs.error == abs(before - after)


def test_a_missing_topic_is_named_with_all_its_signals():
    without = dataclasses.replace(BASELINE, collision=None)
    (absence,) = compare(BASELINE, without).missing
    assert (absence.label, absence.whole_topic, len(absence.signals)) == ("topic /collision", True, 8)
    (absence,) = compare(without, BASELINE).extra
    assert absence.label == "topic /collision"
    ignored = compare(BASELINE, without, rules=rules("/collision/*", ignore=True))
    assert ignored.verdict is DiffVerdict.SAME
    assert [item.decides for item in ignored.missing] == [False]


def test_an_extra_pair_is_named_and_the_others_are_matched_by_name():
    pairs = ("arm/beam|floor/slab", *BASELINE.layout.pairs)
    level = np.insert(BASELINE.collision.level, 0, 0, axis=1)
    wider = dataclasses.replace(
        BASELINE.collision,
        level=level,
        clearance=np.insert(BASELINE.collision.clearance, 0, np.nan, axis=1),
        evaluated=np.insert(BASELINE.collision.evaluated, 0, False, axis=1),
        undecided=np.insert(BASELINE.collision.undecided, 0, False, axis=1),
    )
    found = compare(BASELINE, with_names(dataclasses.replace(BASELINE, collision=wider), pairs=pairs))
    assert found.signals == found.missing == ()
    (absence,) = found.extra
    assert (absence.topic, absence.name, len(absence.signals)) == ("/collision", "arm/beam|floor/slab", 4)
    assert found.verdict is DiffVerdict.DIFFERENT


def test_other_event_messages_of_equal_columns_are_a_difference():
    what = Transition("contact", True, PAIR, "/collision")
    time, frame = BASELINE.time[[40, 60]], np.array([40, 60])
    events = Events(time, frame, np.array([0, 1]), (what, dataclasses.replace(what, begins=False)))
    base = dataclasses.replace(BASELINE, events=events)
    assert compare(base, dataclasses.replace(BASELINE, events=events)).verdict is DiffVerdict.SAME
    others = {
        "2 events, 1 of them only here -> 1 event": events[:1],
        "2 events, 2 of them only here -> 0": Events.none(),
        "a frame": dataclasses.replace(events, frame=frame + 1),
        "a time": dataclasses.replace(events, time=time + 1),
        "a subject": dataclasses.replace(events, transitions=(what, dataclasses.replace(what, subject="x"))),
        "an order": events[::-1],
    }
    for other in others.values():
        found = compare(base, dataclasses.replace(BASELINE, events=other))
        assert found.verdict is DiffVerdict.DIFFERENT
        (change,) = found.scene
        assert change.name == "/events"
        only = len([event for event in events if event not in list(other)])
        assert change.baseline == f"2 events, {only} of them only here"
        assert change.candidate.startswith(f"{len(other)} events, ")
        assert (
            compare(base, dataclasses.replace(BASELINE, events=other), rules=rules("/events", ignore=True)).scene == ()
        )

    def move(recording):
        recording.joint_positions[5, 0] += 1.0

    found = compare(base, dataclasses.replace(altered(BASELINE, move), events=Events.none()))
    assert len(found.signals) == 1 and found.scene == ()  # they follow from what is told


def test_a_renamed_sensor_is_recognised_by_its_readings():
    def tell_apart(recording):
        recording.distance.distance[:, 0] += 0.25

    baseline = altered(BASELINE, tell_apart)
    found = compare(baseline, with_names(baseline, distance_sensors=("links", "right")))
    (lost,), (new,) = found.missing, found.extra
    assert (lost.label, lost.same_as) == ("topic /distance/left", ("/distance/links", ""))
    assert (new.label, new.same_as) == ("topic /distance/links", ("/distance/left", ""))
    assert found.signals == ()
    assert found.verdict is DiffVerdict.DIFFERENT


def test_a_renamed_sensor_is_recognised_where_one_more_shape_renumbers_the_others():
    def tell_apart(recording):
        recording.distance.distance[:, 0] += 0.25

    def renumber(recording):
        seen = recording.distance.shape >= 0
        recording.distance.shape[seen] += 1

    def another_shape(recording):
        recording.distance.shape[20, 0] = 0

    baseline = altered(BASELINE, tell_apart)
    shapes = ("arm/a_new_one", *made_up.LAYOUT.shapes)
    candidate = with_names(altered(baseline, renumber), shapes=shapes, distance_sensors=("links", "right"))
    found = compare(baseline, candidate)
    assert [item.same_as for item in found.missing] == [("/distance/links", "")]
    other = compare(baseline, altered(candidate, another_shape))
    assert [item.same_as for item in other.missing] == [None]


def test_a_renamed_pair_is_recognised_and_equal_readings_of_several_are_not_guessed():
    found = compare(BASELINE, with_names(BASELINE, pairs=(PAIR, "arm/beam|stand/post")))
    assert [item.same_as for item in found.missing] == [("/collision", "arm/beam|stand/post")]
    renamed = with_names(BASELINE, distance_sensors=("links", "rechts"))  # both sensors read the same
    found = compare(BASELINE, renamed)
    assert [item.same_as for item in (*found.missing, *found.extra)] == [None] * 4


@pytest.mark.parametrize(("begin", "end"), [(41, 60), (42, 60), (40, 61), (39, 60)])
def test_a_shifted_contact_is_one_event(begin, end):
    def shift(recording):
        recording.collision.level[30:70, 0] = 1
        recording.collision.level[begin:end, 0] = 2

    frames = max(abs(begin - 40), abs(end - 60))
    signal = changed(shift)
    assert signal.signal.full_name == f"/collision/level/{PAIR}"
    (event,) = signal.events
    assert event.what == ("contact begins" if begin != 40 else "contact ends")
    assert event.fate is Fate.SHIFTED
    assert abs(event.shift_frames) == frames
    assert (event.baseline.frame, event.candidate.frame) == ((40, begin) if begin != 40 else (60, end))
    assert event.shift == pytest.approx((begin - 40 + end - 60) / made_up.RATE, abs=2e-9)
    allowed = compare(BASELINE, altered(BASELINE, shift), rules=rules("*/level/*", frames=frames))
    assert allowed.verdict is DiffVerdict.SAME
    assert allowed.accepted[0].events[0].allowed
    less = rules("*/level/*", time=0.9 * frames / made_up.RATE)
    assert compare(BASELINE, altered(BASELINE, shift), rules=less).verdict is DiffVerdict.DIFFERENT
    more = rules("*/level/*", time=frames / made_up.RATE)
    assert compare(BASELINE, altered(BASELINE, shift), rules=more).verdict is DiffVerdict.SAME


def test_a_contact_that_vanishes_or_appears_is_never_a_shift():
    def vanish(recording):
        recording.collision.level[made_up.CONTACT, 0] = 1

    def appear(recording):
        recording.collision.level[35, 0] = 2

    signal = changed(vanish, rules=rules("*", frames=1000))
    assert [(event.what, event.fate) for event in signal.events] == [
        ("contact begins", Fate.VANISHED),
        ("contact ends", Fate.VANISHED),
    ]
    signal = changed(appear, rules=rules("*", frames=1000))
    assert [(event.what, event.fate, event.candidate.frame) for event in signal.events] == [
        ("contact begins", Fate.APPEARED, 35),
        ("contact ends", Fate.APPEARED, 36),
    ]


def test_a_later_detection_is_one_event_and_its_readings_are_echoes():
    def later(recording):
        recording.distance.status[10:13, 0] = 0
        for name in ("distance", "point", "point_sensor", "normal"):
            getattr(recording.distance, name)[10:13, 0] = np.nan
        recording.distance.shape[10:13, 0] = recording.distance.triangle[10:13, 0] = -1
        recording.distance.case[10:13, 0] = 0

    signal = changed(later)
    assert signal.signal.full_name == "/distance/left/status"
    assert [(event.what, event.shift_frames) for event in signal.events] == [("detection begins", 3)]


def test_later_saturation_is_one_event_and_its_readings_are_echoes():
    def saturate(begin):
        def change(recording):
            columns = recording.capacitive
            columns.saturated[begin:70] = True
            columns.capacitance[begin:70] = columns.per_object[begin:70] = np.inf
            columns.output_voltage[begin:70] = 0.0
            columns.delta_output[begin:70] = 2.5

        return change

    found = compare(altered(BASELINE, saturate(50)), altered(BASELINE, saturate(51)))
    (signal,) = found.signals
    assert [(event.what, event.shift_frames) for event in signal.events] == [("saturation begins", 1)]


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


def test_shapes_are_compared_by_name_when_a_scene_has_one_more():
    def renumber(recording):
        recording.distance.shape[recording.distance.shape >= 0] += 1

    more = with_names(altered(BASELINE, renumber), shapes=("arm/aerial", *BASELINE.layout.shapes))
    assert compare(BASELINE, more).signals == ()
    (first, second) = compare(BASELINE, altered(BASELINE, renumber)).signals
    assert {first.signal.full_name, second.signal.full_name} == {"/distance/left/shape", "/distance/right/shape"}
    assert [event.what for event in first.events] == ["shape becomes stand/base", "shape becomes stand/column"]


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
