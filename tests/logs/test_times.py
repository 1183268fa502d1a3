"""Times from text to nanoseconds, against Python's own exact arithmetic and its calendar."""

import datetime
from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from replay.logs.times import MAX_TIME, date_nanoseconds, nanoseconds

UNITS = {"ns": 1, "us": 10**3, "ms": 10**6, "s": 10**9, "min": 6 * 10**10}


@given(
    st.decimals(allow_nan=False, allow_infinity=False, places=12, min_value=-(10**7), max_value=10**7),
    st.sampled_from([*UNITS]),
)
def test_a_decimal_number_is_exact_to_the_nanosecond(number, unit):
    assert nanoseconds(f"{number:f}", Fraction(UNITS[unit])) == round(Fraction(number) * UNITS[unit])
    assert nanoseconds(f"{number:.30E}", Fraction(UNITS[unit])) == round(Fraction(number) * UNITS[unit])


@given(st.integers(min_value=-MAX_TIME, max_value=MAX_TIME))
def test_whole_nanoseconds_stay_what_they_are(time):
    assert nanoseconds(str(time), Fraction(1)) == time
    whole, part = divmod(abs(time), 10**9)
    assert nanoseconds(f"{'-' if time < 0 else ''}{whole}.{part:09d}", Fraction(10**9)) == time


@pytest.mark.parametrize("text", ["", "1_0", "0x10", "nan", "inf", "1,5", "1 s", "--1", "1e", "e5", "1" * 81, "１"])
def test_other_text_is_no_number(text):
    assert nanoseconds(text, Fraction(1)) is None


@pytest.mark.parametrize("text", ["1e30", "-1e9999", "9" * 40, str(MAX_TIME + 1)])
def test_far_times_are_told(text):
    with pytest.raises(OverflowError):
        nanoseconds(text, Fraction(1))


@given(
    st.datetimes(datetime.datetime(1830, 1, 1), datetime.datetime(2110, 1, 1)),
    st.integers(0, 999),
    st.timedeltas(datetime.timedelta(hours=-14), datetime.timedelta(hours=14)),
    st.sampled_from("T "),
    st.sampled_from(".,"),
)
def test_a_date_is_exact_to_the_nanosecond(moment, below_us, offset, letter, sign):
    offset = datetime.timedelta(minutes=offset // datetime.timedelta(minutes=1))
    zoned = moment.replace(tzinfo=datetime.timezone(offset))
    begin = datetime.datetime(1970, 1, 1, tzinfo=datetime.UTC)
    expected = (zoned - begin) // datetime.timedelta(microseconds=1) * 1000 + below_us
    clock = moment.strftime(f"%H:%M:%S{sign}%f")
    text = f"{moment.year:04d}-{moment.month:02d}-{moment.day:02d}{letter}{clock}{below_us:03d}{zoned.isoformat()[-6:]}"
    assert date_nanoseconds(text) == (expected, True)
    plain = text[:-6]
    utc = (moment.replace(tzinfo=datetime.UTC) - begin) // datetime.timedelta(microseconds=1) * 1000 + below_us
    assert date_nanoseconds(plain) == (utc, False)
    assert date_nanoseconds(f"{plain}Z") == (utc, True)


def test_what_looks_like_a_date_may_be_none():
    assert date_nanoseconds("2024-05-01") is None
    assert date_nanoseconds("01.05.2024 12:00:00") is None
    with pytest.raises(ValueError, match="day"):
        date_nanoseconds("2023-02-30 12:00:00")
    with pytest.raises(OverflowError):
        date_nanoseconds("0001-01-01 00:00:00")
