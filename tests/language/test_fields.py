"""What every part of the YAML has in common: rotations, directions, bounds, and that nothing unknown passes."""

import math

import numpy as np
import pytest
from pydantic import TypeAdapter, ValidationError

from replay.language.descriptions import described
from replay.language.fields import Axis, Name, Part, Placement, Quaternion, in_order, needs_one
from replay.numerics import transforms


class Bounds(Part):
    """Two bounds."""

    min: float | None = None
    """The least one."""
    max: float | None = None


def test_a_part_refuses_unknown_keys_and_changes_and_describes_its_keys():
    with pytest.raises(ValidationError, match="Extra inputs"):
        Bounds(least=1.0)
    with pytest.raises(ValidationError, match="frozen"):
        Bounds(min=1.0).min = 2.0
    assert described(Bounds, "min") == "The least one." and described(Bounds, "max") is None
    assert Bounds.model_json_schema()["properties"]["min"]["description"] == "The least one."
    with pytest.raises(ValidationError) as caught:
        Bounds(min="secret")
    assert "secret" not in str(caught.value)


@pytest.mark.parametrize("kind", [Axis, Quaternion])
def test_directions_are_unit_vectors_and_none_is_refused(kind):
    size = 3 if kind is Axis else 4
    adapter = TypeAdapter(kind)
    for values in ((2.0,) * size, (-3.0, 4.0, *(0.0,) * (size - 2)), (1e-149,) * size, (1e100,) * size):
        found = adapter.validate_python(values)
        assert math.hypot(*found) == pytest.approx(1.0, rel=1e-15)
        np.testing.assert_allclose(
            found,
            np.array(values) / max(map(abs, values)) / math.hypot(*(v / max(map(abs, values)) for v in values)),
            rtol=1e-15,
        )
    assert str(adapter.validate_python((-0.0, 1.0, *(0.0,) * (size - 2)))[0]) == "0.0"
    for values in ((0.0,) * size, (1e-160,) * size, (1e-151, *(0.0,) * (size - 1))):
        with pytest.raises(ValidationError, match="has no direction"):
            adapter.validate_python(values)
    with pytest.raises(ValidationError):
        adapter.validate_python((1.0,) * (size - 1))


def test_a_place_is_turned_first_and_moved_then():
    quarter = [0.0, 0.0, math.sin(math.pi / 4), math.cos(math.pi / 4)]
    for part in (
        Placement(xyz=(1.0, 2.0, 3.0), rpy=(0.0, 0.0, math.pi / 2)),
        Placement(xyz=(1.0, 2.0, 3.0), quat_xyzw=[2.0 * v for v in quarter]),
    ):
        T = part.transform()
        np.testing.assert_allclose(transforms.apply(T, np.array([1.0, 0.0, 0.0])), [1.0, 3.0, 3.0], atol=1e-15)
    assert (Placement().transform() == np.eye(4)).all()
    rolled = Placement(rpy=(math.pi / 2, 0.0, 0.0)).transform()
    np.testing.assert_allclose(transforms.apply(rolled, np.array([0.0, 1.0, 0.0])), [0.0, 0.0, 1.0], atol=1e-15)
    with pytest.raises(ValidationError, match="both give the rotation"):
        Placement(rpy=(0.0, 0.0, 0.0), quat_xyzw=quarter)


def test_an_expectation_says_something_and_its_bounds_leave_something():
    for part in (Bounds(min=0.0), Bounds(max=0.0), Bounds(min=1.0, max=2.0)):
        needs_one(part, "min", "max")
    with pytest.raises(Exception, match="expects nothing; add one of min, max"):
        needs_one(Bounds(), "min", "max")
    for low, high in ((None, 1.0), (1.0, None), (None, None), (1.0, 1.0), (0.0, 1.0)):
        in_order(low, high, "m")
    with pytest.raises(Exception, match=r"must not be below min, 2 m"):
        in_order(2.0, 1.9, "m")


def test_a_name_has_a_hundred_characters_at_most():
    adapter = TypeAdapter(Name)
    assert adapter.validate_python("a" * 100) == "a" * 100
    for name in ("a" * 101, "", ".a", "-a", "a b", "a/b", "ü", "a\n"):
        with pytest.raises(ValidationError):
            adapter.validate_python(name)
    assert [adapter.validate_python(name) for name in ("_", "7", "a.b-c_D")] == ["_", "7", "a.b-c_D"]
