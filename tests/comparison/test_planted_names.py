"""Something has another name, is missing or is there besides; the diff matches the others by name."""

import dataclasses

import numpy as np

from replay.comparison.diff import compare
from replay.comparison.difference import DiffVerdict
from tests.comparison import made_up
from tests.comparison.made_up import altered, with_names
from tests.comparison.planted import BASELINE, PAIR, rules


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


def test_shapes_are_compared_by_name_when_a_scene_has_one_more():
    def renumber(recording):
        recording.distance.shape[recording.distance.shape >= 0] += 1

    more = with_names(altered(BASELINE, renumber), shapes=("arm/aerial", *BASELINE.layout.shapes))
    assert compare(BASELINE, more).signals == ()
    (first, second) = compare(BASELINE, altered(BASELINE, renumber)).signals
    assert {first.signal.full_name, second.signal.full_name} == {"/distance/left/shape", "/distance/right/shape"}
    assert [event.what for event in first.events] == ["shape becomes stand/base", "shape becomes stand/column"]
