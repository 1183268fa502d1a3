"""Paths to values in messages."""

import pytest

from replay.errors import InvalidValue
from replay.logs.field_path import ABSENT, FieldPath

MESSAGE = {
    "range": 1.5,
    "data": [3, 4.5, None],
    "pose": {"position": {"x": 7}},
    "joints": [{"name": "lift", "position": 1}, {"name": "elbow", "position": 2}],
    "name": ["lift", "elbow"],
    "position": [0.1, 0.2],
}


@pytest.mark.parametrize(
    ("path", "value"),
    [
        ("range", 1.5),
        ("data[1]", 4.5),
        ("data[2]", None),
        ("pose.position.x", 7),
        ("joints[1].position", 2),
        ("joints[elbow].position", 2),
        ("position[elbow]", 0.2),
    ],
)
def test_a_path_leads_to_a_value(path, value):
    assert FieldPath.of(path).value(MESSAGE) == value


@pytest.mark.parametrize("path", ["none", "data[3]", "range.x", "joints[wrist].position", "pose[0]", "position[wrist]"])
def test_a_path_may_lead_to_nothing(path):
    assert FieldPath.of(path).value(MESSAGE) is ABSENT


@pytest.mark.parametrize("path", ["", ".", "a..b", "a[", "a]", "[0]", "a[]", "a.", ".a", "a[0"])
def test_what_is_no_path_is_refused(path):
    with pytest.raises(InvalidValue, match="is no path to a value"):
        FieldPath.of(path)
