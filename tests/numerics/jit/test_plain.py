"""Kernels as plain Python: they go on where compiled ones do, and stand where their source stands."""

import inspect
import math
import sys

import numpy as np
import pytest

from replay.numerics.jit import kernel
from replay.numerics.jit.plain import divided, of_math, plain


@kernel
def compiled_or_not(a: float, b: float) -> tuple[float, float, float, float]:
    quotient = a / b
    half = a
    half /= b
    return quotient, half, math.sqrt(-b - 1.0), math.log(b)


def everything(a: float, b: float, rows, *, scale: float = 2.0) -> "tuple[float, ...]":
    rows[0] /= b
    quotient = (a / b) * scale
    return quotient, math.sqrt(a - 3.0), math.atan2(a, b), math.pi, rows[0]


def test_a_kernel_divides_and_takes_roots_alike_compiled_and_plain():
    found = compiled_or_not(1.0, 0.0)
    assert found[:2] == (math.inf, math.inf) and math.isnan(found[2]) and found[3] == -math.inf
    found = compiled_or_not(0.0, 0.0)
    assert math.isnan(found[0]) and math.isnan(found[1])


def test_a_plain_kernel_goes_on_where_python_would_stop():
    made = plain(everything)
    rows = np.array([1.0, 1.0])
    with np.errstate(all="ignore"):
        found = made(1.0, 0.0, rows)
    assert found[0] == math.inf and math.isnan(found[1]) and found[2:] == (math.pi / 2, math.pi, math.inf)
    assert made(4.0, 2.0, np.array([1.0]), scale=3.0) == (6.0, 1.0, math.atan2(4.0, 2.0), math.pi, 0.5)
    assert made(4.0, -2.0, [1.0])[0] == -4.0
    with pytest.raises(ZeroDivisionError):
        everything(1.0, 0.0, [1.0])


def test_it_stands_in_the_lines_of_its_source():
    made = plain(everything)
    lines, first = inspect.getsourcelines(everything)
    assert (made.__module__, made.__qualname__) == (everything.__module__, "everything")
    assert inspect.signature(made) == inspect.signature(everything)
    try:
        made(1.0, "x", [1.0])
    except TypeError:
        trace = sys.exc_info()[2].tb_next
        assert trace.tb_frame.f_code.co_filename == __file__
        assert trace.tb_lineno == first + 1 and lines[1].strip() == "rows[0] /= b"


def test_closures_and_what_has_no_source_stay_as_they_are():
    factor = 2.0

    def closure(x):
        return factor / x

    assert plain(closure) is closure
    assert plain(len) is len
    typed = eval("lambda x: 1.0 / x")
    assert plain(typed) is typed


@pytest.mark.parametrize(
    ("a", "b", "quotient"), [(1, 0, math.inf), (-1.0, 0.0, -math.inf), (1.0, -0.0, -math.inf), (6, 4, 1.5)]
)
def test_quotients_are_those_of_ieee(a, b, quotient):
    assert divided(a, b) == quotient
    assert math.isnan(divided(0.0, 0.0))


@pytest.mark.parametrize(
    ("name", "numbers", "value"),
    [("log", (0.0,), -math.inf), ("exp", (1e4,), math.inf), ("sqrt", (4.0,), 2.0), ("pow", (0.0, -1.0), math.inf)],
)
def test_functions_are_those_of_ieee(name, numbers, value):
    assert of_math(name, *numbers) == value
    assert math.isnan(of_math("acos", 1.1)) and math.isnan(of_math("sqrt", -1.0))
