"""Traces: what becomes of samples that are too many."""

import numpy as np
import pytest

from replay.alignment.trace import thinned


@pytest.mark.parametrize(("last", "kept"), [(6.0, [0.5, 2.5, 5.0]), (6.1, [0.5, 2.5])])
def test_neighbours_become_one_unless_a_gap_is_longer_than_twice_the_usual(last, kept):
    time = np.array([0.0, 1.0, 2.0, 3.0, 4.0, last])
    times, values = thinned(time, 10.0 * time, 3)
    np.testing.assert_allclose(times, kept)
    np.testing.assert_allclose(values, 10.0 * np.array(kept))


def test_few_samples_stay_and_what_is_left_over_goes():
    time = np.arange(7.0)
    assert all(part is whole for part, whole in zip(thinned(time, time, 7), (time, time), strict=True))
    assert thinned(time, time, 4)[0].tolist() == [0.5, 2.5, 4.5]
