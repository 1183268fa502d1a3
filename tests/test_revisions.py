"""Frozen readings: a method whose readings change must get a new revision, or a night's comparison is meaningless."""

import copy
import itertools
import json

import pytest

from replay.scenario.methods import METHOD_REVISIONS
from tests import frozen

pytestmark = pytest.mark.compiled  # a scene of 121 frames, by every version of every method
READINGS = json.loads(frozen.READINGS.read_text())
CAUSES = {
    "collision.pieces": ("collision.narrowphase.gjk",),
    "collision.between": ("collision.narrowphase.gjk", "collision.pieces.exact"),
}
"""What else, when it changes, changes a family's readings."""


@pytest.fixture(scope="module")
def changes():
    """The changes of each version's readings, each computed once."""
    known = {}

    def changes_of(method):
        if method not in known:
            known[method] = frozen.changes(READINGS[frozen.key_of(method)], frozen.readings(method))
        return known[method]

    return changes_of


def test_every_revision_has_frozen_readings_and_none_is_left_over():
    assert set(READINGS) == {frozen.key_of(method) for method in (frozen.SCENE, *METHOD_REVISIONS)}, "`make freeze`"


def test_poses_and_shapes_of_the_frozen_scene_are_the_same(changes):
    """No revision is to be raised for these: kinematics, primitives and meshes belong to no method."""
    assert changes(frozen.SCENE) == []


@pytest.mark.parametrize("method", METHOD_REVISIONS)
def test_readings_of_this_revision_are_frozen(method, changes):
    found = changes(method)
    causes = [other for other in (frozen.SCENE, *CAUSES.get(method.rpartition(".")[0], ())) if found and changes(other)]
    why = f"for {' and '.join(causes)} changed: look there first" if causes else frozen.advice(method)
    assert not found, f"readings of {frozen.key_of(method)} changed, {why}:\n" + "\n".join(found)


@pytest.mark.parametrize("family", sorted({method.rpartition(".")[0] for method in METHOD_REVISIONS}))
def test_the_scene_tells_any_two_versions_of_a_method_apart(family):
    if family == "collision.narrowphase":
        return  # two engines that are both right say the same of convex shapes
    of_one_scene = [m for m in METHOD_REVISIONS if m.rpartition(".")[0] == family and m not in frozen.OWN_SCENES]
    versions = [READINGS[frozen.key_of(m)] for m in of_one_scene]
    for a, b in itertools.combinations(versions, 2):
        assert a.keys() == b.keys()
        assert a != b


def planted(entry, name, change):
    changed = copy.deepcopy(entry)
    changed[name] = change(changed[name])
    return changed


@pytest.mark.parametrize(
    ("method", "name", "change"),
    [
        ("distance.exact", "/distance/down/distance", lambda v: [v[0] * (1 + 1e-8), *v[1:]]),
        ("distance.rays", "/distance/needle/distance", lambda v: [0.5 if x is None else x for x in v]),
        ("distance.rays", "/distance/needle/distance", lambda v: [None for _ in v]),
        ("distance.thesis", "/distance/wide/status", lambda v: [*v[:-1], [v[-1][0] + 1, v[-1][1]]]),
        ("distance.thesis", "/distance/wide/status", lambda v: v[:-1]),
        ("capacitive.tree", "/capacitive/pad/capacitance", lambda v: [*v[:-1], v[-1] * (1 + 3e-6)]),
        ("capacitive.exact", "/capacitive/fin/per_object/visitor/ball", lambda v: [-x for x in v]),
        ("collision.narrowphase.gjk", "/collision/clearance/slide/block|visitor/ball", lambda v: v[1:]),
        ("collision.bounds.obb", "/collision/level/arm/bow|visitor/hat", lambda v: [[0, 1], *v[1:]]),
    ],
)
def test_a_changed_reading_is_told_with_its_signal(method, name, change):
    before = READINGS[frozen.key_of(method)]
    (line,) = frozen.changes(before, planted(before, name, change))
    assert line.startswith(f"{name}: ")
    without = {other: values for other, values in before.items() if other != name}
    assert len(frozen.changes(before, without)) == 1
    assert frozen.changes(without, before) == [], "a column that a later version has more is no change of a reading"


def test_what_the_rules_accept_is_no_change():
    before = READINGS[frozen.key_of("capacitive.tree")]
    name = "/capacitive/pad/capacitance"
    assert frozen.changes(before, planted(before, name, lambda v: [x and x * (1 + 1e-6) for x in v])) == []


def test_the_advice_names_the_revision_and_its_place():
    assert "raise revisions['rays'] in replay/sensing/distance/kind.py from" in frozen.advice("distance.rays")
    assert "raise METHOD_REVISIONS['collision.pieces.hull'] in replay/scenario/methods.py from 1 to 2" in frozen.advice(
        "collision.pieces.hull"
    )


def test_freezing_adds_what_is_missing_and_changes_nothing(tmp_path):
    file = tmp_path / "readings.json"
    kept = {key: entry for key, entry in READINGS.items() if not key.startswith("distance.rays")}
    file.write_text(json.dumps({**kept, "distance.rays@0": {}}))
    new = frozen.key_of("distance.rays")
    assert frozen.freeze(file, lambda method: {"of": [method]}) == [new]
    assert json.loads(file.read_text()) == {**kept, new: {"of": ["distance.rays"]}}
    assert frozen.freeze(file, lambda method: {"again": [method]}) == []
