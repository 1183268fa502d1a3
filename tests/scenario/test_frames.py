"""Frame times in exact arithmetic."""

from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from replay.errors import InvalidValue
from replay.scenario.frames import seconds, time_ns

RATES = st.one_of(
    st.sampled_from([Fraction(60), Fraction(30000, 1001), Fraction(1), Fraction(4 * 10**8, 3), Fraction(2 * 10**9, 7)]),
    st.fractions(min_value=Fraction(1, 1000), max_value=10**9, max_denominator=10**15),
)


@given(rate=RATES, begin=st.integers(0, 10**6), count=st.integers(0, 20))
def test_times_are_rounded_half_to_even_from_the_exact_fraction(rate, begin, count):
    expected = [round(Fraction(k) * 10**9 / rate) for k in range(begin, begin + count)]
    assert time_ns(rate, begin, begin + count).tolist() == expected
    assert seconds(rate, begin, begin + count).tolist() == [float(Fraction(ns, 10**9)) for ns in expected]


def test_halves_go_to_the_even_neighbour():
    assert time_ns(Fraction(2 * 10**9), 0, 8).tolist() == [0, 0, 1, 2, 2, 2, 3, 4]


def test_times_beyond_64_bits_are_refused():
    with pytest.raises(InvalidValue, match="64 bits"):
        time_ns(Fraction(1), 0, 10**10)
