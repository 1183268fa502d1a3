"""Numbers as descriptions of robots have them."""

from __future__ import annotations

import math

import pytest

from replay.errors import RobotError
from replay.robots.numbers import number, numbers, size
from replay.robots.xml_text import XmlElement


def element(**attributes: str) -> XmlElement:
    return XmlElement("limit", attributes, "robot.urdf", 7)


@pytest.mark.parametrize(
    ("text", "value"),
    [("1", 1.0), ("-2.5", -2.5), ("+.5", 0.5), ("3.", 3.0), (" 4e2 ", 400.0), ("1e12", 1e12), ("-1e12", -1e12)],
)
def test_a_number_is_decimal(text, value):
    assert number(element(lower=text), "lower") == value
    assert numbers(element(xyz=f"{text} 0 {text}"), "xyz", 3) == (value, 0.0, value)


def test_there_is_one_zero():
    assert math.copysign(1.0, number(element(lower="-0.0"), "lower")) == 1.0
    assert [math.copysign(1.0, x) for x in numbers(element(xyz="-0 -0.0 0"), "xyz", 3)] == [1.0] * 3


@pytest.mark.parametrize("text", ["", "x", "1,5", "nan", "inf", "0x1", "1e12345", "1.1e12", "-1.1e12", "1 2", "1_0"])
def test_anything_else_is_told_with_its_line(text):
    with pytest.raises(
        RobotError, match=r"^robot\.urdf:7: <limit> has (no lower|lower='.*', which is no number between)"
    ):
        number(element(lower=text), "lower")


@pytest.mark.parametrize(("text", "value"), [("inf", 1), ("-inf", -1), ("+Infinity", 1), ("1e13", 1), ("-2e12", -1)])
def test_a_limit_may_be_infinite(text, value):
    assert number(element(lower=text), "lower", infinite=True) == value * math.inf
    with pytest.raises(RobotError):
        number(element(lower=text), "lower")
    assert number(element(lower="1e12"), "lower", infinite=True) == 1e12


def test_what_is_left_out_is_the_default_if_there_is_one():
    assert number(element(), "lower", 3.0) == 3.0 and number(element(lower=" "), "lower", 0.0) == 0.0
    assert numbers(element(), "xyz", 3, (1.0, 2.0, 3.0)) == (1.0, 2.0, 3.0)
    assert number(element(lower="5"), "lower", 3.0) == 5.0
    for call in (lambda: number(element(), "lower"), lambda: numbers(element(), "xyz", 3)):
        with pytest.raises(RobotError, match="<limit> has no"):
            call()


@pytest.mark.parametrize("text", ["1 2", "1 2 3 4", "1 2 x", "1 2 1.1e12", "inf 0 0"])
def test_so_many_numbers_are_told(text):
    with pytest.raises(RobotError, match="which are not 3 numbers between -1e12 and 1e12"):
        numbers(element(xyz=text), "xyz", 3)


def test_a_size_is_not_negative():
    assert size(element(radius="0"), "radius") == 0.0 and size(element(radius="0.5"), "radius") == 0.5
    with pytest.raises(RobotError, match=r"radius=-0\.1, which is below 0"):
        size(element(radius="-0.1"), "radius")
