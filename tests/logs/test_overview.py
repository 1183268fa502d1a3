"""Ranges of joints in a log of others."""

import math

import pytest

from replay.logs.overview import _Range


@pytest.mark.parametrize(
    ("positions", "lower", "upper"),
    [
        ([1.0, -2.0, 0.5], -2.0, 1.0),
        ([3.0], 3.0, 3.0),
        ([math.nan, 4.0, math.inf, -math.inf], 4.0, 4.0),
        ([math.nan], None, None),
        ([], None, None),
    ],
)
def test_a_range_counts_all_samples_and_spans_those_that_are_numbers(positions, lower, upper):
    found = _Range()
    for position in positions:
        found.add(position)
    summary = found.summary("/joints", "arm")
    assert (summary.topic, summary.joint, summary.samples) == ("/joints", "arm", len(positions))
    assert (summary.lower, summary.upper) == (lower, upper)
